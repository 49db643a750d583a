"""Joint commands: the arm's set-points that carry the tool along.

Differential inverse kinematics as a quadratic program within joint positions and
speeds, see `joint_velocity`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import pi, sin
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.arm.arm import ArmParams, SetPoint
from plants.arm.controller_plant import (
    INSTRUMENT_TIP,
    accelerations,
    make_controller_plant,
)
from plants.arm.parameters import JOINTS, READY_POSTURE
from plants.arm.signals import ArmState, Posture
from plants.instruments.instrument import InstrumentParams
from systems.common.block import Block
from systems.common.compiled import Numbers, compiled, packed
from systems.common.geometry import (
    Vector,
    all_finite,
    along,
    cross,
    norm,
    plus,
    scaled,
    sub,
    xyz,
)
from systems.common.parameter import check, parameter
from systems.common.serial_arm import read_arm, tool_state
from systems.common.signal import (
    Field,
    columns,
    finiteness,
    flat,
    reader,
    size,
    view,
)
from systems.common.signals import (
    CALM,
    FREE,
    ClearanceStatus,
    Permission,
    Point,
    ToolMotion,
)
from systems.common.step_block import wired
from systems.common.stops import Stop
from systems.motion.joint_velocity import free_velocity, joint_velocity, product


class Status(NamedTuple):
    """Whether the arm follows."""

    code: Annotated[
        float,
        Field("1", "1 while joint limits keep it from following, 2 while limp", 0.0),
    ]


LIMP = 2.0
"""Status of an arm that gives way: its servos are told where it is."""
read_tool, read_point = reader(ToolMotion), reader(Point)
finite_motion, finite_state = finiteness(ToolMotion), finiteness(ArmState)


@dataclass
class JointCommandsParams:
    """Parameters of `JointCommands`."""

    period: float = parameter(1 / 120, "of the set-points", "s", above=0, most=0.1)
    gain: float = parameter(
        0.3, "share of the pose error that a period takes away", above=0, most=1
    )
    centering: float = parameter(
        0.2, "rate of the spare joint to the ready posture", "1/s", least=0, most=10
    )
    joint_speed: float = parameter(
        0.8, "share of the joints' rated speeds that may be used", above=0, most=1
    )
    # More than a joint's torque can give leaves it behind its command, and what joint 1
    # lags is seen at the fulcrum.
    joint_torque: float = parameter(
        0.8, "share of the rated torques to change speeds with", above=0, most=1
    )
    joint_margin: float = parameter(
        0.03, "distance kept from the joints' end stops", "rad", least=0, most=0.5
    )
    # Where not all can be had: a tip that lags costs time, a fulcrum missed force.
    fulcrum_first: float = parameter(
        20.0, "weight of the fulcrum's motion against the turning", least=1, most=1e3
    )
    # No tool is touched, first of all: with 5 the tip lags least.
    fulcrum_evading: float = parameter(
        5.0, "the same while a tool is near", least=1, most=1e3
    )
    shortfall: float = parameter(
        0.005, "error of the tool's velocity that is told", "m/s", least=0, most=0.05
    )
    catch_up: float = parameter(
        0.1,
        "speed at the most with which an error is made good",
        "m/s",
        above=0,
        most=1,
    )
    # At the fulcrum, and the shaft ten times as far in rad; 2 mm are 1 N on a usual
    # wall. A sound arm strays 0.3 mm.
    follow: float = parameter(
        2e-3, "how far the arm may stray from its command", "m", above=0, most=0.05
    )
    # There and back: it turns what the wrist's sensor drifts by, and nothing else.
    roll: float = parameter(
        0.0, "of the tool about its shaft, as it works", "rad", least=0, most=4
    )
    roll_period: float = parameter(60.0, "of that", "s", least=5, most=1e4)
    limp_time: float = parameter(
        0.3, "that an arm which strayed stays limp", "s", least=0, most=10
    )


_STILL = (0.0, 0.0, 0.0)
_FREE, _CALM = flat(FREE), flat(CALM)
_NEAR = columns(ClearanceStatus).index("near")
_YIELD = 0.7
_GIVE_WAY = (float(Stop.WALL_LOADED), float(Stop.SENSOR_LOST))


@compiled
def tool_twist(
    p_WT: Numbers,
    u_WT: Numbers,
    tool: ToolMotion,
    now: float,
    period: float,
    gain: float,
    fastest: float,
) -> tuple[Vector, Vector]:
    """The tip's spatial velocity that carries the tool along its command.

    Args:
        p_WT: Where the commanded posture has the tip, in W [m].
        u_WT: Its shaft's direction in W.
        tool: The command.
        now: Time [s] of p_WT and u_WT.
        period: How long the velocity will hold [s].
        gain: Share of the remaining error taken away in it.
        fastest: Speed at the most with which that is done [m/s], the shaft ten times
            as fast in rad/s.

    Returns:
        Angular and translational velocity (w, v) in W [rad/s, m/s], without rotation
        about the shaft.
    """
    ahead = now - tool.time
    rate = gain / period
    p = along(tool.tip, ahead, tool.v)
    u = along(tool.u, ahead, tool.du)
    away, askew = sub(p, p_WT), sub(u, u_WT)
    worst = rate * max(norm(away), 0.1 * norm(askew))
    # Both by one share: so the shaft keeps to the fulcrum on the way.
    share = 1.0 if worst <= fastest else fastest / worst
    v = scaled(share, along(tool.v, rate, away))
    return cross(u, scaled(share, along(tool.du, rate, askew))), v


@compiled
def problem(
    constants: Any,
    arm: Any,
    q: np.ndarray,
    before: np.ndarray,
    time: float,
    tool: ToolMotion,
    fulcrum: Point,
) -> tuple[np.ndarray, ...]:
    """The quadratic program of an instant, as `joint_velocity` takes it.

    The tool's velocity is asked at the fulcrum, where an error costs force, and
    weighs more there than its turning: where both cannot be had, the tip lags.

    Args:
        constants: A record of `JointCommands`.
        arm: A record of `read_arm`.
        q: Commanded joint positions (7) [rad].
        before: Joint velocities so far (7) [rad/s].
        time: Now [s].
        tool: The command.
        fulcrum: The shaft's; the tip stands for it if it is no number.

    Returns:
        J, V, v_nominal, low, high; and the torques of the load's weight (7) [Nm].
    """
    period = constants.period
    p_WT, u_WT, J, weight = tool_state(arm, q)
    twist = (p_WT, u_WT, tool, time, period, constants.gain, constants.catch_up)
    w, v = tool_twist(*twist)
    turn = 2.0 * pi / constants.roll_period
    w = along(w, 0.5 * constants.roll * turn * sin(turn * time), u_WT)
    lever = _STILL
    if all_finite(fulcrum.p):
        lever = sub(fulcrum.p, p_WT)
    V = np.array(w + plus(v, cross(w, lever)))
    for i in range(JOINTS):
        dv = cross(xyz(J[:3, i], 0), lever)
        for k in range(3):
            J[3 + k, i] = constants.fulcrum_first * (J[3 + k, i] + dv[k])
    V[3:] *= constants.fulcrum_first
    low = np.maximum(-constants.speed, (constants.low - q) / period)
    high = np.minimum(constants.speed, (constants.high - q) / period)
    change = constants.acceleration * period  # the end stops come before it
    return (
        J,
        V,
        constants.centering * (constants.nominal - q),
        np.minimum(np.maximum(low, before - change), high),
        np.maximum(np.minimum(high, before + change), low),
        weight,
    )


@compiled
def _problem(
    record: np.ndarray,
    arm: np.ndarray,
    q: np.ndarray,
    before: np.ndarray,
    time: float,
    tool: np.ndarray,
    fulcrum: np.ndarray,
) -> tuple[np.ndarray, ...]:
    told = read_tool(tool), read_point(fulcrum)
    return problem(record[0], arm[0], q, before, time, told[0], told[1])


@compiled
def missing(constants: Any, J: np.ndarray, v: np.ndarray, V: np.ndarray) -> float:
    """How much of the tool's velocity is missing [m/s, rad/s], see `problem`."""
    short = np.abs(product(J, v) - V)
    return max(short[:3].max(), short[3:].max() / constants.fulcrum_first)


