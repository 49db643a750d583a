"""The "Go-to Target" behaviour: Bauzano et al., section 4.1, equations (1) to (4).

The robot's tool R is a line through its fulcrum G_R, and so is the surgeon's
obstacle tool O. The closest points of the two are the guide point M_R and M_O,
rho apart. M_R sits at the proportion s of R's inserted length; when the tip
has arrived, it will be at M_R^f = G_R + s (P_S - G_R). A potential field pulls
M_R to M_R^f and pushes it away from M_O.

Everything is tied to the proportion s: the tip moves with v_1 / s. Equation
(4) is integrated for the tip (force F_1 / s), which is the same for a constant
s and leaves the tip's velocity continuous where M_R jumps along the shaft.

Two forms:

`corrected` (default). Equation (2) as the gradient it comes from,
U_rep = K/2 (1/rho - 1/rho_0)^2 r with r = |r_goal|:
F_rep = K'_r (1/rho - 1/rho_0) [ r/rho^2 n_o + 1/2 (1/rho - 1/rho_0) n ], n_o
the unit vector from M_O to M_R. n, the paper's constant that is to lead out of
local minima, is a unit vector perpendicular to n_o on the goal's side, turned
to a fixed side (R retracting) where goal and obstacle are in line. Equation (4)
gets a virtual damping D relative to the moving target, and the velocity that
force and damping balance at is limited to s v_max:
dv_1/dt = F_1 - D (v_1 - s v_S). r counts no less than a floor, so that a goal
inside the field does not switch the field off, and no more than the distance at
which attraction alone asks for v_max; attraction is cut at the same distance.

`printed`. Equations (1) to (4) to the letter, v_1 limited to s v_max. It pushes
the robot away from its goal rather than from the obstacle, and orbits.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp, sqrt
from typing import Any, NamedTuple

import numpy as np

from systems.auto_guidance.nearest import nearest_obstacle
from systems.common.compiled import compiled, packed
from systems.common.geometry import (
    across,
    all_finite,
    along,
    any_perpendicular,
    closest_points,
    cross,
    dot,
    limited,
    norm,
    plus,
    scaled,
    sub,
    unit,
)
from systems.common.parameter import check, parameter
from systems.common.signal import Many, Vector
from systems.common.signals import (
    Estimate,
    Guide,
    RobotTool,
    Velocity,
    finite_tool,
    usable,
)
from systems.common.step_block import StepBlock

FORMS = ("corrected", "printed")

# How far (sine of the angle between goal and obstacle) the fixed side counts.
_TIE = 0.05


NOWHERE = (0.0, 0.0, 0.0)
"""Where the tip counts as long as nothing is known."""


@dataclass
class GoToTargetParams:
    """Parameters of `GoToTarget`; the virtual mass is 1.

    With the defaults attraction and repulsion balance 10 mm off the obstacle's surface,
    at O's tip.
    """

    form: str = parameter("corrected", "of equations (2) and (4)", choices=FORMS)
    period: float = parameter(1 / 60, "of the update", "s", above=0.0, most=1.0)
    attraction_gain: float = parameter(120.0, "K_a", "1/s^2", above=0.0, most=1e4)
    repulsion_gain: float = parameter(
        4e-4, "K_r; m^4/s^2 in the printed form", "m^3/s^2", least=0.0, most=0.1
    )
    influence_distance: float = parameter(0.025, "rho_0", "m", above=0.0, most=0.2)
    contact_distance: float = parameter(
        0.005,
        "taken from the axes' distance to give the rho of the potential: both tools' "
        "radii for the distance of the surfaces, 0 for that of the axes",
        "m",
        least=0.0,
        most=0.02,
    )
    damping: float = parameter(
        60.0, "D, not in the paper; the corrected form only", "1/s", above=0.0, most=1e3
    )
    max_speed: float = parameter(0.06, "v_max of the tip", "m/s", above=0.0, most=0.5)
    max_acceleration: float = parameter(
        1.0,
        "of the tip's commanded velocity; the corrected form only",
        "m/s^2",
        above=0.0,
        most=10.0,
    )
    goal_distance_floor: float = parameter(
        0.008, "least r (of the tip) in the repulsion", "m", least=0.0, most=0.1
    )
    proportion_floor: float = parameter(
        0.1, "least s, for shafts that are closest at G_R", above=0.0, most=1.0
    )

    @property
    def slowing_distance(self) -> float:
        """Distance of the tip at which attraction alone balances at v_max, m."""
        return self.max_speed * self.damping / (2.0 * self.attraction_gain)


@compiled
def guide_point(
    robot: RobotTool, obstacle: Estimate, p_WPs: Vector, proportion_floor: float
) -> Guide:
    """Steps 1 and 2 of the procedure: the guide point and its target.

    Args:
        robot: R.
        obstacle: Of O.
        p_WPs: P_S, m.
        proportion_floor: Least s.

    Returns:
        The guide; rho is the true distance of the axes, also where s is floored.
    """
    g, p = robot.fulcrum, robot.tip
    near = closest_points(g, p, obstacle.fulcrum, obstacle.p)
    s, m_r = near.s, near.p_A
    if s < proportion_floor:
        s = proportion_floor
        m_r = along(g, s, sub(p, g))
    m_rf = along(g, s, sub(p_WPs, g))
    return Guide(m_r, near.p_B, near.distance, s, near.t, m_rf)


@compiled
def at_the_tip(p: Vector) -> Guide:
    """The guide where O or S is nowhere: R's tip p; the distance to O is given as 0."""
    return Guide(p, p, 0.0, 1.0, 1.0, p)


