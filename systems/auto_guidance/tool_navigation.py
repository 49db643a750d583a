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

from systems.common.block import Block
from systems.common.geometry import Vector

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
    min_proportion: float = 0.15
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


def unit(x: float, y: float, z: float) -> tuple[Vector, float]:
    """A vector's direction and length; the direction of zero is downwards."""
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-12:
        return (0.0, 0.0, -1.0), 0.0
    return (x / length, y / length, z / length), length


def reachable(
    params: ToolNavigationParams, p_WG: Sequence[float], p_WP: Sequence[float]
) -> bool:
    """Whether the tool through fulcrum p_WG can have its tip at p_WP (both in W)."""
    u, length = unit(p_WP[0] - p_WG[0], p_WP[1] - p_WG[1], p_WP[2] - p_WG[2])
    return params.min_insertion <= length <= params.max_insertion and -u[2] >= math.cos(
        params.max_tilt
    )


def cone_angle(view_cone: Sequence[float], p_WP: Sequence[float]) -> float:
    """Angle [rad] of a point to the axis of a view cone (apex, axis, half angle)."""
    a, _ = unit(p_WP[0] - view_cone[0], p_WP[1] - view_cone[1], p_WP[2] - view_cone[2])
    cosine = a[0] * view_cone[3] + a[1] * view_cone[4] + a[2] * view_cone[5]
    return math.acos(min(1.0, max(-1.0, cosine)))


def limit_tip_velocity(
    params: ToolNavigationParams,
    p_WG: Vector,
    p_WP: Vector,
    v_WP: Vector,
    view_cone: Sequence[float],
) -> Vector:
    """Brings a tip velocity within the tool's limits.

    Speeds are scaled, so that the direction stays. At a border of insertion, tilt
    or view cone the part that leads outwards is taken away.

    Args:
        params: The limits.
        p_WG: Fulcrum in W [m].
        p_WP: Tip in W [m].
        v_WP: Wanted velocity of the tip in W [m/s].
        view_cone: Apex p_WC, axis, half angle.

    Returns:
        The limited velocity in W [m/s].
    """
    u, q = unit(p_WP[0] - p_WG[0], p_WP[1] - p_WG[1], p_WP[2] - p_WG[2])
    vx, vy, vz = v_WP
    speed = math.sqrt(vx * vx + vy * vy + vz * vz)
    along = vx * u[0] + vy * u[1] + vz * u[2]
    turning = math.sqrt(max(0.0, speed * speed - along * along))
    scale = 1.0
    if speed > params.tip_speed:
        scale = params.tip_speed / speed
    if turning * scale > params.turning_speed * q:
        scale = params.turning_speed * q / turning
    vx, vy, vz, along = vx * scale, vy * scale, vz * scale, along * scale
    # Each border is a half-space: outward normal and the room left before it.
    borders = [(u, params.max_insertion - q)]
    borders.append(((-u[0], -u[1], -u[2]), q - params.min_insertion))
    tilt = math.acos(min(1.0, max(-1.0, -u[2])))
    outwards, lateral = unit(u[0], u[1], 0.0)
    if lateral > 1e-6:
        # The direction in which the tip tilts further, perpendicular to the shaft.
        cosine = math.cos(tilt)
        normal = (outwards[0] * cosine, outwards[1] * cosine, math.sin(tilt))
        borders.append((normal, (params.max_tilt - tilt) * q))
    a, range_C = unit(
        p_WP[0] - view_cone[0], p_WP[1] - view_cone[1], p_WP[2] - view_cone[2]
    )
    cosine = a[0] * view_cone[3] + a[1] * view_cone[4] + a[2] * view_cone[5]
    off, _ = unit(
        a[0] - cosine * view_cone[3],
        a[1] - cosine * view_cone[4],
        a[2] - cosine * view_cone[5],
    )
    half = view_cone[6] - params.cone_margin
    # The cone's outward normal: off axis, tilted back by the half angle.
    normal = (
        off[0] * math.cos(half) - view_cone[3] * math.sin(half),
        off[1] * math.cos(half) - view_cone[4] * math.sin(half),
        off[2] * math.cos(half) - view_cone[5] * math.sin(half),
    )
    angle = math.acos(min(1.0, max(-1.0, cosine)))
    borders.append((normal, range_C * math.sin(half - angle)))
    for n, room in borders:
        outward = vx * n[0] + vy * n[1] + vz * n[2]
        room = max(0.0, room)
        # What can still be braked, and no more than the room itself in a period.
        allowed = min(math.sqrt(params.acceleration * room), room / params.period)
        if outward > allowed:
            excess = outward - allowed
            vx, vy, vz = vx - excess * n[0], vy - excess * n[1], vz - excess * n[2]
    return vx, vy, vz


