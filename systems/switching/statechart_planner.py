"""The thesis's statechart: attractive, or bypassing in two sub-states.

Section 3.2 and its note: on meeting an obstacle "compute the sense, x_Omega and
y_Omega, P1 and P2, the two potentials with their c". The most plausible reading,
for obstacles that stand: a helicoid about a point Omega beside the robot leads onto
the obstacle's safety circle at P1, the helicoid about the obstacle leads round it
to P2, from where the goal is in clear sight. Both circles are tangent where they
meet, so that the heading never jumps.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import acos, atan2, cos, hypot, sin
from typing import Any, NamedTuple

from plants.turtlebot.signals import RobotState
from systems.common.parameter import parameter
from systems.switching.body import BodyParams
from systems.switching.fields import attractive_field, helicoid_field
from systems.switching.navigation_planner import PERIOD, NavigationPlanner, Planned
from systems.switching.signals import Corner, Goal, Mode, PlanarVelocity, Seen

ATTRACTIVE, TO_CIRCLE, ROUND_OBSTACLE = range(3)
STATES = ("attractive", "about Omega", "about the obstacle")


@dataclass
class StatechartParams(BodyParams):
    """Parameters of the statechart."""

    margin: float = parameter(
        0.15, "distance to keep from obstacles' surfaces", "m", least=0.02, most=2.0
    )
    gain: float = parameter(
        2.0, "speed per distance, near the goal", "1/s", above=0.0, most=20.0
    )


class Manoeuvre(NamedTuple):
    """The statechart's memory: state and the two circles of a bypass."""

    state: float = 0.0
    track: float = -1.0
    # Sense about the obstacle: +1 counter-clockwise.
    side: float = 1.0
    omega_x: float = 0.0
    omega_y: float = 0.0
    p1_x: float = 0.0
    p1_y: float = 0.0
    p2_x: float = 0.0
    p2_y: float = 0.0
    o_x: float = 0.0
    o_y: float = 0.0
    # Gains of the two helicoids [m^2/s], c > 0 clockwise.
    c_omega: float = 0.0
    c_o: float = 0.0


def in_tube(
    place: tuple[float, float],
    goal: tuple[float, float],
    obstacles: Sequence[Seen],
    clearance: float,
) -> Seen | None:
    """The nearest obstacle between body and goal whose circle their line cuts."""
    (px, py), (gx, gy) = place, goal
    gx, gy = gx - px, gy - py
    length = hypot(gx, gy)
    nearest = None
    least = length
    for obstacle in obstacles:
        qx, qy = obstacle.x - px, obstacle.y - py
        along = (qx * gx + qy * gy) / length
        across = (gx * qy - gy * qx) / length
        if 0.0 < along < least and abs(across) < obstacle.radius + clearance:
            nearest, least = obstacle, along
    return nearest


def bypass(
    place: tuple[float, float],
    goal: tuple[float, float],
    obstacle: Seen,
    rho: float,
    speed: float,
) -> Manoeuvre:
    """The two circles that lead round an obstacle in the tube to the goal.

    With J the turn by +90 degrees, h the unit vector to the goal, d the distance
    and b = (o - p) . J h the obstacle's offset to the left: sense sigma = +1 if
    b >= 0; a = (d^2 - rho^2) / (2 (rho - sigma b)); Omega = p - sigma a J h;
    P1 = o + rho (Omega - o) / (a + rho); P2 = o + rho (cos phi, sin phi) with
    phi = angle(g - o) - sigma acos(rho / |g - o|); c_Omega = sigma v a and
    c_O = -sigma v rho.

    Args:
        place: Body [m].
        goal: Goal [m].
        obstacle: An obstacle in the tube.
        rho: Radius of its safety circle [m].
        speed: Speed v on both circles [m/s].
    """
    (px, py), (gx, gy) = place, goal
    track, ox, oy, _, _, _ = obstacle
    hx, hy = gx - px, gy - py
    length = hypot(hx, hy)
    hx, hy = hx / length, hy / length
    qx, qy = ox - px, oy - py
    b = hx * qy - hy * qx
    side = 1.0 if b >= 0.0 else -1.0
    # Within the safety circle there is no way onto it: a small turn away.
    a = max((qx * qx + qy * qy - rho * rho) / (2.0 * (rho - side * b)), 0.05 * rho)
    wx, wy = px + side * a * hy, py - side * a * hx
    k = rho / hypot(wx - ox, wy - oy)
    to_goal = max(hypot(gx - ox, gy - oy), rho)
    phi = atan2(gy - oy, gx - ox) - side * acos(rho / to_goal)
    return Manoeuvre(
        float(TO_CIRCLE),
        track,
        side,
        wx,
        wy,
        ox + k * (wx - ox),
        oy + k * (wy - oy),
        ox + rho * cos(phi),
        oy + rho * sin(phi),
        ox,
        oy,
        side * speed * a,
        -side * speed * rho,
    )