@compiled
def known_places(obstacle: Estimate, target: Estimate) -> bool:
    """Whether the shaft of O and the tip of S are numbers."""
    return (
        all_finite(obstacle.p) and all_finite(obstacle.fulcrum) and all_finite(target.p)
    )


@compiled
def potential_distance(rho: float, params: Any) -> float:
    """The rho of the potential, m: floored just off contact, where it is singular."""
    return max(rho - params.contact_distance, 5e-4)


@compiled
def away_from_obstacle(guide: Guide, u: Vector) -> Vector:
    """Unit vector n_o from M_O to M_R; across R's shaft `u` where they touch."""
    return unit(sub(guide.M_R, guide.M_O), any_perpendicular(u))


@compiled
def corrected_force(params: Any, guide: Guide, u: Vector) -> Vector:
    """F_1 / s of equation (1), corrected form: acceleration of the tip, m/s^2.

    Args:
        params: A record of `constants`.
        guide: The guide point.
        u: Unit vector along R's shaft, fulcrum to tip.
    """
    s, goal = guide.s, sub(guide.M_Rf, guide.M_R)
    r = norm(goal)
    r_tip = r / s
    r_far = params.slowing_distance
    # F_att = 2 K_a r_goal, cut at r_far.
    pull = 2.0 * params.attraction_gain / s
    if r_tip > r_far:
        pull *= r_far / r_tip
    rho = potential_distance(guide.rho, params)
    if rho >= params.influence_distance:
        return scaled(pull, goal)

    n_o = away_from_obstacle(guide, u)
    gap = 1.0 / rho - 1.0 / params.influence_distance
    k_r = guide.l_over_L * params.repulsion_gain  # (3)
    floor = params.goal_distance_floor
    push = k_r * gap * min(max(r_tip, floor), max(r_far, floor)) / (rho * rho)
    # Unit vector across n_o: the goal's side, a little of the fixed side.
    n = scaled(1.0 / max(r, 1e-9), across(goal, n_o))
    n = along(n, -_TIE, across(u, n_o))
    # It fades near the goal and where goal and fixed side cancel: there its
    # direction would flip at every step.
    fade = r_tip / floor if r_tip < floor else 1.0
    size = sqrt(dot(n, n) + _TIE * _TIE)
    slide = 0.5 * k_r * gap * gap * fade / (s * size)
    return along(along(scaled(pull, goal), push, n_o), slide, n)


@compiled
def printed_force(params: Any, guide: Guide, u: Vector) -> Vector:
    """F_1 / s of equation (1) with (2) as printed: acceleration of the tip, m/s^2.

    Args:
        params: A record of `constants`.
        guide: The guide point.
        u: Unit vector along R's shaft, fulcrum to tip.
    """
    goal = sub(guide.M_Rf, guide.M_R)
    rho = potential_distance(guide.rho, params)
    force = scaled(2.0 * params.attraction_gain / guide.s, goal)
    if rho >= params.influence_distance:
        return force
    rho_hat = away_from_obstacle(guide, u)
    n = cross(cross(unit(goal), rho_hat), rho_hat)
    gap = 1.0 / rho - 1.0 / params.influence_distance
    k = -guide.l_over_L * params.repulsion_gain * gap * gap / guide.s  # (3)
    return along(along(force, k / (rho * rho), goal), 0.5 * k, n)


