"""The classical method: the sum of an attractive and many repulsive potentials.

Section 2.1 of the thesis, equations 1 to 4, after O. Khatib, IJRR 5(1), 1986. The
robot takes the anti-gradient of the sum for its velocity, and stops for ever where
the sum vanishes. It keeps no state.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import Any

from plants.turtlebot.turtlebot import RobotState
from systems.common.parameter import check, parameter
from systems.switching.fields import (
    attractive_field,
    printed_repulsive_field,
    repulsive_field,
)
from systems.switching.navigation_planner import PERIOD, NavigationPlanner, Planned
from systems.switching.signals import Goal, Mode, PlanarVelocity, Seen

FORMS = ("khatib", "printed")


@dataclass
class ClassicalParams:
    """Parameters of the sum of potentials."""

    form: str = parameter(
        "khatib",
        "of the repulsion; printed is the thesis's equation 3 as it stands, without a "
        "square and with the distance to the centre",
        choices=FORMS,
    )
    body_radius: float = parameter(0.18, "of the body", "m", least=0.05, most=1.0)
    speed: float = parameter(
        0.5, "greatest, of each part and of the sum", "m/s", above=0.0, most=3.0
    )
    gain: float = parameter(1.0, "attraction per distance", "1/s", above=0.0, most=20.0)
    repulsion: float = parameter(
        0.01, "eta of Khatib's equation", "m^4/s", above=0.0, most=1.0
    )
    range: float = parameter(
        0.6,
        "distance from the body's surface within which an obstacle repels; in the "
        "printed form eta, from centre to centre, has both radii on top",
        "m",
        above=0.0,
        most=10.0,
    )


def summed_fields(
    params: ClassicalParams,
    place: tuple[float, float],
    goal: tuple[float, float],
    obstacles: Sequence[Seen],
) -> tuple[float, float]:
    """Velocity [m/s]: the anti-gradient of the sum (equation 4), limited.

    Args:
        params: Parameters.
        place: Where the body is [m].
        goal: Where it shall go [m].
        obstacles: The obstacles in sight; their velocities do not matter.
    """
    (px, py), (gx, gy) = place, goal
    fx, fy = attractive_field(px - gx, py - gy)
    size = params.gain * hypot(fx, fy)
    scale = params.gain * min(1.0, params.speed / size) if size > 0.0 else 0.0
    fx, fy = scale * fx, scale * fy
    is_khatib, body = params.form == "khatib", params.body_radius
    for obstacle in obstacles:
        qx, qy = px - obstacle.x, py - obstacle.y
        surface = obstacle.radius + body
        if is_khatib:
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

    Port ``robot`` accepts the `RobotState`.
    Port ``seen`` accepts rows of `Seen`.
    Port ``goal`` accepts the `Goal`.
    Port ``v_R`` emits the `PlanarVelocity` to take.
    Port ``mode`` emits the `Mode`, always the same: there is one state only.
    """

    def __init__(
        self, params: ClassicalParams | None = None, period: float = PERIOD
    ) -> None:
        """Makes the block.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        self.params = params or ClassicalParams()
        check(self.params)
        self.declare(period)

    def plan(
        self, robot: RobotState, goal: Goal, seen: list[Seen], *memory: Any
    ) -> Planned:
        """The velocity to take; nothing is remembered."""
        vx, vy = summed_fields(self.params, (robot.x, robot.y), goal, seen)
        return Planned(PlanarVelocity(vx, vy), Mode())
