"""The body that a planner plans for: what all of them have to know of it."""

from dataclasses import dataclass

from systems.common.parameter import parameter


@dataclass
class BodyParams:
    """A disc with a greatest speed; in a diagram the robot's own."""

    body_radius: float = parameter(0.18, "of the body", "m", least=0.05, most=1.0)
    speed: float = parameter(0.5, "of the body", "m/s", above=0.0, most=3.0)
