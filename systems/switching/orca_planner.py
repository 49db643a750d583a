"""ORCA as the robot's planner: a peer that everybody knows, beside the switching one.

J. van den Berg, S. Guy, M. Lin, D. Manocha, "Reciprocal n-body collision avoidance",
ISRR 2011, as the crowds' people walk (`plants/crowd/orca.py`): the robot takes half of
each evasion and counts on the others for the rest. It keeps no state.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot
from typing import Any

import numpy as np

from plants.crowd.orca import orca_velocity
from plants.crowd.signals import Obstacle
from plants.turtlebot.signals import RobotState
from systems.common.parameter import parameter
from systems.switching.arcs import DISC_SIZE, Disc, time_to_enter
from systems.switching.body import BodyParams
from systems.switching.navigation_planner import (
    PERIOD,
    NavigationPlanner,
    Planned,
    velocity,
)
from systems.switching.signals import Corner, Goal, Mode, PlanarVelocity, Seen

_NEIGHBOURS = 20
"""The nearest ones count."""
_SOON = 2.0
"""Before an obstacle comes within two margins the body may drive backwards, s."""


@dataclass
class OrcaParams(BodyParams):
    """Parameters of ORCA."""

    margin: float = parameter(
        0.1, "distance to keep from obstacles' surfaces", "m", least=0.0, most=2.0
    )
    gain: float = parameter(
        2.0, "speed per distance, near the goal", "1/s", above=0.0, most=20.0
    )
    horizon: float = parameter(
        5.0, "time for which pairs must stay apart", "s", above=0.0, most=60.0
    )


def orca_step(
    params: OrcaParams,
    place: tuple[float, float],
    v: tuple[float, float],
    goal: tuple[float, float],
    obstacles: Sequence[Seen],
    dt: float,
) -> tuple[float, float]:
    """The velocity to take [m/s].

    Args:
        params: Parameters.
        place: Where the body is [m].
        v: Its velocity [m/s].
        goal: Where it shall go [m].
        obstacles: The obstacles in sight.
        dt: Time in which discs that overlap must separate [s].
    """
    (x, y), (goal_x, goal_y) = place, goal
    gx, gy = goal_x - x, goal_y - y
    me = Obstacle(x, y, params.body_radius + params.margin, *v)
    others = [Obstacle(*one[1:]) for one in obstacles]
    others.sort(key=lambda one: hypot(one.x - x, one.y - y))
    way = max(hypot(gx, gy), 1e-9)
    pace = min(params.speed, params.gain * way) / way
    wanted, near = (pace * gx, pace * gy), others[:_NEIGHBOURS]
    return orca_velocity(me, near, wanted, params.speed, params.horizon, dt)


def retreats(
    place: tuple[float, float], obstacles: Sequence[Seen], clearance: float
) -> bool:
    """Whether something moving comes within a clearance [m] of the body soon."""
    moving = [
        Disc(o.track, place[0] - o.x, place[1] - o.y, o.radius, o.v_x, o.v_y)
        for o in obstacles
        if o.v_x or o.v_y
    ]
    discs = np.array(moving, float).reshape(-1, DISC_SIZE)
    return time_to_enter(0.0, 0.0, discs, clearance) < _SOON


class OrcaPlanner(NavigationPlanner):
    """Takes the velocity of ORCA; what stands and what moves are alike to it.

    Port ``robot`` accepts the `RobotState`.
    Port ``seen`` accepts rows of `Seen`.
    Port ``goal`` accepts the `Goal`.
    Port ``corners`` accepts rows of `Corner`, which do not matter to it.
    Port ``v_R`` emits the `PlanarVelocity` to take.
    Port ``mode`` emits the `Mode`: there is one state only, and it may retreat.
    """

    def __init__(
        self, params: OrcaParams | None = None, period: float = PERIOD
    ) -> None:
        """Makes the block.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__(params or OrcaParams(), period)

    def plan(
        self,
        robot: RobotState,
        goal: Goal,
        seen: list[Seen],
        corners: list[Corner],
        *memory: Any,
    ) -> Planned:
        """The velocity to take; nothing is remembered."""
        params, place = self.params, (robot.x, robot.y)
        v = orca_step(params, place, velocity(robot), goal, seen, self.period)
        clearance = params.body_radius + 2.0 * params.margin
        back = float(retreats(place, seen, clearance))
        return Planned(PlanarVelocity(*v), Mode(retreat=back))