@compiled
def command(
    constants: Any,
    q: np.ndarray,
    v: np.ndarray,
    weight: np.ndarray,
    shortfall: float,
) -> tuple[np.ndarray, np.ndarray, Status]:
    """The next posture (7), the servos' set-point (14), and the status.

    Args:
        constants: A record of `JointCommands`.
        q: Commanded joint positions (7) [rad].
        v: Joint velocities (7) [rad/s].
        weight: Torques of the load's weight (7) [Nm].
        shortfall: How much of the tool's velocity is missing [m/s, rad/s].
    """
    set_point = np.zeros(2 * JOINTS)
    # As `SetPoint` says.
    set_point[:JOINTS] = q + constants.lead * v - constants.compliance * weight
    short = 1.0 if shortfall > constants.shortfall else 0.0
    return q + constants.period * v, set_point, Status(short)


@compiled
def _free_step(
    constants: Any,
    arm: Any,
    q: np.ndarray,
    rest: np.ndarray,
    before: np.ndarray,
    time: float,
    tool: ToolMotion,
    fulcrum: Point,
    measured: ArmState,
    permission: Permission,
) -> tuple[np.ndarray, np.ndarray, Status, float, np.ndarray, float]:
    """What `command` gives, how long the arm stays limp, its velocities, and if final.

    The last is 1 if that is so, and 0 if the free minimum does not keep the bounds.
    """
    still = np.zeros(JOINTS)
    if not finite_motion(tool):  # hold still
        weight = tool_state(arm, q)[3]
        return command(constants, q, still, weight, np.inf) + (0.0, still, 1.0)
    J, V, v_nominal, low, high, weight = problem(
        constants, arm, q, before, time, tool, fulcrum
    )
    q_m, v_m = np.array(measured.q), np.array(measured.v)
    if not finite_state(measured):  # unseen it is where it was told to be
        q_m, v_m = q, still
    astray = np.abs(product(J, q - q_m))
    strayed = max(astray[3:].max() / constants.fulcrum_first, 0.1 * astray[:3].max())
    left = max(rest[0] - constants.period, 0.0)
    if strayed > constants.follow:
        left = constants.limp_time
    if left > 0.0 or permission.code in _GIVE_WAY:
        _, set_point, _ = command(constants, q_m, still, weight, 0.0)
        # Most of the servos' own damping is taken away as well.
        lag = constants.lead - constants.period
        set_point[:JOINTS] += _YIELD * lag * v_m
        return q_m, set_point, Status(LIMP), left, v_m, 1.0
    v = free_velocity(J, V, v_nominal)
    shortfall = missing(constants, J, v, V)
    is_free = 1.0
    for i in range(JOINTS):
        if not low[i] <= v[i] <= high[i]:
            is_free = 0.0
    return command(constants, q, v, weight, shortfall) + (0.0, v, is_free)


