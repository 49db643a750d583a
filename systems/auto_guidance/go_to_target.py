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

from dataclasses import dataclass
from functools import partial
from math import exp, sqrt
from typing import Any

import numpy as np

from systems.common.compiled import Numbers, compiled, packed
from systems.common.geometry import (
    Vector,
    all_finite,
    along,
    any_perpendicular,
    closest_points,
    cross,
    dot,
    limited,
    norm,
    sub,
    unit,
    xyz,
)
from systems.common.signals import (
    OBSTACLE_EXAMPLE,
    ROBOT_TOOL_EXAMPLE,
    TARGET_EXAMPLE,
    fulcrum,
    usable,
    velocity,
)
from systems.common.step_block import StepBlock

FORMS = ("corrected", "printed")

# How far (sine of the angle between goal and obstacle) the fixed side counts.
_TIE = 0.05


@dataclass
class GoToTargetParams:
    """Parameters of `GoToTarget`.

    Attributes:
        form: "corrected" or "printed".
        period: Of the update, s.
        attraction_gain: K_a, 1/s^2 (the virtual mass is 1).
        repulsion_gain: K_r, m^3/s^2; in the printed form the same number, m^4/s^2.
            With the defaults attraction and repulsion balance 10 mm off the
            obstacle's surface, at O's tip.
        influence_distance: rho_0, m.
        contact_distance: Subtracted from the axes' distance to give the rho of
            the potential, m: the sum of both tools' radii for the distance of
            the surfaces, 0 for the distance of the axes.
        damping: D, 1/s. Not in the paper; the corrected form only.
        max_speed: v_max of the tip, m/s.
        max_acceleration: Of the tip's commanded velocity, m/s^2; the corrected
            form only.
        goal_distance_floor: Least r (of the tip) in the repulsion, m.
        proportion_floor: Least s, for shafts that are closest at G_R.
    """

    form: str = "corrected"
    period: float = 1.0 / 60.0
    attraction_gain: float = 120.0
    repulsion_gain: float = 4e-4
    influence_distance: float = 0.025
    contact_distance: float = 0.005
    damping: float = 60.0
    max_speed: float = 0.06
    max_acceleration: float = 1.0
    goal_distance_floor: float = 0.008
    proportion_floor: float = 0.1

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: With the name, the value and what was expected.
        """
        if self.form not in FORMS:
            raise ValueError(f"form={self.form!r} must be one of {', '.join(FORMS)}")
        for name in (
            "period",
            "attraction_gain",
            "influence_distance",
            "damping",
            "max_speed",
            "max_acceleration",
        ):
            value = getattr(self, name)
            if not 0.0 < value < float("inf"):
                raise ValueError(f"{name}={value} must be finite and > 0")
        for name in ("repulsion_gain", "contact_distance", "goal_distance_floor"):
            value = getattr(self, name)
            if not 0.0 <= value < float("inf"):
                raise ValueError(f"{name}={value} must be finite and >= 0")
        if not 0.0 < self.proportion_floor <= 1.0:
            raise ValueError(
                f"proportion_floor={self.proportion_floor} must be in (0, 1]"
            )

    @property
    def slowing_distance(self) -> float:
        """Distance of the tip at which attraction alone balances at v_max, m."""
        return self.max_speed * self.damping / (2.0 * self.attraction_gain)


@compiled
def guide_point(
    robot_tool: Numbers,
    obstacle: Numbers,
    p_WPs: Numbers,
    proportion_floor: float,
) -> tuple[float, ...]:
    """Steps 1 and 2 of the procedure: the guide point and its target.

    Args:
        robot_tool: G_R, P_R (6), m.
        obstacle: An estimate (17) of O: P_O first, G_O at 9.
        p_WPs: P_S, m.
        proportion_floor: Least s.

    Returns:
        The `guide` signal (12): M_R, M_O, rho, s, l/L, M_R^f. rho is the true
        distance of the axes, also where s is floored.
    """
    g = xyz(robot_tool, 0)
    p = xyz(robot_tool, 3)
    p_o = xyz(obstacle, 0)
    s, fraction, rho, m_r, m_o = closest_points(g, p, fulcrum(obstacle), p_o)
    if s < proportion_floor:
        s = proportion_floor
        m_r = along(g, s, sub(p, g))
    m_rf = along(g, s, sub(p_WPs, g))
    return m_r + m_o + (rho, s, fraction) + m_rf


@compiled
def potential_distance(rho: float, params: Any) -> float:
    """The rho of the potential, m: floored just off contact, where it is singular."""
    return max(rho - params.contact_distance, 5e-4)


@compiled
def away_from_obstacle(guide: Numbers, u: Numbers) -> Vector:
    """Unit vector n_o from M_O to M_R; across R's shaft `u` where they touch."""
    d = (guide[0] - guide[3], guide[1] - guide[4], guide[2] - guide[5])
    return unit(d, any_perpendicular(u))


