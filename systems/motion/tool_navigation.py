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
from typing import Annotated, Any, NamedTuple

import numpy as np

from systems.common.compiled import compiled, packed
from systems.common.geometry import (
    across,
    all_finite,
    along,
    dot,
    limited,
    norm,
    over,
    plus,
    scaled,
    sub,
    unit,
)
from systems.common.parameter import Rules, check, parameter
from systems.common.reach_limits import ReachLimits, fastest_sideways, lever
from systems.common.signal import Field, Many, Vector, example, vector
from systems.common.signals import (
    CALM,
    FREE,
    NEVER_SEEN,
    UNHINDERED,
    ClearanceStatus,
    Estimate,
    Guide,
    Leeway,
    Permission,
    RobotTool,
    ToolMotion,
    Velocity,
    ViewCone,
    all_usable,
    finite_cone,
    finite_guide,
    finite_permission,
    finite_tool,
    read_estimate,
)
from systems.common.step_block import StepBlock
from systems.common.stops import Stop

START = example(RobotTool)
_DOWN = (0.0, 0.0, -1.0)
"""The shaft's direction where it has none."""


class StopCode(NamedTuple):
    """Why the robot stands."""

    code: Annotated[float, Field("1", "a `Stop`", 0.0)]


@dataclass
class ToolNavigationParams(ReachLimits):
    """Parameters of `ToolNavigation`, with the limits that it keeps to."""

    period: float = parameter(1 / 60, "of the local planner", "s", above=0.0, most=1.0)
    tip_speed: float = parameter(
        0.1, "greatest speed of the tip", "m/s", above=0.0, most=0.5
    )
    turning_speed: float = parameter(
        1.0, "greatest angular speed of the shaft", "rad/s", above=0.0, most=10.0
    )
    acceleration: float = parameter(
        1.0, "greatest acceleration of the tip", "m/s^2", above=0.0, most=10.0
    )
    min_proportion: float = parameter(
        0.1,
        "floor of the guide point's s; below it the fulcrums lie side by side and "
        "v / s has no meaning",
        above=0.0,
        most=1.0,
    )
    # As fast as a PA-10's joints allow; it turns no faster, its base does not.
    escape_speed: float = parameter(
        0.25, "of the tip, out of a tool's way", "m/s", above=0.0, most=0.5
    )
    escape_acceleration: float = parameter(
        4.0, "of the tip, out of a tool's way", "m/s^2", above=0.0, most=20.0
    )
    follow_error: float = parameter(
        0.01,
        "largest distance of the measured from the commanded tip",
        "m",
        above=0.0,
        most=0.05,
    )

    def rules(self) -> Rules:
        """What must hold across the parameters."""
        yield from super().rules()
        yield self.max_tilt < math.pi / 2, "max_tilt", "< pi/2; is it in degrees?"
        for name, least in (
            ("escape_speed", self.tip_speed),
            ("escape_acceleration", self.acceleration),
        ):
            yield getattr(self, name) >= least, name, f"at least {least}"


def constants(params: ToolNavigationParams) -> np.ndarray:
    """The parameters as the compiled functions take them."""
    check(params)
    return packed(params)


@compiled
def reachable(params: Any, p_WG: Vector, p_WP: Vector) -> bool:
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
def cone_angle(view_cone: ViewCone, p_WP: Vector) -> float:
    """Angle [rad] of a point to the axis of a view cone."""
    cosine = dot(unit(sub(p_WP, view_cone.apex), _DOWN), view_cone.u)
    return math.acos(min(1.0, max(-1.0, cosine)))


class Pace(NamedTuple):
    """How fast the tip may go: m/s, m/s^2."""

    speed: float
    acceleration: float


@compiled
def pace(params: Any, escapes: bool) -> Pace:
    """That of travelling, or of an escape."""
    if escapes:
        return Pace(params.escape_speed, params.escape_acceleration)
    return Pace(params.tip_speed, params.acceleration)


@compiled
def held(params: Any, v: Vector, n: Vector, room: float, braking: float) -> Vector:
    """A tip velocity before a border: what leads outwards too fast is taken away.

    Args:
        params: A record of `constants`.
        v: Velocity [m/s].
        n: The border's outward normal.
        room: How far it is to the border [m].
        braking: Greatest acceleration [m/s^2].
    """
    room = max(0.0, room)
    # What can still be braked, and no more than the room itself in a period.
    allowed = min(math.sqrt(braking * room), room / params.period)
    excess = dot(v, n) - allowed
    return along(v, -excess, n) if excess > 0.0 else v