def approach(v: Vector, wanted: Vector, change: float) -> Vector:
    """Moves a velocity towards a wanted one by at most `change` [m/s]."""
    d, length = unit(wanted[0] - v[0], wanted[1] - v[1], wanted[2] - v[2])
    if length <= change:
        return wanted
    return v[0] + change * d[0], v[1] + change * d[1], v[2] + change * d[2]


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

    Port ``permission`` accepts the share of its speed that the passive wrist allows
    and why it must wait, a key of `REASONS` or 0 (2); free if not connected.

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
        self._params.check()
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
        self._permission = self.vector_in("permission", [1.0, 0.0])
        u, _ = unit(p_WP[0] - p_WG[0], p_WP[1] - p_WG[1], p_WP[2] - p_WG[2])
        state = self.DeclareDiscreteState([*p_WP, *u, *[0.0] * 6, 0.0, MOVING])
        self.vector_out("tool", 13, self._calc_tool, {self.xd_ticket()})
        self.vector_out("stop", 1, self._calc_stop, {self.xd_ticket()})
        self._state = state
        self.update_every(self._params.period, self._update)

    def _calc_tool(self, context: Any) -> Sequence[float]:
        return context.get_discrete_state(self._state).value()[:13]

    def _calc_stop(self, context: Any) -> Sequence[float]:
        return context.get_discrete_state(self._state).value()[13:]

    def _reason(
        self,
        v_R: Sequence[float],
        guide: Sequence[float],
        robot: Sequence[float],
        obstacle: Sequence[float],
        target: Sequence[float],
        view_cone: Sequence[float],
        p: Vector,
    ) -> int:
        """Why the tool must stop, or MOVING."""
        if target[12] >= NEVER_SEEN or obstacle[12] >= NEVER_SEEN:
            return WAITING
        if target[15] < 0.5:
            return 1
        if obstacle[15] < 0.5:
            return 2
        if not all(map(math.isfinite, (*v_R, *guide, *robot, *view_cone, *target[:3]))):
            return 3
        p_WG = (robot[0], robot[1], robot[2])
        p_WS = (target[0], target[1], target[2])
        if not reachable(self._params, p_WG, p_WS):
            return 4
        if cone_angle(view_cone, p_WS) > view_cone[6]:
            return 5
        if math.dist(p, robot[3:6]) > self._params.follow_error:
            return 6
        return MOVING

    def _update(self, context: Any) -> Sequence[float]:
        params = self._params
        old = context.get_discrete_state(self._state).value().tolist()
        v_R = self._v_R.Eval(context).tolist()
        guide = self._guide.Eval(context).tolist()
        robot = self._robot_tool.Eval(context).tolist()
        view_cone = self._view_cone.Eval(context).tolist()
        # The tip has moved on since the last instant.
        step = context.get_time() - old[12]
        p = (old[0] + old[6] * step, old[1] + old[7] * step, old[2] + old[8] * step)
        v = (old[6], old[7], old[8])
        stop = self._reason(
            v_R,
            guide,
            robot,
            self._obstacle.Eval(context).tolist(),
            self._target.Eval(context).tolist(),
            view_cone,
            p,
        )
        pace = 1.0
        if self._permission.HasValue(context):
            pace, code = self._permission.Eval(context).tolist()
            if stop == MOVING and pace <= 0.0:
                stop = int(code)
        p_WG = (robot[0], robot[1], robot[2])
        if not all(map(math.isfinite, p_WG)):
            p_WG = (p[0] - old[3], p[1] - old[4], p[2] - old[5])
        if stop == MOVING:
            s = max(guide[7], params.min_proportion)
            wanted = (v_R[0] / s, v_R[1] / s, v_R[2] / s)
            x, y, z = limit_tip_velocity(params, p_WG, p, wanted, view_cone)
            wanted = (pace * x, pace * y, pace * z)
        else:
            wanted = (0.0, 0.0, 0.0)
        v = approach(v, wanted, params.acceleration * params.period)
        u, q = unit(p[0] - p_WG[0], p[1] - p_WG[1], p[2] - p_WG[2])
        along = v[0] * u[0] + v[1] * u[1] + v[2] * u[2]
        du = [(v[i] - along * u[i]) / q for i in range(3)]
        return [*p, *u, *v, *du, context.get_time(), stop]