@compiled
def corrected_force(params: Any, guide: Numbers, u: Numbers) -> Vector:
    """F_1 / s of equation (1), corrected form: acceleration of the tip, m/s^2.

    Args:
        params: A record of `constants`.
        guide: The guide signal (12).
        u: Unit vector along R's shaft, fulcrum to tip.
    """
    s = guide[7]
    goal = (guide[9] - guide[0], guide[10] - guide[1], guide[11] - guide[2])
    r = norm(goal)
    r_tip = r / s
    r_far = params.slowing_distance
    # F_att = 2 K_a r_goal, cut at r_far.
    pull = 2.0 * params.attraction_gain / s
    if r_tip > r_far:
        pull *= r_far / r_tip
    rho = potential_distance(guide[6], params)
    if rho >= params.influence_distance:
        return pull * goal[0], pull * goal[1], pull * goal[2]

    n_o = away_from_obstacle(guide, u)
    gap = 1.0 / rho - 1.0 / params.influence_distance
    k_r = guide[8] * params.repulsion_gain  # (3): l/L K_r
    floor = params.goal_distance_floor
    push = k_r * gap * min(max(r_tip, floor), max(r_far, floor)) / (rho * rho)
    # Unit vector across n_o: the goal's side, a little of the fixed side.
    e = dot(goal, n_o)
    out = dot(u, n_o)
    a = 1.0 / max(r, 1e-9)
    nx = a * (goal[0] - e * n_o[0]) - _TIE * (u[0] - out * n_o[0])
    ny = a * (goal[1] - e * n_o[1]) - _TIE * (u[1] - out * n_o[1])
    nz = a * (goal[2] - e * n_o[2]) - _TIE * (u[2] - out * n_o[2])
    # It fades near the goal and where goal and fixed side cancel: there its
    # direction would flip at every step.
    fade = r_tip / floor if r_tip < floor else 1.0
    size = sqrt(nx * nx + ny * ny + nz * nz + _TIE * _TIE)
    slide = 0.5 * k_r * gap * gap * fade / (s * size)
    return (
        pull * goal[0] + push * n_o[0] + slide * nx,
        pull * goal[1] + push * n_o[1] + slide * ny,
        pull * goal[2] + push * n_o[2] + slide * nz,
    )


@compiled
def printed_force(params: Any, guide: Numbers, u: Numbers) -> Vector:
    """F_1 / s of equation (1) with (2) as printed: acceleration of the tip, m/s^2.

    Args:
        params: A record of `constants`.
        guide: The guide signal (12).
        u: Unit vector along R's shaft, fulcrum to tip.
    """
    s = guide[7]
    goal = (guide[9] - guide[0], guide[10] - guide[1], guide[11] - guide[2])
    rho = potential_distance(guide[6], params)
    pull = 2.0 * params.attraction_gain / s
    force = (pull * goal[0], pull * goal[1], pull * goal[2])
    if rho >= params.influence_distance:
        return force
    rho_hat = away_from_obstacle(guide, u)
    n = cross(cross(unit(goal), rho_hat), rho_hat)
    gap = 1.0 / rho - 1.0 / params.influence_distance
    k = -guide[8] * params.repulsion_gain * gap * gap / s  # (3): l/L K_r
    a = k / (rho * rho)
    return (
        force[0] + a * goal[0] + 0.5 * k * n[0],
        force[1] + a * goal[1] + 0.5 * k * n[1],
        force[2] + a * goal[2] + 0.5 * k * n[2],
    )


