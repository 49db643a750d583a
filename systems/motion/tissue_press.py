"""Tissue press: gauze is laid on an organ and pressed on it by force.

Once R's tip is at its target for a while, and the wrist sure of its fulcrum, it goes
along the organ's normal n with

    v = v_T - n (F_d - F) / b + k_t (place - p)_across,

v_T being the organ's own velocity, so that the breath is followed and the force loop
has only its error to mend. (A wrist that does not know the breath yet follows its
sensor's noise, and shakes the tip.) R dabs until F is known well enough, then holds.
After the time of pressing it draws back along n, and the planner has it again. A tool
that comes too near, a force that is too great, or one that cannot be told from
friction: R draws back at once.
"""

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from systems.bypass.clearance_constraint import ClearanceStatus
from systems.common.compiled import compiled, packed
from systems.common.geometry import (
    across,
    along,
    limited,
    norm,
    plus,
    scaled,
    sub,
)
from systems.common.parameter import check, parameter
from systems.common.signal import Field, Many, Vector, finiteness
from systems.common.signals import (
    Estimate,
    Guide,
    MovingPoint,
    Permission,
    RobotTool,
    Velocity,
    finite_permission,
    usable,
)
from systems.common.step_block import StepBlock
from systems.common.stops import Code
from systems.sensing.tissue_force import TissueTouch


class Phase(Code):
    """Of pressing."""

    COMING = 0, "on the way to the place"
    PRESSING = 1, "pressing"
    HOLDING = 2, "pressing with the force that is wanted"
    LEAVING = 3, "drawing back"
    DONE = 4, "done"
    GIVEN_UP = 5, "given up: drawn back before the time"
    LIFTED = 6, "lifted, to touch again"


class Press(NamedTuple):
    """How far the pressing is."""

    phase: Annotated[float, Field("1", "a `Phase`", 0.0)]
    since: Annotated[float, Field("s", "it began; the time at the place", 0.0)]
    place: Annotated[Vector, Field("m", "in the resting organ", (0.0, 0.0, -0.1))]
    held: Annotated[float, Field("1", "1 if the time was held, else 0", 0.0)]
    touches: Annotated[float, Field("1", "so far", 0.0)]


@dataclass
class TissuePressParams:
    """Parameters of `TissuePress`."""

    active: bool = parameter(False, "whether there is a task to press")
    period: float = parameter(1 / 60, "of the update", "s", above=0.0, most=1.0)
    force: float = parameter(0.5, "F_d", "N", above=0.0, most=5.0)
    duration: float = parameter(2.0, "of pressing", "s", above=0.0, most=60.0)
    tolerance: float = parameter(0.1, "within it F counts as F_d", "N", above=0, most=1)
    settling: float = parameter(
        0.4, "within it for so long, the time of pressing begins", "s", least=0, most=9
    )
    # Each touch tells anew the force from the drift of the sensor's zero.
    doubt: float = parameter(
        0.25,
        "sigma of F over the tolerance: more, and R dabs",
        above=0.0,
        most=1.0,
    )
    touches: int = parameter(6, "at the most, before it holds", least=1, most=20)
    lift: float = parameter(
        0.001, "room to the organ between two touches", "m", above=0.0, most=0.01
    )
    damping: float = parameter(
        40.0,
        "b; stable while the tissue's stiffness is below some 10 b / s",
        "N s/m",
        least=10.0,
        most=1e4,
    )
    place_rate: float = parameter(2.0, "k_t", "1/s", least=0.0, most=10.0)
    max_speed: float = parameter(
        0.008, "towards and away from the organ", "m/s", above=0.0, most=0.05
    )
    gentle: float = parameter(
        0.002, "towards it where it is touched", "m/s", above=0.0, most=0.05
    )
    arrived: float = parameter(
        0.004, "so near to the target it is at the place", "m", above=0.0, most=0.02
    )
    sure: float = parameter(
        1.0, "share of its speed that the wrist must allow it", least=0.0, most=1.0
    )
    wait: float = parameter(0.5, "at the place, before it begins", "s", least=0, most=9)
    leave: float = parameter(
        0.006,
        "room to the organ where the planner has R again",
        "m",
        above=0,
        most=0.03,
    )
    most_force: float = parameter(2.0, "more is given up", "N", above=0.0, most=10.0)


finite_velocity, finite_guide = finiteness(Velocity), finiteness(Guide)
finite_robot, finite_target = finiteness(RobotTool), finiteness(Estimate)
finite_clearance, finite_touch = finiteness(ClearanceStatus), finiteness(TissueTouch)


