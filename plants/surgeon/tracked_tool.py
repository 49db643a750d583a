"""A surgeon's tool that another program's tracker follows, in the real world."""

from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.surgeon.surgeon_tool import SurgeonToolParams
from systems.common.block import Block
from systems.common.geometry import sub, unit
from systems.common.outside import PERIOD
from systems.common.signal import Field, Vector, flat, vector, view
from systems.common.signals import Shaft, Velocity


class Sighting(NamedTuple):
    """A shaft as another program has it; where it was seen last, if it is not."""

    tip: Annotated[Vector, Field("m", "p_WP", (0.05, 0.0, -0.12))]
    u: Annotated[Vector, Field("1", "towards the tip", (0.0, 0.0, -1.0))]
    seen: Annotated[float, Field("1", "1 if it is seen, else 0", 1.0)]


def unsighted(tool: SurgeonToolParams) -> Sighting:
    """The sighting of a tool before it is seen: at its first waypoint."""
    tip = vector(tool.points[0])
    return Sighting(tip, unit(sub(tip, vector(tool.p_WG))), 0.0)


class TrackedTool(Block):
    """A tool in the surgeon's hand as a tracker outside the diagram sees it.

    Port ``sighting`` accepts the `Sighting`.
    Port ``shaft`` emits the tool's `Shaft`, out of sight the last that was seen.
    Port ``shown`` emits the same for the diagram's tracker: not a number out of sight.
    Port ``tip_velocity`` emits the tip's `Velocity` between the last two sightings.
    """

    def __init__(self, period: float = PERIOD) -> None:
        """Makes the block; `period` is that of the sightings, in s."""
        super().__init__()
        self._sighting = self.signal_in("sighting", Sighting)
        self._period = period
        self.state_out("tip_velocity", Velocity, np.zeros(3))
        self._last = self.DeclareDiscreteState(np.full(3, np.nan))
        reads = {self._sighting.ticket()}
        self.signal_out("shaft", Shaft, lambda c: self._calc(c, False), reads)
        self.signal_out("shown", Shaft, lambda c: self._calc(c, True), reads)
        self.update_every(period, self._update)

    def _calc(self, context: Any, shown: bool) -> np.ndarray:
        told = view(Sighting, self._sighting.Eval(context))
        hidden = shown and not told.seen
        return np.full(6, np.nan) if hidden else flat((told.tip, told.u))

    def _update(self, context: Any) -> tuple[np.ndarray, np.ndarray]:
        tip = view(Sighting, self._sighting.Eval(context)).tip
        tip = np.where(np.isfinite(tip), tip, np.nan)
        last = context.get_discrete_state(self._last).value()
        v = (tip - last) / self._period
        return np.where(np.isfinite(v), v, 0.0), tip
