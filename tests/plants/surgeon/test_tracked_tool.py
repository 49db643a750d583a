"""A tool that another program's tracker follows."""

import numpy as np
from pydrake.systems.analysis import Simulator

from plants.surgeon.surgeon_tool import SurgeonToolParams
from plants.surgeon.tracked_tool import Sighting, TrackedTool, unsighted
from systems.common.outside import PERIOD
from systems.common.signal import flat, view
from systems.common.signals import Shaft


def test_out_of_sight_it_is_where_it_was_and_is_not_shown():
    tool = TrackedTool()
    simulator = Simulator(tool)
    context = simulator.get_mutable_context()
    first = unsighted(SurgeonToolParams())
    assert first.seen == 0.0
    np.testing.assert_allclose(np.linalg.norm(first.u), 1.0)
    told = [first, *(Sighting((k * 1e-3, 0.0, -0.1), first.u, 1.0) for k in range(3))]
    told.append(told[-1]._replace(seen=0.0))
    tips, shown, speeds = [], [], []
    for k, sighting in enumerate(told):
        tool.GetInputPort("sighting").FixValue(context, flat(sighting))
        simulator.AdvanceTo((k + 0.5) * PERIOD)
        read = {p: tool.GetOutputPort(p).Eval(context) for p in ("shaft", "shown")}
        tips.append(view(Shaft, read["shaft"]).tip)
        shown.append(np.isfinite(read["shown"]).all())
        speeds.append(tool.GetOutputPort("tip_velocity").Eval(context)[0])
    np.testing.assert_allclose(tips, [t.tip for t in told])
    assert shown == [False, True, True, True, False]
    np.testing.assert_allclose(speeds[3:], [1e-3 / PERIOD, 0.0], atol=1e-12)
    assert speeds[0] == 0.0