@compiled
def limit_tip_velocity(
    params: Any,
    p_WG: Vector,
    p_WP: Vector,
    v_WP: Vector,
    view_cone: ViewCone,
    escapes: bool = False,
) -> Vector:
    """Brings a tip velocity within the tool's limits.

    Speeds are scaled, so that the direction stays. At a border of insertion, tilt
    or view cone the part that leads outwards is taken away.

    Args:
        params: A record of `constants`.
        p_WG: Fulcrum in W [m].
        p_WP: Tip in W [m].
        v_WP: Wanted velocity of the tip in W [m/s].
        view_cone: What the endoscope sees.
        escapes: Whether a tool comes: then it may be faster, and leave the view.

    Returns:
        The limited velocity in W [m/s].
    """
    fastest, braking = pace(params, escapes)
    shaft = sub(p_WP, p_WG)
    q = norm(shaft)
    u = unit(shaft, _DOWN)
    speed = norm(v_WP)
    lengthwise = dot(v_WP, u)
    turning = math.sqrt(max(0.0, speed * speed - lengthwise * lengthwise))
    scale = 1.0
    if speed > fastest:
        scale = fastest / speed
    most = fastest_sideways(params, q, params.turning_speed)
    if turning * scale > most:
        scale = most / turning
    v = scaled(scale, v_WP)
    # Each border is a half-space: outward normal and the room left before it.
    v = held(params, v, u, params.max_insertion - q, braking)
    v = held(params, v, scaled(-1.0, u), q - params.min_insertion, braking)
    x, y, z = u
    tilt = math.acos(min(1.0, max(-1.0, -z)))
    lateral = (x, y, 0.0)
    if norm(lateral) > 1e-6:
        # The direction in which the tip tilts further, perpendicular to the shaft.
        outwards = along(scaled(math.cos(tilt), unit(lateral)), -math.sin(tilt), _DOWN)
        v = held(params, v, outwards, (params.max_tilt - tilt) * q, braking)
    if escapes:
        return v
    ray = sub(p_WP, view_cone.apex)
    off = unit(across(unit(ray, _DOWN), view_cone.u), _DOWN)
    half = view_cone.half - params.cone_margin
    # The cone's outward normal: off axis, tilted back by the half angle.
    outwards = along(scaled(math.cos(half), off), -math.sin(half), view_cone.u)
    room = norm(ray) * math.sin(half - cone_angle(view_cone, p_WP))
    return held(params, v, outwards, room, braking)


@compiled
def why_stop(
    params: Any,
    v_R: Velocity,
    guide: Guide,
    robot: RobotTool,
    obstacles: np.ndarray,
    target: Estimate,
    view_cone: ViewCone,
    permission: Permission,
    p: Vector,
) -> Stop:
    """Why the tool must stop, or MOVING; the block's inputs and the commanded tip."""
    unseen, lost = target.sigma_p >= NEVER_SEEN, False
    for i in range(len(obstacles)):
        obstacle = read_estimate(obstacles[i])
        unseen = unseen or obstacle.sigma_p >= NEVER_SEEN
        lost = lost or obstacle.known < 0.5
    if unseen:
        return Stop.WAITING
    if target.known < 0.5:
        return Stop.TARGET_LOST
    if lost:
        return Stop.OBSTACLE_LOST
    numbers = all_finite(v_R.v) and finite_guide(guide) and finite_tool(robot)
    numbers = numbers and finite_cone(view_cone) and finite_permission(permission)
    if not (numbers and all_finite(target.p) and all_usable(obstacles)):
        return Stop.NOT_A_NUMBER
    if not reachable(params, robot.fulcrum, target.p):
        return Stop.OUT_OF_REACH
    if cone_angle(view_cone, target.p) > view_cone.half:
        return Stop.OUT_OF_VIEW
    if norm(sub(p, robot.tip)) > params.follow_error:
        return Stop.NOT_FOLLOWED
    return Stop.MOVING


@compiled
def evades(reason: Stop, permission: Permission) -> bool:
    """Whether a tool that must stand still gets out of another one's way.

    Not if it never saw the tools or does not know where it is itself, and not while
    the arm gives way to a loaded wall.
    """
    stands = permission.speed_scale <= 0.0
    if stands and permission.code != float(Stop.PROBING.value):
        return False
    return reason in (
        Stop.MOVING,
        Stop.TARGET_LOST,
        Stop.OBSTACLE_LOST,
        Stop.OUT_OF_REACH,
        Stop.OUT_OF_VIEW,
        Stop.NOT_FOLLOWED,
    )


