"""How far R's tip may go: the navigation keeps to it, and the planner knows it."""

from dataclasses import dataclass
from math import pi

from systems.common.parameter import Rules, parameter


@dataclass
class ReachLimits:
    """Limits of the instrument R under its fulcrum; the wall is above, z up."""

    min_insertion: float = parameter(
        0.03,
        "q_min, least length of shaft inside",
        "m",
        above=0.0,
        most=0.1,
    )
    max_insertion: float = parameter(
        0.2, "greatest length of shaft inside the patient", "m", above=0.0, most=0.5
    )
    max_tilt: float = parameter(
        0.7, "greatest angle of the shaft to the vertical", "rad", above=0.0, most=pi
    )
    cone_margin: float = parameter(
        0.02,
        "the tip stays this far inside the view cone's border",
        "rad",
        least=0.0,
        most=0.5,
    )

    def rules(self) -> Rules:
        """What must hold across the limits."""
        yield (
            self.min_insertion < self.max_insertion,
            "min_insertion",
            f"less than max_insertion={self.max_insertion} m",
        )
