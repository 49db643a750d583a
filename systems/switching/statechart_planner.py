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
from math import acos, atan2, cos, hypot, isfinite, sin
from typing import NamedTuple

from systems.switching.arcs import Obstacle
from systems.switching.fields import attractive_field, helicoid_field
from systems.switching.navigation_planner import PERIOD, NavigationPlanner
from systems.switching.signals import CAPACITY

ATTRACTIVE, TO_CIRCLE, ROUND_OBSTACLE = range(3)
STATES = ("attractive", "about Omega", "about the obstacle")


@dataclass
class StatechartParams:
    """Parameters of the statechart."""

    # Radius of the body [m].
    body_radius: float = 0.18
    # Distance to keep from obstacles' surfaces [m].
    margin: float = 0.15
    # Speed of the body [m/s].
    speed: float = 0.5
    # Speed per distance to the goal [1/s], near the goal.
    gain: float = 2.0

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: If one is not positive and finite.
        """
        for name in ("body_radius", "margin", "speed", "gain"):
            value = getattr(self, name)
            if not (value > 0.0 and isfinite(value)):
                raise ValueError(f"planner: {name}={value} must be positive and finite")


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
    obstacles: Sequence[Obstacle],
    clearance: float,
) -> Obstacle | None:
    """The nearest obstacle between body and goal whose circle their line cuts."""
    gx, gy = goal[0] - place[0], goal[1] - place[1]
    length = hypot(gx, gy)
    nearest = None
    least = length
    for obstacle in obstacles:
        _, x, y, radius, _, _ = obstacle
        qx, qy = x - place[0], y - place[1]
        along = (qx * gx + qy * gy) / length
        across = (gx * qy - gy * qx) / length
        if 0.0 < along < least and abs(across) < radius + clearance:
            nearest, least = obstacle, along
    return nearest


def bypass(
    place: tuple[float, float],
    goal: tuple[float, float],
    obstacle: Obstacle,
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
    px, py = place
    track, ox, oy, _, _, _ = obstacle
    hx, hy = goal[0] - px, goal[1] - py
    length = hypot(hx, hy)
    hx, hy = hx / length, hy / length
    qx, qy = ox - px, oy - py
    b = hx * qy - hy * qx
    side = 1.0 if b >= 0.0 else -1.0
    # Within the safety circle there is no way onto it: a small turn away.
    a = max((qx * qx + qy * qy - rho * rho) / (2.0 * (rho - side * b)), 0.05 * rho)
    wx, wy = px + side * a * hy, py - side * a * hx
    k = rho / hypot(wx - ox, wy - oy)
    to_goal = max(hypot(goal[0] - ox, goal[1] - oy), rho)
    phi = atan2(goal[1] - oy, goal[0] - ox) - side * acos(rho / to_goal)
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
    ax, ay = x - m.o_x, y - m.o_y
    bx, by = place[0] - m.o_x, place[1] - m.o_y
    return m.side * (ax * by - ay * bx) >= 0.0 and ax * bx + ay * by > 0.0


def statechart_step(
    params: StatechartParams,
    m: Manoeuvre,
    place: tuple[float, float],
    goal: tuple[float, float],
    obstacles: Sequence[Obstacle],
) -> tuple[float, float, Manoeuvre]:
    """One step of the statechart (Figure 11).

    Returns:
        Velocity v_x, v_y [m/s] and the new memory.
    """
    px, py = place
    if hypot(goal[0] - px, goal[1] - py) < 1e-9:
        return 0.0, 0.0, Manoeuvre()
    clearance = params.body_radius + params.margin
    if m.state == ATTRACTIVE:
        obstacle = in_tube(place, goal, obstacles, clearance)
        if obstacle is not None:
            rho = obstacle[3] + clearance
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
        vx, vy = attractive_field(px - goal[0], py - goal[1])
        vx, vy = params.gain * vx, params.gain * vy
    scale = min(1.0, params.speed / max(hypot(vx, vy), 1e-9))
    return scale * vx, scale * vy, m


class StatechartPlanner(NavigationPlanner):
    """The thesis's own method: attractive, or one of two helicoids in turn.

    Figures 11 and 12; see the module. Obstacles' velocities are ignored.

    Port ``robot`` accepts the body's x, y, heading, speed and turn rate (5).
    Port ``seen`` accepts the obstacles in sight: track identity, x, y, radius, v_x,
    v_y of each (6 each; identity -1 for none).
    Port ``goal`` accepts the goal x, y in m (2).
    Port ``v_R`` emits the velocity to take in m/s, world frame (2).
    Port ``mode`` emits the state's number in `STATES`, the obstacle followed (-1 for
    none), the sense about it (+1 counter-clockwise), 0 and 0 (5).
    """

    def __init__(
        self,
        params: StatechartParams | None = None,
        capacity: int = CAPACITY,
        period: float = PERIOD,
    ) -> None:
        """Makes the block.

        Raises:
            ValueError: If a parameter is out of range.
        """
        super().__init__()
        self.params = params or StatechartParams()
        self.params.check()
        self.declare(
            [0.0, 0.0, *Manoeuvre()],
            lambda held: [*held[2:5], 0.0, 0.0],
            capacity,
            period,
        )

    def plan(
        self,
        held: list[float],
        robot: list[float],
        goal: list[float],
        seen: list[Obstacle],
    ) -> Sequence[float]:
        """The velocity to take (2), then the manoeuvre."""
        here, there = (robot[0], robot[1]), (goal[0], goal[1])
        memory = Manoeuvre(*held[2:])
        vx, vy, memory = statechart_step(self.params, memory, here, there, seen)
        return [vx, vy, *memory]