def passed(m: Manoeuvre, place: tuple[float, float], x: float, y: float) -> bool:
    """Whether the body has come round to the point x, y of the safety circle."""
    px, py = place
    ax, ay = x - m.o_x, y - m.o_y
    bx, by = px - m.o_x, py - m.o_y
    return m.side * (ax * by - ay * bx) >= 0.0 and ax * bx + ay * by > 0.0


def statechart_step(
    params: StatechartParams,
    m: Manoeuvre,
    place: tuple[float, float],
    goal: tuple[float, float],
    obstacles: Sequence[Seen],
) -> tuple[float, float, Manoeuvre]:
    """One step of the statechart (Figure 11).

    Returns:
        Velocity v_x, v_y [m/s] and the new memory.
    """
    (px, py), (gx, gy) = place, goal
    if hypot(gx - px, gy - py) < 1e-9:
        return 0.0, 0.0, Manoeuvre()
    clearance = params.body_radius + params.margin
    if m.state == ATTRACTIVE:
        obstacle = in_tube(place, goal, obstacles, clearance)
        if obstacle is not None:
            rho = obstacle.radius + clearance
            m = bypass(place, goal, obstacle, rho, params.speed)
    if m.state == TO_CIRCLE and passed(m, place, m.p1_x, m.p1_y):
        m = m._replace(state=float(ROUND_OBSTACLE))
    if m.state == ROUND_OBSTACLE and passed(m, place, m.p2_x, m.p2_y):
        m = Manoeuvre()
    if m.state == TO_CIRCLE:
        vx, vy = helicoid_field(px - m.omega_x, py - m.omega_y, m.c_omega)
    elif m.state == ROUND_OBSTACLE:
        vx, vy = helicoid_field(px - m.o_x, py - m.o_y, m.c_o)
    else:
        vx, vy = attractive_field(px - gx, py - gy)
        vx, vy = params.gain * vx, params.gain * vy
    scale = min(1.0, params.speed / max(hypot(vx, vy), 1e-9))
    return scale * vx, scale * vy, m


class StatechartPlanner(NavigationPlanner):
    """The thesis's own method: attractive, or one of two helicoids in turn.

    Figures 11 and 12; see the module. Obstacles' velocities are ignored.

    Port ``robot`` accepts the `RobotState`.
    Port ``seen`` accepts rows of `Seen`.
    Port ``goal`` accepts the `Goal`.
    Port ``corners`` accepts rows of `Corner`, which do not matter to it.
    Port ``v_R`` emits the `PlanarVelocity` to take.
    Port ``mode`` emits the `Mode`; its states are `STATES`.
    """

    def __init__(
        self, params: StatechartParams | None = None, period: float = PERIOD
    ) -> None:
        """Makes the block.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__(params or StatechartParams(), period, Manoeuvre())

    def plan(
        self,
        robot: RobotState,
        goal: Goal,
        seen: list[Seen],
        corners: list[Corner],
        *memory: Any,
    ) -> Planned:
        """The velocity to take; remembers the manoeuvre."""
        (m,) = memory
        vx, vy, m = statechart_step(self.params, m, (robot.x, robot.y), goal, seen)
        return Planned(PlanarVelocity(vx, vy), Mode(m.state, m.track, m.side), (m,))
