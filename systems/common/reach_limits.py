"""How far R's tip may go: the navigation keeps to it, and the planner knows it."""

from dataclasses import dataclass
from math import pi
from typing import Any

from systems.common.compiled import compiled
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

    # The less of the shaft is inside, the wider is its other end's way.
    wrist_speed: float = parameter(
        0.25,
        "of the shaft's outer end, which turning asks of the arm",
        "m/s",
        above=0.0,
        most=100.0,
    )
    wrist_acceleration: float = parameter(5.0, "likewise", "m/s^2", above=0.0, most=1e3)
    shaft_length: float = parameter(
        0.4, "from the outer end to the tip", "m", above=0.0, most=1.0
    )

    def rules(self) -> Rules:
        """What must hold across the limits."""
        yield (
            self.min_insertion < self.max_insertion,
            "min_insertion",
            f"less than max_insertion={self.max_insertion} m",
        )


@compiled
def lever(limits: Any, q: float) -> float:
    """How far the tip goes sideways for the wrist's way, q, m, of the shaft inside.

    Args:
        limits: A record with what `ReachLimits` says.
        q: In m.
    """
    return q / max(limits.shaft_length - q, 0.01)


@compiled
def fastest_sideways(limits: Any, q: float, turning_speed: float) -> float:
    """Greatest speed of the tip across the shaft, of which q is inside, in m/s.

    Args:
        limits: A record with what `ReachLimits` says.
        q: In m.
        turning_speed: Of the shaft, in rad/s.
    """
    return min(q * turning_speed, lever(limits, q) * limits.wrist_speed)
