"""Joint commands: the arm's set-points that carry the tool along.

Differential inverse kinematics as a quadratic program within joint positions and
speeds: Drake's Jacobian, quadprog's exact solver. (Drake's own
DoDifferentialInverseKinematics gives the same velocities and takes three times as
long; the tests hold the two against each other.)
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.tree import JacobianWrtVariable
from pydrake.systems.framework import ValueProducer
import quadprog

from plants.arm.arm import ArmParams, SetPoint
from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.parameters import READY_POSTURE
from plants.instruments.instrument import InstrumentParams
from systems.common.block import Block


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


def tool_twist(
    p_WT: Sequence[float],
    u_WT: Sequence[float],
    tool: Sequence[float],
    now: float,
    period: float,
    gain: float,
) -> list[float]:
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
    v = [
        tool[6 + i] + rate * (tool[i] + tool[6 + i] * ahead - p_WT[i]) for i in range(3)
    ]
    ux, uy, uz = (tool[3 + i] + tool[9 + i] * ahead for i in range(3))
    dx, dy, dz = (
        tool[9 + i] + rate * (tool[3 + i] + tool[9 + i] * ahead - u_WT[i])
        for i in range(3)
    )
    w = [uy * dz - uz * dy, uz * dx - ux * dz, ux * dy - uy * dx]
    return w + v


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
        self._set_point = SetPoint(arm, self._params.period)
        self._plant = make_controller_plant(instrument=instrument)
        self._world = self._plant.world_frame()
        self._tip = self._plant.GetFrameByName(INSTRUMENT_TIP)
        self._nominal = np.array(posture, float)
        margin = self._params.joint_margin
        self._low = self._plant.GetPositionLowerLimits() + margin
        self._high = self._plant.GetPositionUpperLimits() - margin
        self._speed = self._params.joint_speed * self._plant.GetVelocityUpperLimits()
        plant_context = self._plant.CreateDefaultContext()
        self._plant.SetPositions(plant_context, self._nominal)
        X_WT = self._tip.CalcPoseInWorld(plant_context)
        p = X_WT.translation()
        u = X_WT.rotation().col(2)
        self._tool = self.vector_in("tool", [*p, *u, *[0.0] * 6, 0.0])
        weight = self._plant.CalcGravityGeneralizedForces(plant_context)
        still = self._set_point(self._nominal, np.zeros(7), -weight)
        self._posture = self.state_out("posture", self._nominal)
        self.state_out("set_point", still)
        self.state_out("status", [0.0])
        # The plant's context is a cache entry: no state hides in this block.
        self._kinematics = self.DeclareCacheEntry(
            "kinematics",
            ValueProducer(
                allocate=lambda: Value(self._plant.CreateDefaultContext()),
                calc=self._calc_kinematics,
            ),
            {self.discrete_state_ticket(self._posture)},
        )
        self.update_every(self._params.period, self._update)

    def _calc_kinematics(self, context: Any, value: Any) -> None:
        posture = context.get_discrete_state(self._posture).value()
        self._plant.SetPositions(value.get_mutable_value(), posture)

    def _update(self, context: Any) -> list[Any]:
        params = self._params
        q = context.get_discrete_state(self._posture).value()
        plant_context = self._kinematics.Eval(context)
        weight = self._plant.CalcGravityGeneralizedForces(plant_context)
        tool = self._tool.Eval(context).tolist()
        if not math.isfinite(sum(tool)):  # hold still
            return [q, self._set_point(q, np.zeros(7), -weight), [1.0]]
        X_WT = self._tip.CalcPoseInWorld(plant_context)
        V_WT = tool_twist(
            X_WT.translation().tolist(),
            X_WT.rotation().col(2).tolist(),
            tool,
            context.get_time(),
            params.period,
            params.gain,
        )
        J = self._plant.CalcJacobianSpatialVelocity(
            plant_context,
            JacobianWrtVariable.kV,
            self._tip,
            np.zeros(3),
            self._world,
            self._world,
        )
        v = joint_velocity(
            J,
            np.array(V_WT),
            params.centering * (self._nominal - q),
            np.maximum(-self._speed, (self._low - q) / params.period),
            np.minimum(self._speed, (self._high - q) / params.period),
        )
        short = float(abs(J @ v - V_WT).max() > params.shortfall)
        set_point = self._set_point(q, v, -weight)
        return [q + params.period * v, set_point, [short]]
