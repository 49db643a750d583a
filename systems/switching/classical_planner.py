"""The classical method: the sum of an attractive and many repulsive potentials.

Section 2.1 of the thesis, equations 1 to 4, after O. Khatib, IJRR 5(1), 1986. The
robot takes the anti-gradient of the sum for its velocity, and stops for ever where
the sum vanishes. It keeps no state.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, isfinite

from systems.switching.arcs import Obstacle
from systems.switching.fields import (
    attractive_field,
    printed_repulsive_field,
    repulsive_field,
)
from systems.switching.navigation_planner import PERIOD, NavigationPlanner
from systems.switching.signals import CAPACITY

FORMS = ("khatib", "printed")


@dataclass
class ClassicalParams:
    """Parameters of the sum of potentials."""

    # "khatib", or "printed": the thesis's equation 3 as it stands, without a square
    # and with the distance to the centre.
    form: str = "khatib"
    # Radius of the body [m].
    body_radius: float = 0.18
    # Greatest speed, of each part and of the sum [m/s].
    speed: float = 0.5
    # Attraction per distance [1/s].
    gain: float = 1.0
    # Repulsion [m^4/s].
    repulsion: float = 0.01
    # Distance from the body's surface within which an obstacle repels [m]; in the
    # printed form eta, from centre to centre, has the obstacle's radius on top.
    range: float = 0.6

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: If one is out of range; tells the range.
        """
        if self.form not in FORMS:
            raise ValueError(f"form={self.form!r} must be one of {', '.join(FORMS)}")
        for name in ("body_radius", "speed", "gain", "repulsion", "range"):
            value = getattr(self, name)
            if not (value > 0.0 and isfinite(value)):
                raise ValueError(f"planner: {name}={value} must be positive and finite")


def summed_fields(
    params: ClassicalParams,
    place: tuple[float, float],
    goal: tuple[float, float],
    obstacles: Sequence[Obstacle],
) -> tuple[float, float]:
    """Velocity [m/s]: the anti-gradient of the sum (equation 4), limited.

    Args:
        params: Parameters.
        place: Where the body is [m].
        goal: Where it shall go [m].
        obstacles: The obstacles in sight; their velocities do not matter.
    """
    px, py = place
    fx, fy = attractive_field(px - goal[0], py - goal[1])
    size = params.gain * hypot(fx, fy)
    scale = params.gain * min(1.0, params.speed / size) if size > 0.0 else 0.0
    fx, fy = scale * fx, scale * fy
    for _, x, y, radius, _, _ in obstacles:
        qx, qy = px - x, py - y
        surface = radius + params.body_radius
        if params.form == "khatib":
            rx, ry = repulsive_field(qx, qy, surface, params.range, params.repulsion)
        else:
            rx, ry = printed_repulsive_field(qx, qy, surface + params.range)
        fx, fy = fx + rx, fy + ry
    size = hypot(fx, fy)
    scale = min(1.0, params.speed / size) if size > 0.0 else 0.0
    return scale * fx, scale * fy


class ClassicalPlanner(NavigationPlanner):
    """Takes the sum of all potentials' anti-gradients for its velocity.

    Section 2.1 of the thesis; see the module.

    Port ``robot`` accepts the body's x, y, heading, speed and turn rate (5).
    Port ``seen`` accepts the obstacles in sight: track identity, x, y, radius, v_x,
    v_y of each (6 each; identity -1 for none).
    Port ``goal`` accepts the goal x, y in m (2).
    Port ``v_R`` emits the velocity to take in m/s, world frame (2).
    Port ``mode`` emits five numbers as the switching planner's: 0 (there is one
    state only), -1, 1, 0, 0.
    """

    def __init__(
        self,
        params: ClassicalParams | None = None,
        capacity: int = CAPACITY,
        period: float = PERIOD,
    ) -> None:
        """Makes the block.

        Raises:
            ValueError: If a parameter is out of range.
        """
        super().__init__()
        self.params = params or ClassicalParams()
        self.params.check()
        stays = [0.0, -1.0, 1.0, 0.0, 0.0]
        self.declare([0.0, 0.0], lambda held: stays, capacity, period)

    def plan(
        self,
        held: list[float],
        robot: list[float],
        goal: list[float],
        seen: list[Obstacle],
    ) -> Sequence[float]:
        """The velocity to take (2)."""
        here, there = (robot[0], robot[1]), (goal[0], goal[1])
        return summed_fields(self.params, here, there, seen)