@compiled
def go_to_target(
    params: Any,
    v_tip: Vector,
    dt: float,
    robot: RobotTool,
    obstacle: Estimate,
    target: Estimate,
) -> tuple[Vector, Guide]:
    """One step of the behaviour.

    Args:
        params: A record of `constants`.
        v_tip: v_1 / s before the step, m/s.
        dt: Length of the step, s.
        robot: R.
        obstacle: Of O.
        target: Of S.

    Returns:
        v_1 / s after the step in m/s, and the guide. Without a usable estimate of both
        tools the velocity runs down to zero; without a finite one the guide point is
        the tip.
    """
    stop = (0.0, 0.0, 0.0)
    if not finite_tool(robot):
        return approach(v_tip, stop, params, dt), at_the_tip(NOWHERE)
    if not known_places(obstacle, target):
        return approach(v_tip, stop, params, dt), at_the_tip(robot.tip)
    guide = guide_point(robot, obstacle, target.p, params.proportion_floor)
    if not (usable(obstacle) and usable(target)):
        return approach(v_tip, stop, params, dt), guide
    u = unit(sub(robot.tip, robot.fulcrum), (0.0, 0.0, -1.0))
    if params.printed:
        force = printed_force(params, guide, u)
        return limited(along(v_tip, dt, force), params.max_speed), guide
    force = corrected_force(params, guide, u)
    balance = along(target.v, 1.0 / params.damping, force)
    goal_velocity = limited(balance, params.max_speed)
    return approach(v_tip, goal_velocity, params, dt), guide


@compiled
def approach(
    v_tip: Vector,
    v_balance: Vector,
    params: Any,
    dt: float,
) -> Vector:
    """Damped motion (4) towards the velocity at which force and damping balance.

    The exact solution of dv/dt = D (v_balance - v) over `dt`, with the change
    limited to the maximum acceleration. Velocities in m/s.
    """
    share = 1.0 - exp(-params.damping * dt)
    change = scaled(share, sub(v_balance, v_tip))
    return plus(v_tip, limited(change, params.max_acceleration * dt))


def constants(params: GoToTargetParams) -> np.ndarray:
    """The parameters as the compiled functions take them."""
    check(params)
    return packed(
        params,
        printed=params.form == "printed",
        slowing_distance=params.slowing_distance,
    )


class State(NamedTuple):
    """v_1 / s in m/s, and the time of the last update in s."""

    v_tip: Vector
    time: float


@compiled
def _step(
    params: Any,
    state: State,
    time: float,
    robot: RobotTool,
    obstacles: np.ndarray,
    target: Estimate,
) -> tuple[State, Velocity, Guide]:
    dt, obstacle = time - state.time, nearest_obstacle(robot, obstacles)
    v_tip, guide = go_to_target(params, state.v_tip, dt, robot, obstacle, target)
    return State(v_tip, time), Velocity(scaled(guide.s, v_tip)), guide


class GoToTarget(StepBlock):
    """Leads the guide point to its target round the obstacle tool by a potential field.

    Bauzano et al., section 4.1, equations (1) to (4); see the module.

    Port ``robot_tool`` accepts the `RobotTool`.
    Port ``obstacles`` accepts the `Estimate` of every obstacle tool; O is the nearest.
    Port ``target`` accepts the `Estimate` of the target tool S.
    Port ``v1`` emits the guide point's `Velocity` v_1.
    Port ``guide`` emits the `Guide`.

    The outputs are those of the step from the last update to now: no sample of delay.
    """

    def __init__(
        self,
        params: GoToTargetParams | None = None,
        obstacles: Sequence[str] = ("obstacle",),
    ) -> None:
        """Builds the block.

        Args:
            params: Parameters; the defaults if None.
            obstacles: Names of the obstacle tools.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        params = params or GoToTargetParams()
        self.declare_step(
            _step,
            [constants(params)],
            {
                "robot_tool": RobotTool,
                "obstacles": Many(Estimate, tuple(obstacles)),
                "target": Estimate,
            },
            State((0.0, 0.0, 0.0), -params.period),
            {"v1": Velocity, "guide": Guide},
            params.period,
        )
