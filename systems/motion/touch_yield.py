"""Touch yield: a tool that is pushed by another gives way to it.

Servos as stiff as an arm's cannot be pushed: 5 N at the tool turn its joints by some 35
urad. What is available is the wrist's sensor: while something pushes the shaft, its
place there goes with the force, through the fulcrum,

    v = A f (1 - f_0 / |f|),    at the tip v / share,

A being the admittance, and f_0 the force that is borne. The task waits, with its
reason, and goes on a while after. What leads R meanwhile is the push alone, but for a
withdrawal along its own shaft that is under way, which takes no new room. It gives way
within a ball about where the push found the tip, and stands at its edge: what is taken
for a push and is none does not lead it farther.
"""

from dataclasses import dataclass
from math import sqrt
from typing import Any, NamedTuple

from systems.common.compiled import compiled, packed
from systems.common.geometry import (
    along,
    dot,
    limited,
    norm,
    plus,
    scaled,
    sub,
    unit,
)
from systems.common.parameter import check, parameter
from systems.common.signal import Vector, finiteness
from systems.common.signals import (
    FREE,
    Guide,
    Permission,
    RobotTool,
    Velocity,
    finite_guide,
    finite_permission,
    finite_tool,
)
from systems.common.step_block import StepBlock
from systems.common.stops import Stop
from systems.sensing.touch_watch import Touched

finite_touch, finite_velocity = finiteness(Touched), finiteness(Velocity)
_TOUCHED = float(Stop.TOUCHED)


@dataclass
class TouchYieldParams:
    """How the robot gives way to what pushes its tool."""

    active: bool = parameter(False, "whether a touch stops the task")
    # With what holds the other tool, some 250 N/m, and 60 ms of delay A k tau is 0.5;
    # with 0.05 the tools bounce, with up to 11 N.
    admittance: float = parameter(
        0.03, "A, speed for a force, where it acts", "m/(N s)", above=0, most=1
    )
    borne: float = parameter(0.1, "f_0, force that is borne", "N", least=0, most=5)
    speed: float = parameter(0.2, "of the tip, at the most", "m/s", above=0, most=0.5)
    acceleration: float = parameter(
        1.5, "of the tip, at the most", "m/s^2", above=0, most=20
    )
    room: float = parameter(
        0.08, "how far the tip gives way, from where it was", "m", above=0, most=0.3
    )
    least_share: float = parameter(
        0.3, "of the shaft, above which the tip goes no faster", above=0, most=1
    )
    wait: float = parameter(
        0.5, "after the touch, before the task goes on", "s", least=0, most=10
    )
    least_guide: float = parameter(
        0.1, "of s, as the navigation has it", above=0, most=1
    )
    period: float = parameter(1 / 60, "of the update", "s", above=0, most=1)


class Yielding(NamedTuple):
    """How fast the tip gives way, m/s; how long the task still waits, s; whence, m."""

    v: Vector
    left: float
    start: Vector


@compiled
def give_way(
    c: Any,
    old: Yielding,
    v_safe: Velocity,
    guide: Guide,
    robot: RobotTool,
    permission: Permission,
    touch: Touched,
) -> tuple[Yielding, Velocity, Permission]:
    """One step: what is remembered, the guide point's velocity, and the permission.

    It stands while something of what it is told is no number.
    """
    still = (0.0, 0.0, 0.0)
    sound = finite_touch(touch) and finite_guide(guide) and finite_tool(robot)
    if not (sound and finite_velocity(v_safe) and finite_permission(permission)):
        return Yielding(still, old.left, old.start), Velocity(still), permission
    s = max(guide.s, c.least_guide)
    pushed = touch.touched > 0.5
    left = c.wait if pushed else max(old.left - c.period, 0.0)
    if left <= 0.0:
        return Yielding(still, 0.0, robot.tip), v_safe, permission
    start = old.start if old.left > 0.0 else robot.tip
    wanted = still
    if pushed:
        over = max(0.0, 1.0 - c.borne / max(norm(touch.f), 1e-9))
        rate = c.admittance * over / max(touch.share, c.least_share)
        wanted = limited(scaled(rate, touch.f), c.speed)
        away = sub(robot.tip, start)
        out, far = unit(away), norm(away)
        # What can still be braked within the room.
        fastest = sqrt(2.0 * c.acceleration * max(c.room - far, 0.0))
        wanted = along(wanted, min(fastest - dot(wanted, out), 0.0), out)
    v = plus(old.v, limited(sub(wanted, old.v), c.acceleration * c.period))
    u = unit(sub(robot.tip, robot.fulcrum))
    v_R = Velocity(along(scaled(s, v), min(0.0, dot(v_safe.v, u)), u))
    return Yielding(v, left, start), v_R, Permission(0.0, _TOUCHED)


class TouchYield(StepBlock):
    """Lets the task through, or gives way while something pushes the tool.

    Port ``v_safe`` accepts the `Velocity` of the guide point.

    Port ``guide`` accepts the `Guide`, of which s is used.

    Port ``robot_tool`` accepts the `RobotTool`.

    Port ``wrist`` accepts the passive wrist's `Permission`; free without a wire.

    Port ``touch`` accepts what is `Touched`.

    Port ``v_R`` emits the `Velocity` of the guide point.

    Port ``permission`` emits the `Permission` of the task.
    """

    def __init__(self, params: TouchYieldParams | None = None) -> None:
        """Makes the block; raises ParameterError for a value out of range."""
        super().__init__()
        params = check(params or TouchYieldParams())
        self.declare_step(
            give_way,
            [packed(params)],
            {
                "v_safe": Velocity,
                "guide": Guide,
                "robot_tool": RobotTool,
                "wrist": Permission,
                "touch": Touched,
            },
            Yielding((0.0, 0.0, 0.0), 0.0, (0.0, 0.0, 0.0)),
            {"v_R": Velocity, "permission": Permission},
            params.period,
            timed=False,
            defaults={"wrist": FREE},
        )