@compiled
def _step(
    params: Any,
    state: Press,
    time: float,
    v_safe: Velocity,
    guide: Guide,
    robot: RobotTool,
    target: Estimate,
    clearance: ClearanceStatus,
    touch: TissueTouch,
    permission: Permission,
    moved: np.ndarray,
) -> tuple[Press, Velocity, Press]:
    sound = finite_velocity(v_safe) and finite_guide(guide) and finite_robot(robot)
    sound = sound and finite_target(target) and finite_clearance(clearance)
    sound = sound and finite_touch(touch) and finite_permission(permission)
    if not (sound and np.isfinite(moved).all()):
        return state, Velocity((0.0, 0.0, 0.0)), state
    row = moved[int(touch.organ)]
    off, v_T = (row[0], row[1], row[2]), (row[3], row[4], row[5])
    phase, since, place, held, touches = state
    if phase == 0.0:
        is_there = usable(target) and norm(sub(target.p, robot.tip)) < params.arrived
        is_sure = touch.known > 0.5 and permission.speed_scale >= params.sure
        if not (is_there and is_sure):
            since = time
        elif time - since >= params.wait:
            phase, since, place = 1.0, time, sub(robot.tip, off)
    elif phase == 1.0:
        if abs(touch.force - params.force) > params.tolerance:
            since = time
        elif time - since >= params.settling:
            touches += 1.0
            is_told = touch.sigma <= params.doubt * params.tolerance
            phase = 2.0 if is_told or touches >= params.touches else 6.0
            since = time
    elif phase == 6.0:
        if touch.room < params.lift:
            since = time
        elif time - since >= params.settling:
            phase, since = 1.0, time
    elif phase == 2.0 and time - since >= params.duration:
        phase, since, held = 3.0, time, 1.0
    elif phase == 3.0 and touch.room > params.leave:
        phase, since = (4.0 if held > 0.5 else 5.0), time
    is_wrong = touch.known < 0.5 or touch.force > params.most_force
    presses = 1.0 <= phase <= 2.0 or phase == 6.0
    if presses and (is_wrong or clearance.room < -0.001):
        phase, since = 3.0, time
    after = Press(phase, since, place, held, touches)
    if not (presses or phase == 3.0):
        return after, v_safe, after
    into = (params.force - touch.force) / params.damping
    into = min(into, params.gentle + max(0.0, touch.room))  # slower the nearer
    if phase == 3.0:
        into = -params.max_speed
    elif phase == 6.0:
        into = -params.max_speed if touch.room < params.lift else 0.0
    into = max(-params.max_speed, min(params.max_speed, into))
    aside = across(sub(plus(place, off), robot.tip), touch.n)
    aside = limited(scaled(params.place_rate, aside), params.max_speed)
    v = along(plus(v_T, aside), -into, touch.n)
    return after, Velocity(scaled(guide.s, v)), after


class TissuePress(StepBlock):
    """Presses gauze on an organ where the target is; see the module.

    Between the clearance constraint, whose velocity passes while it does not press, and
    the tool's navigation.

    Port ``v_safe`` accepts the `Velocity` of the guide point.
    Port ``guide`` accepts the `Guide`, of which s is used.
    Port ``robot_tool`` accepts the `RobotTool`.
    Port ``target`` accepts the `Estimate` of S.
    Port ``clearance`` accepts the `ClearanceStatus` of the tools.
    Port ``touch`` accepts the `TissueTouch`.
    Port ``permission`` accepts the passive wrist's `Permission`.
    Port ``organs`` accepts the `MovingPoint` of each organ.
    Port ``v_R`` emits the `Velocity` of the guide point.
    Port ``press`` emits how far it is, `Press`.
    """

    def __init__(
        self,
        params: TissuePressParams | None = None,
        organs: tuple[str, ...] = ("organ",),
    ) -> None:
        """Makes the block of its parameters and the organs' names."""
        super().__init__()
        params = params or TissuePressParams()
        check(params)
        self.declare_step(
            _step,
            [packed(params)],
            {
                "v_safe": Velocity,
                "guide": Guide,
                "robot_tool": RobotTool,
                "target": Estimate,
                "clearance": ClearanceStatus,
                "touch": TissueTouch,
                "permission": Permission,
                "organs": Many(MovingPoint, organs),
            },
            Press(0.0, 0.0, (0.0, 0.0, 0.0), 0.0, 0.0),
            {"v_R": Velocity, "press": Press},
            params.period,
        )
