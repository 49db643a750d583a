"""Tool navigation: the guide point's velocity becomes the tool's motion.

Step 4 of the paper's procedure: "move the robot instrument to fit the new
location and the fulcrum point constraint". The tool pivots about G_R, so it has
four degrees of freedom: two angles, insertion and roll; roll is kept.

The guide point is tied to its proportion s of the shaft: G_R + s (P_R - G_R).
Its velocity v_R then means the tip's velocity v_R / s, in every direction: the
rotation w = r x v_R / |r|^2 moves the tip by (1/s) of the guide point's lateral
motion, and the insertion rate is u . v_R / s.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from systems.common.block import Block
from systems.common.compiled import Numbers, compiled, packed
from systems.common.geometry import (
    Vector,
    all_finite,
    along,
    dot,
    limited,
    norm,
    sub,
    unit,
    xyz,
)

MOVING = 0
WAITING = 7
NEVER_SEEN = 1.0
"""An estimate's standard deviation before the tool was ever seen [m]."""
REASONS = {
    1: "target lost by the tracker",
    2: "obstacle lost by the tracker",
    3: "input is not a number",
    4: "target out of reach",
    5: "target outside the view cone",
    6: "arm does not follow",
    7: "waiting for the tracker's first frame",
    8: "force on the wall over its limit",
    9: "wrist sensor lost",
    10: "probing the wall",
}
"""Why the robot stands: the code on port ``stop`` and its text."""


_FREE = np.array([1.0, 0.0])
"""What the passive wrist permits where there is none."""


@dataclass
class ToolNavigationParams:
    """Parameters of `ToolNavigation`.

    Attributes:
        period: Of the local planner [s].
        tip_speed: Greatest speed of the tip [m/s].
        turning_speed: Greatest angular speed of the shaft [rad/s].
        acceleration: Greatest acceleration of the tip [m/s^2].
        min_insertion: Least length of shaft inside the patient [m].
        max_insertion: Greatest length of shaft inside the patient [m].
        max_tilt: Greatest angle of the shaft to the vertical [rad].
        cone_margin: The gauze stays this far inside the view cone's border [rad].
        min_proportion: Floor of the guide point's proportion s; below it the
            fulcrums lie side by side and v / s has no meaning.
        follow_error: Largest distance of the measured from the commanded tip [m].
    """

    period: float = 1.0 / 60.0
    tip_speed: float = 0.1
    turning_speed: float = 1.0
    acceleration: float = 1.0
    min_insertion: float = 0.03
    max_insertion: float = 0.2
    max_tilt: float = 0.7
    cone_margin: float = 0.02
    min_proportion: float = 0.1
    follow_error: float = 0.01

    def check(self) -> None:
        """Raises ValueError for a value that makes no sense."""
        for name, value in vars(self).items():
            if not value > 0.0 and name != "cone_margin":
                raise ValueError(f"tool_navigation.{name}={value}: expected > 0")
        if self.cone_margin < 0.0:
            raise ValueError(
                f"tool_navigation.cone_margin={self.cone_margin} rad: expected >= 0"
            )
        if self.min_insertion >= self.max_insertion:
            raise ValueError(
                f"tool_navigation.min_insertion={self.min_insertion} m: expected less "
                f"than max_insertion={self.max_insertion} m"
            )
        if self.max_tilt >= math.pi / 2:
            raise ValueError(
                f"tool_navigation.max_tilt={self.max_tilt} rad: expected < pi/2"
            )


_DOWN = (0.0, 0.0, -1.0)
"""The shaft's direction where it has none."""


def constants(params: ToolNavigationParams) -> np.ndarray:
    """The parameters as the compiled functions take them.

    Raises:
        ValueError: For a value that makes no sense.
    """
    params.check()
    return packed(params)


@compiled
def reachable(params: Any, p_WG: Numbers, p_WP: Numbers) -> bool:
    """Whether the tool through fulcrum p_WG can have its tip at p_WP (both in W).

    Args:
        params: A record of `constants`.
        p_WG: In m.
        p_WP: In m.
    """
    shaft = sub(p_WP, p_WG)
    is_long_enough = params.min_insertion <= norm(shaft) <= params.max_insertion
    return is_long_enough and -unit(shaft, _DOWN)[2] >= math.cos(params.max_tilt)


@compiled
def cone_angle(view_cone: Numbers, p_WP: Numbers) -> float:
    """Angle [rad] of a point to the axis of a view cone (apex, axis, half angle)."""
    cosine = dot(unit(sub(p_WP, xyz(view_cone, 0)), _DOWN), xyz(view_cone, 3))
    return math.acos(min(1.0, max(-1.0, cosine)))


