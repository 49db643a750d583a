"""What can fail in the world, as a scenario says it."""

from dataclasses import dataclass

from systems.common.parameter import parameter

KINDS = (
    *("force_stuck", "force_flipped", "force_bias", "force_silent"),
    *("frame_future", "frame_lost", "estimate_nan", "tension_nan", "arm_slow"),
    *("fulcrum_aside", "fulcrum_deep"),
)
"""What can fail. Sizes: N along x in W of `force_bias` (of one sample: a spike), s that
a frame is stamped too late, rad/s of the slow arm's joints, m along x and z in W of the
fulcrum's estimate; the others have none."""


@dataclass
class Fault:
    """Something that fails in the world for a while."""

    kind: str = parameter("force_stuck", "what fails", choices=KINDS)
    start: float = parameter(0.0, "from when", "s", least=0.0, most=1e5)
    duration: float = parameter(1.0, "for how long", "s", above=0.0, most=1e5)
    size: float = parameter(0.0, "how much, in the kind's unit", least=-1e8, most=1e8)
