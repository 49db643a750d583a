"""Joint commands: the arm's set-points that carry the tool along.

Differential inverse kinematics as a quadratic program within joint positions and
speeds. Mostly its free minimum keeps the bounds, and then it is the solution; where
it does not, quadprog's exact solver is asked. (Drake's own
DoDifferentialInverseKinematics gives the same velocities and takes many times as
long; the tests hold the two against each other.)
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import quadprog

from plants.arm.arm import ArmParams, SetPoint
from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.parameters import READY_POSTURE
from plants.instruments.instrument import InstrumentParams
from systems.common.block import Block
from systems.common.compiled import Numbers, compiled, packed
from systems.common.geometry import Vector, all_finite, along, cross, sub, xyz
from systems.common.serial_arm import read_arm, tool_state


@dataclass
class JointCommandsParams:
    """Parameters of `JointCommands`.

    Attributes:
        period: Of the set-points [s].
        gain: Share of the pose error that is taken away in one period.
        centering: Rate at which the spare joint returns to the ready posture [1/s].
        joint_speed: Share of the joints' rated speeds that may be used.
        joint_margin: Distance kept from the joints' end stops [rad].
        shortfall: Error of the tool's velocity [m/s, rad/s] from which the limits are
            said to keep the arm from following.
    """

    period: float = 1.0 / 120.0
    gain: float = 0.3
    centering: float = 0.2
    joint_speed: float = 0.8
    joint_margin: float = 0.03
    shortfall: float = 0.005

    def check(self) -> None:
        """Raises ValueError for a value that makes no sense."""
        if not self.period > 0.0:
            raise ValueError(f"joint_commands.period={self.period} s: expected > 0")
        for name in ("gain", "joint_speed"):
            value = getattr(self, name)
            if not 0.0 < value <= 1.0:
                raise ValueError(f"joint_commands.{name}={value}: expected in (0, 1]")
        for name in ("centering", "joint_margin", "shortfall"):
            value = getattr(self, name)
            if value < 0.0:
                raise ValueError(f"joint_commands.{name}={value}: expected >= 0")


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
    tool: Numbers,
    now: float,
    period: float,
    gain: float,
) -> tuple[Vector, Vector]:
    """The tip's spatial velocity that carries the tool along its command.

    Args:
        p_WT: Where the commanded posture has the tip, in W [m].
        u_WT: Its shaft's direction in W.
        tool: The command: p_WP, u_W, v_WP, du_W/dt, time [s].
        now: Time [s] of p_WT and u_WT.
        period: How long the velocity will hold [s].
        gain: Share of the remaining error taken away in it.

    Returns:
        Angular and translational velocity (w, v) in W [rad/s, m/s]; there is no
        rotation about the shaft: the roll is kept.
    """
    ahead = now - tool[12]
    rate = gain / period
    v_WP, du_W = xyz(tool, 6), xyz(tool, 9)
    p = along(xyz(tool, 0), ahead, v_WP)
    u = along(xyz(tool, 3), ahead, du_W)
    v = along(v_WP, rate, sub(p, p_WT))
    return cross(u, along(du_W, rate, sub(u, u_WT))), v


@compiled
def problem(
    constants: Any, arm: Any, q: np.ndarray, tool: np.ndarray, time: float
) -> tuple[np.ndarray, ...]:
    """The quadratic program of an instant, as `joint_velocity` takes it.

    Args:
        constants: A record of `JointCommands`.
        arm: A record of `read_arm`.
        q: Commanded joint positions (7) [rad].
        tool: The command (13).
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
def command(
    constants: Any,
    q: np.ndarray,
    v: np.ndarray,
    weight: np.ndarray,
    shortfall: float,
) -> np.ndarray:
    """The next state: posture (7), the servos' set-point (14), status (1).

    Args:
        constants: A record of `JointCommands`.
        q: Commanded joint positions (7) [rad].
        v: Joint velocities (7) [rad/s].
        weight: Torques of the load's weight (7) [Nm].
        shortfall: How much of the tool's velocity is missing [m/s, rad/s].
    """
    state = np.zeros(22)
    state[:7] = q + constants.period * v
    # As `SetPoint` says.
    state[7:14] = q + constants.lead * v - constants.compliance * weight
    state[21] = 1.0 if shortfall > constants.shortfall else 0.0
    return state


@compiled
def _free_step(
    record: np.ndarray, arm: np.ndarray, q: np.ndarray, tool: np.ndarray, time: float
) -> tuple[np.ndarray, bool]:
    """The next state, and whether the free minimum keeps the bounds."""
    constants = record[0]
    if not all_finite(tool):  # hold still
        weight = tool_state(arm[0], q)[3]
        return command(constants, q, np.zeros(7), weight, np.inf), True
    J, V, v_nominal, low, high, weight = problem(constants, arm[0], q, tool, time)
    v = free_velocity(J, V, v_nominal)
    for i in range(7):
        if not low[i] <= v[i] <= high[i]:
            return np.zeros(22), False
    return command(constants, q, v, weight, np.abs(product(J, v) - V).max()), True


class JointCommands(Block):
    """Follows the commanded tool pose with the arm's seven joints.

    The posture is integrated in the state; its own forward kinematics closes the
    loop, so nothing drifts. The instrument's weight is fed forward.

    Port ``tool`` accepts p_WP [m], u_W, v_WP [m/s], du_W/dt [1/s] and the time
    [s] they hold at (13).

    Port ``set_point`` emits the desired state that the arm's servos take (14).

    Port ``posture`` emits the commanded joint positions (7) [rad].

    Port ``status`` emits 0, or 1 while joint limits keep the arm from following (1).
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
        self._params = params or JointCommandsParams()
        self._params.check()
        plant = make_controller_plant(instrument=instrument)
        self._arm = read_arm(plant, plant.GetFrameByName(INSTRUMENT_TIP))
        set_point = SetPoint(arm, self._params.period)
        nominal = np.array(posture, float)
        margin = self._params.joint_margin
        self._constants = packed(
            self._params,
            nominal=nominal,
            low=plant.GetPositionLowerLimits() + margin,
            high=plant.GetPositionUpperLimits() - margin,
            speed=self._params.joint_speed * plant.GetVelocityUpperLimits(),
            lead=set_point.lead,
            compliance=set_point.compliance,
        )
        p, u, _, weight = tool_state(self._arm[0], nominal)
        self._tool = self.vector_in("tool", [*p, *u, *[0.0] * 6, 0.0])
        still = command(self._constants[0], nominal, np.zeros(7), weight, 0.0)
        self._posture = self.state_out("posture", nominal)
        self.state_out("set_point", still[7:21])
        self.state_out("status", [0.0])
        self.update_every(self._params.period, self._update)

    def _update(self, context: Any) -> tuple[np.ndarray, ...]:
        q = context.get_discrete_state(self._posture).value()
        tool = self._tool.Eval(context)
        time = context.get_time()
        state, is_free = _free_step(self._constants, self._arm, q, tool, time)
        if not is_free:
            constants, arm = self._constants[0], self._arm[0]
            J, V, *bounds, weight = problem(constants, arm, q, tool, time)
            v = joint_velocity(J, V, *bounds)
            state = command(constants, q, v, weight, abs(J @ v - V).max())
        return state[:7], state[7:21], state[21:]