@compiled
def held(params: Any, v: Vector, n: Vector, room: float) -> Vector:
    """A tip velocity before a border: what leads outwards too fast is taken away.

    Args:
        params: A record of `constants`.
        v: Velocity [m/s].
        n: The border's outward normal.
        room: How far it is to the border [m].
    """
    room = max(0.0, room)
    # What can still be braked, and no more than the room itself in a period.
    allowed = min(math.sqrt(params.acceleration * room), room / params.period)
    excess = dot(v, n) - allowed
    return along(v, -excess, n) if excess > 0.0 else v


@compiled
def limit_tip_velocity(
    params: Any, p_WG: Numbers, p_WP: Numbers, v_WP: Numbers, view_cone: Numbers
) -> Vector:
    """Brings a tip velocity within the tool's limits.

    Speeds are scaled, so that the direction stays. At a border of insertion, tilt
    or view cone the part that leads outwards is taken away.

    Args:
        params: A record of `constants`.
        p_WG: Fulcrum in W [m].
        p_WP: Tip in W [m].
        v_WP: Wanted velocity of the tip in W [m/s].
        view_cone: Apex p_WC, axis, half angle.

    Returns:
        The limited velocity in W [m/s].
    """
    shaft = sub(p_WP, p_WG)
    q = norm(shaft)
    u = unit(shaft, _DOWN)
    speed = norm(v_WP)
    lengthwise = dot(v_WP, u)
    turning = math.sqrt(max(0.0, speed * speed - lengthwise * lengthwise))
    scale = 1.0
    if speed > params.tip_speed:
        scale = params.tip_speed / speed
    if turning * scale > params.turning_speed * q:
        scale = params.turning_speed * q / turning
    v = (v_WP[0] * scale, v_WP[1] * scale, v_WP[2] * scale)
    # Each border is a half-space: outward normal and the room left before it.
    v = held(params, v, u, params.max_insertion - q)
    v = held(params, v, (-u[0], -u[1], -u[2]), q - params.min_insertion)
    tilt = math.acos(min(1.0, max(-1.0, -u[2])))
    lateral = (u[0], u[1], 0.0)
    if norm(lateral) > 1e-6:
        # The direction in which the tip tilts further, perpendicular to the shaft.
        x, y, _ = unit(lateral)
        cosine = math.cos(tilt)
        outwards = (x * cosine, y * cosine, math.sin(tilt))
        v = held(params, v, outwards, (params.max_tilt - tilt) * q)
    axis = xyz(view_cone, 3)
    ray = sub(p_WP, xyz(view_cone, 0))
    a = unit(ray, _DOWN)
    off = unit(along(a, -dot(a, axis), axis), _DOWN)
    half = view_cone[6] - params.cone_margin
    # The cone's outward normal: off axis, tilted back by the half angle.
    cosine = math.cos(half)
    straight = (off[0] * cosine, off[1] * cosine, off[2] * cosine)
    outwards = along(straight, -math.sin(half), axis)
    room = norm(ray) * math.sin(half - cone_angle(view_cone, p_WP))
    return held(params, v, outwards, room)


@compiled
def why_stop(
    params: Any,
    v_R: Numbers,
    guide: Numbers,
    robot: Numbers,
    obstacle: Numbers,
    target: Numbers,
    view_cone: Numbers,
    p: Vector,
) -> int:
    """Why the tool must stop, or MOVING; the block's inputs and the commanded tip."""
    if target[12] >= NEVER_SEEN or obstacle[12] >= NEVER_SEEN:
        return WAITING
    if target[15] < 0.5:
        return 1
    if obstacle[15] < 0.5:
        return 2
    numbers = all_finite(v_R) and all_finite(guide) and all_finite(robot)
    p_WS = xyz(target, 0)
    if not (numbers and all_finite(view_cone) and all_finite(p_WS)):
        return 3
    if not reachable(params, xyz(robot, 0), p_WS):
        return 4
    if cone_angle(view_cone, p_WS) > view_cone[6]:
        return 5
    if norm(sub(p, xyz(robot, 3))) > params.follow_error:
        return 6
    return MOVING