@compiled
def _update(
    params: Any,
    tool: ToolMotion,
    stop_code: StopCode,
    leeway: Leeway,
    time: float,
    v_R: Velocity,
    guide: Guide,
    robot: RobotTool,
    obstacles: np.ndarray,
    target: Estimate,
    view_cone: ViewCone,
    permission: Permission,
    clearance: ClearanceStatus,
) -> tuple[ToolMotion, StopCode, Leeway]:
    # The tip has moved on since the last instant.
    p = along(tool.tip, time - tool.time, tool.v)
    escapes = 0.5 < clearance.escape < 2.0
    reason = why_stop(
        params, v_R, guide, robot, obstacles, target, view_cone, permission, p
    )
    code, moves = float(reason.value), reason == Stop.MOVING
    if moves and permission.speed_scale <= 0.0:
        code, moves = permission.code, False
    blind = reason == Stop.WAITING or reason == Stop.NOT_A_NUMBER
    if permission.code == float(Stop.TOUCHED.value) and not blind:
        # Whatever else it would wait for: it gives way, from where it is pushed to.
        code, moves, escapes = permission.code, True, True
        p = plus(robot.tip, limited(sub(p, robot.tip), params.follow_error))
    if escapes and not moves and evades(reason, permission):
        # It stands where it was told to go, not where a tool comes.
        moves = True
        p = plus(robot.tip, limited(sub(p, robot.tip), params.follow_error))
    p_WG = robot.fulcrum if all_finite(robot.fulcrum) else sub(p, tool.u)
    wanted = (0.0, 0.0, 0.0)
    if moves:
        wanted = over(v_R.v, max(guide.s, params.min_proportion))
        wanted = limit_tip_velocity(params, p_WG, p, wanted, view_cone, escapes)
    shaft = sub(p, p_WG)
    u = unit(shaft, _DOWN)
    hardest = pace(params, escapes).acceleration
    change = limited(sub(wanted, tool.v), hardest * params.period)
    sideways = across(change, u)
    hardest = lever(params, norm(shaft)) * params.wrist_acceleration
    excess = sub(sideways, limited(sideways, hardest * params.period))
    v = plus(tool.v, sub(change, excess))
    du = over(across(v, u), norm(shaft))
    leeway = Leeway(clearance.forth, clearance.back)
    return ToolMotion(p, u, v, du, time), StopCode(code), leeway


class ToolNavigation(StepBlock):
    """Turns the guide point's velocity into the pose of the tool (procedure, step 4).

    The commanded tip is integrated in the state, so that the arm's small lag
    does not accumulate. When it must not move, the tip slows to a stop with the
    bounded acceleration, the reason is on port ``stop``, and motion goes on when
    the reason is gone.

    Port ``v_R`` accepts the guide point's `Velocity`, equation (6).

    Port ``guide`` accepts the `Guide`.

    Port ``robot_tool`` accepts the `RobotTool`, its tip as measured.

    Port ``obstacles`` accepts the `Estimate` of every obstacle tool.

    Port ``target`` accepts the `Estimate` of the target tool S.

    Port ``view_cone`` accepts the `ViewCone`.

    Port ``permission`` accepts the passive wrist's `Permission`; free without a wire.
    The share itself is kept before the evasion of tools, by the clearance constraint.

    Port ``clearance`` accepts the constraint's `ClearanceStatus`; calm without a wire.
    While it escapes from a tool it is faster and may leave the view, and a tool that
    is lost, a target out of reach, a probe of the wall or an arm that lags do not stop
    it.

    Port ``tool`` emits the commanded `ToolMotion`.

    Port ``stop`` emits why the robot stands, a `StopCode`.

    Port ``leeway`` emits the `Leeway` that the constraint left.
    """

    def __init__(
        self,
        params: ToolNavigationParams | None = None,
        p_WP: Sequence[float] = START.tip,
        p_WG: Sequence[float] = START.fulcrum,
        obstacles: Sequence[str] = ("obstacle",),
    ) -> None:
        """Makes the block.

        Args:
            params: Parameters; the defaults if None.
            p_WP: The tool's tip at the start [m].
            p_WG: Its fulcrum at the start [m].
            obstacles: Names of the obstacle tools.
        """
        super().__init__()
        params = params or ToolNavigationParams()
        still = (0.0, 0.0, 0.0)
        tip = vector(p_WP)
        u = unit(sub(tip, vector(p_WG)), _DOWN)
        self.declare_update(
            _update,
            [constants(params)],
            {
                "v_R": Velocity,
                "guide": Guide,
                "robot_tool": RobotTool,
                "obstacles": Many(Estimate, tuple(obstacles)),
                "target": Estimate,
                "view_cone": ViewCone,
                "permission": Permission,
                "clearance": ClearanceStatus,
            },
            {
                "tool": ToolMotion(tip, u, still, still, 0.0),
                "stop": StopCode(float(Stop.MOVING)),
                "leeway": UNHINDERED,
            },
            params.period,
            defaults={"permission": FREE, "clearance": CALM},
        )