@compiled
def go_to_target(
    params: Any,
    v_tip: Numbers,
    dt: float,
    robot_tool: Numbers,
    obstacle: Numbers,
    target: Numbers,
) -> tuple[Vector, tuple[float, ...]]:
    """One step of the behaviour.

    Args:
        params: A record of `constants`.
        v_tip: v_1 / s before the step, m/s.
        dt: Length of the step, s.
        robot_tool: G_R, P_R (6), m.
        obstacle: Estimate (17) of O.
        target: Estimate (17) of S.

    Returns:
        (v_1 / s after the step in m/s, the guide signal). Without a usable
        estimate of both tools the velocity runs down to zero; without a finite
        one the guide point is the tip, and the distance to O is given as 0.
    """
    stop = (0.0, 0.0, 0.0)
    if not all_finite(robot_tool):
        guide: tuple[float, ...] = stop + stop + (0.0, 1.0, 1.0) + stop
        return approach(v_tip, stop, params, dt), guide
    p = xyz(robot_tool, 3)
    p_s = xyz(target, 0)
    if not (all_finite(xyz(obstacle, 0) + fulcrum(obstacle)) and all_finite(p_s)):
        guide = p + p + (0.0, 1.0, 1.0) + p
        return approach(v_tip, stop, params, dt), guide
    guide = guide_point(robot_tool, obstacle, p_s, params.proportion_floor)
    if not (usable(obstacle) and usable(target)):
        return approach(v_tip, stop, params, dt), guide
    u = unit(sub(p, xyz(robot_tool, 0)), (0.0, 0.0, -1.0))
    if params.printed:
        force = printed_force(params, guide, u)
        return limited(along(v_tip, dt, force), params.max_speed), guide
    force = corrected_force(params, guide, u)
    balance = along(velocity(target), 1.0 / params.damping, force)
    goal_velocity = limited(balance, params.max_speed)
    return approach(v_tip, goal_velocity, params, dt), guide


@compiled
def approach(
    v_tip: Numbers,
    v_balance: Numbers,
    params: Any,
    dt: float,
) -> Vector:
    """Damped motion (4) towards the velocity at which force and damping balance.

    The exact solution of dv/dt = D (v_balance - v) over `dt`, with the change
    limited to the maximum acceleration. Velocities in m/s.
    """
    share = 1.0 - exp(-params.damping * dt)
    change = sub(v_balance, v_tip)
    change = (share * change[0], share * change[1], share * change[2])
    return along(v_tip, 1.0, limited(change, params.max_acceleration * dt))


def constants(params: GoToTargetParams) -> np.ndarray:
    """The parameters as the compiled functions take them."""
    return packed(
        params,
        printed=params.form == "printed",
        slowing_distance=params.slowing_distance,
    )


@compiled
def _step(
    record: np.ndarray,
    state: np.ndarray,
    time: float,
    robot_tool: np.ndarray,
    obstacle: np.ndarray,
    target: np.ndarray,
) -> np.ndarray:
    """The next state (4), v_1 (3) and the guide signal (12)."""
    v_tip, guide = go_to_target(
        record[0], xyz(state, 0), time - state[3], robot_tool, obstacle, target
    )
    v1 = along((0.0, 0.0, 0.0), guide[7], v_tip)
    return np.array(v_tip + (time,) + v1 + guide)


class GoToTarget(StepBlock):
    """Leads the guide point to its target round the obstacle tool by a potential field.

    Bauzano et al., section 4.1, equations (1) to (4); see the module.

    Port ``robot_tool`` accepts the robot's instrument: fulcrum G_R and tip P_R
    (6), m, in W.
    Port ``obstacle`` accepts the estimate (17) of the obstacle tool O.
    Port ``target`` accepts the estimate (17) of the target tool S.
    Port ``v1`` emits the guide point's velocity v_1 (3), m/s, in W.
    Port ``guide`` emits the guide signal (12): M_R, M_O, rho, s, l/L, M_R^f.

    The discrete state is v_1 / s (3) and the time of the last update. The
    outputs are those of the step from then to now: no sample of delay.
    """

    def __init__(self, params: GoToTargetParams | None = None) -> None:
        """Builds the block.

        Args:
            params: Parameters; the defaults if None.

        Raises:
            ValueError: If a parameter is out of range.
        """
        super().__init__()
        params = params or GoToTargetParams()
        params.check()
        self.declare_step(
            partial(_step, constants(params)),
            {
                "robot_tool": ROBOT_TOOL_EXAMPLE,
                "obstacle": OBSTACLE_EXAMPLE,
                "target": TARGET_EXAMPLE,
            },
            [0.0, 0.0, 0.0, -params.period],
            {"v1": 3, "guide": 12},
            params.period,
        )
