"""The classical method: the sum of an attractive and many repulsive potentials.

Section 2.1 of the thesis, equations 1 to 4, after O. Khatib, IJRR 5(1), 1986. The
robot takes the anti-gradient of the sum for its velocity, and stops for ever where
the sum vanishes. It keeps no state.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import Any

from plants.turtlebot.signals import RobotState
from systems.common.parameter import parameter
from systems.switching.body import BodyParams
from systems.switching.fields import (
    attractive_field,
    printed_attractive_field,
    printed_repulsive_field,
    repulsive_field,
)
from systems.switching.navigation_planner import PERIOD, NavigationPlanner, Planned
from systems.switching.signals import Corner, Goal, Mode, PlanarVelocity, Seen

FORMS = ("khatib", "printed")
ATTRACTIONS = ("gradient", "printed")


@dataclass
class ClassicalParams(BodyParams):
    """Parameters of the sum of potentials."""

    form: str = parameter(
        "khatib",
        "of the repulsion; printed is the thesis's equation 3 as it stands, without a "
        "square and with the distance to the centre",
        choices=FORMS,
    )
    attraction: str = parameter(
        "gradient",
        "its form; printed is the thesis's equation 2 as it stands, a length without "
        "a direction",
        choices=ATTRACTIONS,
    )
    # Khatib's saturation is not in the thesis, and makes zeros of the sum of its own.
    clipped: bool = parameter(True, "whether the attraction alone is limited to speed")
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


def field_sum(
    params: ClassicalParams,
    place: tuple[float, float],
    goal: tuple[float, float],
    obstacles: Sequence[Seen],
) -> tuple[float, float]:
    """The anti-gradient of the sum (equation 4) [m/s].

    Args:
        params: Parameters.
        place: Where the body is [m].
        goal: Where it shall go [m].
        obstacles: The obstacles in sight; their velocities do not matter.
    """
    (px, py), (gx, gy) = place, goal
    printed = params.attraction == "printed"
    attract = printed_attractive_field if printed else attractive_field
    fx, fy = attract(px - gx, py - gy)
    fx, fy = params.gain * fx, params.gain * fy
    if params.clipped:
        fx, fy = limited(fx, fy, params.speed)
    is_khatib, body = params.form == "khatib", params.body_radius
    for obstacle in obstacles:
        qx, qy = px - obstacle.x, py - obstacle.y
        surface = obstacle.radius + body
        if is_khatib:
            rx, ry = repulsive_field(qx, qy, surface, params.range, params.repulsion)
        else:
            rx, ry = printed_repulsive_field(qx, qy, surface + params.range)
        fx, fy = fx + rx, fy + ry
    return fx, fy


def summed_fields(
    params: ClassicalParams,
    place: tuple[float, float],
    goal: tuple[float, float],
    obstacles: Sequence[Seen],
) -> tuple[float, float]:
    """Velocity [m/s]: `field_sum` within the speed."""
    return limited(*field_sum(params, place, goal, obstacles), params.speed)


def limited(x: float, y: float, most: float) -> tuple[float, float]:
    """A vector no longer than `most`."""
    size = hypot(x, y)
    scale = min(1.0, most / size) if size > 0.0 else 0.0
    return scale * x, scale * y


class ClassicalPlanner(NavigationPlanner):
    """Takes the sum of all potentials' anti-gradients for its velocity.

    Section 2.1 of the thesis; see the module.

    Port ``robot`` accepts the `RobotState`.
    Port ``seen`` accepts rows of `Seen`.
    Port ``goal`` accepts the `Goal`.
    Port ``corners`` accepts rows of `Corner`, which do not matter to it.
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
        super().__init__(params or ClassicalParams(), period)

    def plan(
        self,
        robot: RobotState,
        goal: Goal,
        seen: list[Seen],
        corners: list[Corner],
        *memory: Any,
    ) -> Planned:
        """The velocity to take; nothing is remembered."""
        vx, vy = summed_fields(self.params, (robot.x, robot.y), goal, seen)
        return Planned(PlanarVelocity(vx, vy), Mode())