@compiled
def _update(
    record: np.ndarray,
    old: np.ndarray,
    time: float,
    v_R: np.ndarray,
    guide: np.ndarray,
    robot: np.ndarray,
    obstacle: np.ndarray,
    target: np.ndarray,
    view_cone: np.ndarray,
    permission: np.ndarray,
) -> np.ndarray:
    """The next state: the command `tool` (13), and why it stands (1)."""
    params = record[0]
    # The tip has moved on since the last instant.
    v = xyz(old, 6)
    p = along(xyz(old, 0), time - old[12], v)
    stop = why_stop(params, v_R, guide, robot, obstacle, target, view_cone, p)
    if stop == MOVING and not permission[0] > 0.0:
        stop = int(permission[1])
    p_WG = xyz(robot, 0)
    if not all_finite(p_WG):
        p_WG = sub(p, xyz(old, 3))
    wanted = (0.0, 0.0, 0.0)
    if stop == MOVING:
        s = max(guide[7], params.min_proportion)
        wanted = (v_R[0] / s, v_R[1] / s, v_R[2] / s)
        wanted = limit_tip_velocity(params, p_WG, p, wanted, view_cone)
    change = limited(sub(wanted, v), params.acceleration * params.period)
    v = along(v, 1.0, change)
    shaft = sub(p, p_WG)
    u, q = unit(shaft, _DOWN), norm(shaft)
    across = along(v, -dot(v, u), u)
    du = (across[0] / q, across[1] / q, across[2] / q)
    return np.array(p + u + v + du + (time, float(stop)))


class ToolNavigation(Block):
    """Turns the guide point's velocity into the pose of the tool (procedure, step 4).

    The commanded tip is integrated in the state, so that the arm's small lag
    does not accumulate. When it must not move, the tip slows to a stop with the
    bounded acceleration, the reason is on port ``stop``, and motion goes on when
    the reason is gone.

    Port ``v_R`` accepts the guide point's velocity (3), equation (6), in W [m/s].

    Port ``guide`` accepts p_WMR, p_WMO, rho, s, l/L, p_WMRf (12).

    Port ``robot_tool`` accepts p_WG and the measured p_WP (6), in W [m].

    Port ``obstacle`` accepts the estimate of the obstacle tool O (17).

    Port ``target`` accepts the estimate of the target tool S (17).

    Port ``view_cone`` accepts apex p_WC, axis, half angle (7).

    Port ``permission`` accepts the share of its speed that the passive wrist allows,
    0 for none, and why it must wait, a key of `REASONS` or 0 (2); free without a wire.
    The share itself is kept before the evasion of tools, by the clearance constraint.

    Port ``tool`` emits the commanded p_WP [m], shaft direction u_W, v_WP [m/s],
    du_W/dt [1/s] and the time [s] they hold at (13).

    Port ``stop`` emits why the robot stands (1): 0 while it moves, else a key of
    `REASONS`.
    """

    def __init__(
        self,
        params: ToolNavigationParams | None = None,
        p_WP: Sequence[float] = (0.0, 0.0, -0.1),
        p_WG: Sequence[float] = (0.0, 0.0, 0.0),
    ) -> None:
        """Makes the block with the tool's tip at p_WP and its fulcrum at p_WG [m]."""
        super().__init__()
        self._params = params or ToolNavigationParams()
        self._constants = constants(self._params)
        tool = [*p_WG, *p_WP]
        estimate = [
            0.03,
            0.0,
            -0.1,
            *[0.0] * 6,
            0.1,
            0.0,
            0.0,
            1e-4,
            1e-3,
            0.1,
            1.0,
            0.0,
        ]
        self._v_R = self.vector_in("v_R", [0.01, 0.0, 0.0])
        self._guide = self.vector_in(
            "guide", [*p_WP, 0.05, 0.0, -0.1, 0.05, 1.0, 1.0, 0.03, 0.0, -0.1]
        )
        self._robot_tool = self.vector_in("robot_tool", tool)
        self._obstacle = self.vector_in("obstacle", estimate)
        self._target = self.vector_in("target", estimate)
        self._view_cone = self.vector_in(
            "view_cone", [0.0, 0.0, 0.0, 0.0, 0.0, -1.0, 0.6]
        )
        self._permission = self.vector_in("permission", _FREE.tolist())
        u = unit(sub(tuple(p_WP), tuple(p_WG)), _DOWN)
        self._command = self.state_out("tool", [*p_WP, *u, *[0.0] * 7])
        self.state_out("stop", [MOVING])
        self.update_every(self._params.period, self._next)

    def _next(self, context: Any) -> tuple[np.ndarray, np.ndarray]:
        told = self._permission.HasValue(context)
        state = _update(
            self._constants,
            context.get_discrete_state(self._command).value(),
            context.get_time(),
            self._v_R.Eval(context),
            self._guide.Eval(context),
            self._robot_tool.Eval(context),
            self._obstacle.Eval(context),
            self._target.Eval(context),
            self._view_cone.Eval(context),
            self._permission.Eval(context) if told else _FREE,
        )
        return state[:13], state[13:]