class JointCommands(Block):
    """Follows the commanded tool pose with the arm's seven joints.

    The posture is integrated in the state; its own forward kinematics closes the
    loop, so nothing drifts. The instrument's weight is fed forward. An arm that does
    not follow goes limp for a while, and one whose wrist finds the wall loaded, or
    does not feel it: the servos are told where it is, and the wall moves it.

    Port ``tool`` accepts the `ToolMotion`.

    Port ``fulcrum`` accepts G_R, the `Point` that the shaft pivots about; it is the
    tip if it is not connected.

    Port ``arm_state`` accepts the measured `ArmState`; unconnected it follows.

    Port ``permission`` accepts the passive wrist's `Permission`; free without a wire.

    Port ``clearance`` accepts the constraint's `ClearanceStatus`; calm without a wire.

    Port ``set_point`` emits the `ArmState` that the arm's servos take.

    Port ``posture`` emits the commanded `Posture`.

    Port ``next`` emits that of the next instant.

    Port ``status`` emits the `Status`.
    """

    def __init__(
        self,
        params: JointCommandsParams | None = None,
        posture: Sequence[float] = READY_POSTURE,
        arm: ArmParams | None = None,
        instrument: InstrumentParams | None = None,
    ) -> None:
        """Makes the block for an arm's servos, starting at a posture (7) [rad]."""
        super().__init__()
        params = params or JointCommandsParams()
        check(params)
        plant = make_controller_plant(instrument=instrument)
        self._arm = read_arm(plant, plant.GetFrameByName(INSTRUMENT_TIP))
        set_point = SetPoint(arm, params.period)
        nominal = np.array(posture, float)
        self._constants, self._evading = (
            packed(
                params,
                fulcrum_first=first,
                nominal=nominal,
                low=plant.GetPositionLowerLimits() + params.joint_margin,
                high=plant.GetPositionUpperLimits() - params.joint_margin,
                speed=params.joint_speed * plant.GetVelocityUpperLimits(),
                acceleration=params.joint_torque * accelerations(plant, nominal),
                lead=set_point.lead,
                compliance=set_point.compliance,
            )
            for first in (params.fulcrum_first, params.fulcrum_evading)
        )
        signals = {"posture": Posture, "set_point": ArmState, "status": Status}
        sizes = [*map(size, signals.values()), 1, JOINTS, 1]
        told = [ToolMotion, Point, ArmState, Permission]
        ends = np.cumsum([0, *sizes]).tolist()
        self._parts = [slice(*pair) for pair in pairwise(ends)]
        self._step = wired(_free_step, 2, [JOINTS, 1, JOINTS], told, sizes, True)
        self._tool = self.signal_in("tool", ToolMotion)
        self._fulcrum = self.signal_in("fulcrum", Point)
        self._measured = self.signal_in("arm_state", ArmState)
        self._permission = self.signal_in("permission", Permission)
        self._clearance = self.signal_in("clearance", ClearanceStatus)
        _, _, _, weight = tool_state(self._arm[0], nominal)
        start = command(self._constants[0], nominal, np.zeros(JOINTS), weight, 0.0)
        for (name, signal), state in zip(signals.items(), start, strict=True):
            self.state_out(name, signal, flat(state))
        self.DeclareDiscreteState(1)  # s that it stays limp
        self.DeclareDiscreteState(JOINTS)  # its velocities, rad/s
        ports = (self._tool, self._fulcrum, self._measured, self._permission)
        reads = {self.xd_ticket(), self.time_ticket(), self._clearance.ticket()}
        reads |= {port.ticket() for port in ports}
        self._next = self.cached("next", self._calc_next, reads)
        self.signal_out(
            "next",
            Posture,
            lambda context: self._next.Eval(context)[0],
            {self._next.ticket()},
        )
        self.update_every(params.period, self._next.Eval)

    def _calc_next(self, context: Any) -> Sequence[Any]:
        q = context.get_discrete_state(0).value()
        rest = context.get_discrete_state(3).value()
        before = context.get_discrete_state(4).value()
        tool, time = self._tool.Eval(context), context.get_time()

        def told(port: Any, instead: Callable[[], np.ndarray]) -> np.ndarray:
            return port.Eval(context) if port.HasValue(context) else instead()

        fulcrum = told(self._fulcrum, lambda: view(ToolMotion, tool).tip)
        measured = told(self._measured, lambda: np.concatenate([q, q]))
        permission = told(self._permission, lambda: _FREE)
        evades = told(self._clearance, lambda: _CALM)[_NEAR] > 0.5
        constants, arm = self._evading if evades else self._constants, self._arm
        step = self._step(
            constants, arm, q, rest, before, time, tool, fulcrum, measured, permission
        )
        *given, final = [step[part] for part in self._parts]
        if final[0]:
            return given
        J, V, *bounds, weight = _problem(constants, arm, q, before, time, tool, fulcrum)
        v = joint_velocity(J, V, *bounds)
        short = missing(constants[0], J, v, V)
        return *command(constants[0], q, v, weight, short), given[3], v
