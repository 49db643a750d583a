"""Joint commands: the arm's set-points that carry the tool along.

Differential inverse kinematics as a quadratic program within joint positions and
speeds. Mostly its free minimum keeps the bounds, and then it is the solution; where
it does not, quadprog's exact solver is asked. (Drake's own
DoDifferentialInverseKinematics gives the same velocities and takes many times as
long; the tests hold the two against each other.)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np
import quadprog

from plants.arm.arm import ArmParams, SetPoint
from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.parameters import JOINTS, READY_POSTURE
from plants.arm.signals import ArmState, Posture
from plants.instruments.instrument import InstrumentParams
from systems.common.block import Block
from systems.common.compiled import Numbers, compiled, packed
from systems.common.geometry import Vector, along, cross, sub
from systems.common.parameter import check, parameter
from systems.common.serial_arm import read_arm, tool_state
from systems.common.signal import Field, finiteness, flat, reader, size
from systems.common.signals import ToolMotion
from systems.common.step_block import wired


class Status(NamedTuple):
    """Whether the arm follows."""

    code: Annotated[
        float, Field("1", "1 while joint limits keep it from following, else 0", 0.0)
    ]


read_tool = reader(ToolMotion)
finite_motion = finiteness(ToolMotion)


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
    joint_margin: float = parameter(
        0.03, "distance kept from the joints' end stops", "rad", least=0, most=0.5
    )
    shortfall: float = parameter(
        0.005, "error of the tool's velocity that is told", "m/s", least=0, most=0.05
    )


_BOUNDS = np.hstack([np.eye(7), -np.eye(7)])
_LITTLE = 1e-6
"""Weight of the centering against the tool's motion: the arm's spare joint alone."""


@compiled
def product(A: np.ndarray, x: np.ndarray) -> np.ndarray:
    """A x; for 6 x 7 numbers several times faster than a call into BLAS."""
    result = np.zeros(len(A))
    for i in range(A.shape[0]):
        for j in range(A.shape[1]):
            result[i] += A[i, j] * x[j]
    return result


@compiled
def solve_positive(A: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Solves A x = b for a symmetric positive A by elimination; changes both."""
    n = len(b)
    for k in range(n):
        for i in range(k + 1, n):
            factor = A[i, k] / A[k, k]
            for j in range(k, n):
                A[i, j] -= factor * A[k, j]
            b[i] -= factor * b[k]
    for k in range(n - 1, -1, -1):
        for j in range(k + 1, n):
            b[k] -= A[k, j] * b[j]
        b[k] /= A[k, k]
    return b


@compiled
def free_velocity(J: np.ndarray, V: np.ndarray, v_nominal: np.ndarray) -> np.ndarray:
    """Joint velocities that move the tool, without bounds, see `joint_velocity`.

    v = v_nominal + J' (J J' + 1e-6)^-1 (V - J v_nominal).
    """
    n = len(J)
    A = np.zeros((n, n))
    for i in range(n):
        A[i] = product(J, J[i])
        A[i, i] += _LITTLE
    rest = solve_positive(A, V - product(J, v_nominal))
    return v_nominal + product(J.T, rest)


def joint_velocity(
    J: np.ndarray,
    V: np.ndarray,
    v_nominal: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
) -> np.ndarray:
    """Joint velocities that move the tool, within bounds.

    Solves min |J v - V|^2 + 1e-6 |v - v_nominal|^2, low <= v <= high.

    Args:
        J: Jacobian of the tool (6 x 7).
        V: Its wanted spatial velocity (6) [rad/s, m/s].
        v_nominal: Where the spare joint drifts to (7) [rad/s].
        low: Lower bounds (7) [rad/s].
        high: Upper bounds (7) [rad/s]. Where a joint stands beyond its end stop,
            the bounds lead it back.

    Returns:
        v (7) [rad/s].
    """
    G = J.T @ J
    G.flat[::8] += _LITTLE
    low = np.minimum(low, high)
    bounds = np.concatenate([low, -high])
    return quadprog.solve_qp(G, V @ J + _LITTLE * v_nominal, _BOUNDS, bounds)[0]


