"""Station target: the tube's station as the target that the local planner knows.

The planner carries a shaft to the tip of a tool. Here the tool is a line through the
resting trocar that ends at the station, and moves with the organ.
"""

from collections.abc import Sequence
from typing import Any

from systems.common.compiled import compiled, packed
from systems.common.geometry import along
from systems.common.signal import vector
from systems.common.signals import Estimate
from systems.common.step_block import StepBlock
from systems.sensing.organ_estimator import OrganMotion

_STILL = (0.0, 0.0, 0.0)


@compiled
def _target(c: Any, organ: OrganMotion) -> tuple[Estimate]:
    z = (c.axis[0], c.axis[1], c.axis[2])
    p = along(organ.p, -c.standoff, z)
    fulcrum = along(p, -0.1, z)
    # What its motion is not known for is left to the margins of the tools.
    return (Estimate(p, organ.v, _STILL, fulcrum, 1e-4, 1e-3, 0.0, 1.0, 0.0),)


class StationTarget(StepBlock):
    """The station of the tube as a planner's target.

    Port ``organ`` accepts the entry's `OrganMotion`.

    Port ``estimate`` emits the station's `Estimate`.
    """

    def __init__(
        self, standoff: float = 0.053, axis: Sequence[float] = (0.0, 0.0, -1.0)
    ) -> None:
        """Makes the block: standoff in m from the entry, against the axis z_E."""
        super().__init__()
        self.declare_map(
            _target,
            [packed(standoff=standoff, axis=vector(axis))],
            {"organ": OrganMotion},
            "estimate",
            Estimate,
        )