@compiled
def tool_twist(
    p_WT: Numbers,
    u_WT: Numbers,
    tool: ToolMotion,
    now: float,
    period: float,
    gain: float,
) -> tuple[Vector, Vector]:
    """The tip's spatial velocity that carries the tool along its command.

    Args:
        p_WT: Where the commanded posture has the tip, in W [m].
        u_WT: Its shaft's direction in W.
        tool: The command.
        now: Time [s] of p_WT and u_WT.
        period: How long the velocity will hold [s].
        gain: Share of the remaining error taken away in it.

    Returns:
        Angular and translational velocity (w, v) in W [rad/s, m/s]; there is no
        rotation about the shaft: the roll is kept.
    """
    ahead = now - tool.time
    rate = gain / period
    p = along(tool.tip, ahead, tool.v)
    u = along(tool.u, ahead, tool.du)
    v = along(tool.v, rate, sub(p, p_WT))
    return cross(u, along(tool.du, rate, sub(u, u_WT))), v


@compiled
def problem(
    constants: Any, arm: Any, q: np.ndarray, tool: ToolMotion, time: float
) -> tuple[np.ndarray, ...]:
    """The quadratic program of an instant, as `joint_velocity` takes it.

    Args:
        constants: A record of `JointCommands`.
        arm: A record of `read_arm`.
        q: Commanded joint positions (7) [rad].
        tool: The command.
        time: Now [s].

    Returns:
        J, V, v_nominal, low, high; and the torques of the load's weight (7) [Nm].
    """
    period = constants.period
    p_WT, u_WT, J, weight = tool_state(arm, q)
    w, v = tool_twist(p_WT, u_WT, tool, time, period, constants.gain)
    return (
        J,
        np.array(w + v),
        constants.centering * (constants.nominal - q),
        np.maximum(-constants.speed, (constants.low - q) / period),
        np.minimum(constants.speed, (constants.high - q) / period),
        weight,
    )


@compiled
def _problem(
    record: np.ndarray, arm: np.ndarray, q: np.ndarray, tool: np.ndarray, time: float
) -> tuple[np.ndarray, ...]:
    return problem(record[0], arm[0], q, read_tool(tool), time)


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
    constants: Any, arm: Any, q: np.ndarray, time: float, tool: ToolMotion
) -> tuple[np.ndarray, np.ndarray, Status, float]:
    """What `command` gives, and 1 if the free minimum keeps the bounds, else 0."""
    if not finite_motion(tool):  # hold still
        weight = tool_state(arm, q)[3]
        return command(constants, q, np.zeros(JOINTS), weight, np.inf) + (1.0,)
    J, V, v_nominal, low, high, weight = problem(constants, arm, q, tool, time)
    v = free_velocity(J, V, v_nominal)
    shortfall = np.abs(product(J, v) - V).max()
    is_free = 1.0
    for i in range(JOINTS):
        if not low[i] <= v[i] <= high[i]:
            is_free = 0.0
    return command(constants, q, v, weight, shortfall) + (is_free,)


class JointCommands(Block):
    """Follows the commanded tool pose with the arm's seven joints.

    The posture is integrated in the state; its own forward kinematics closes the
    loop, so nothing drifts. The instrument's weight is fed forward.

    Port ``tool`` accepts the `ToolMotion`.

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
        self._constants = packed(
            params,
            nominal=nominal,
            low=plant.GetPositionLowerLimits() + params.joint_margin,
            high=plant.GetPositionUpperLimits() - params.joint_margin,
            speed=params.joint_speed * plant.GetVelocityUpperLimits(),
            lead=set_point.lead,
            compliance=set_point.compliance,
        )
        signals = {"posture": Posture, "set_point": ArmState, "status": Status}
        sizes = [*map(size, signals.values()), 1]
        self._step = wired(_free_step, 2, [JOINTS], [ToolMotion], sizes, True)
        self._tool = self.signal_in("tool", ToolMotion)
        _, _, _, weight = tool_state(self._arm[0], nominal)
        start = command(self._constants[0], nominal, np.zeros(JOINTS), weight, 0.0)
        for (name, signal), state in zip(signals.items(), start, strict=True):
            self.state_out(name, signal, flat(state))
        reads = {self.xd_ticket(), self.time_ticket(), self._tool.ticket()}
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
        tool, time = self._tool.Eval(context), context.get_time()
        step = self._step(self._constants, self._arm, q, time, tool)
        is_free = step[-1]
        if is_free:
            return step[:JOINTS], step[JOINTS:-2], step[-2:-1]
        J, V, *bounds, weight = _problem(self._constants, self._arm, q, tool, time)
        v = joint_velocity(J, V, *bounds)
        return command(self._constants[0], q, v, weight, abs(J @ v - V).max())
