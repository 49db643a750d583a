"""Joint commands: the arm's set-points that carry the tool along.

Differential inverse kinematics is Drake's own (a quadratic program within joint
positions and speeds); this block clocks it and keeps the commanded posture.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.inverse_kinematics import (
    DifferentialInverseKinematicsParameters,
    DifferentialInverseKinematicsStatus,
    DoDifferentialInverseKinematics,
)
from pydrake.systems.framework import ValueProducer

from plants.arm.arm import ArmParams, SetPoint
from plants.arm.controller_plant import INSTRUMENT_TIP, make_controller_plant
from plants.arm.parameters import READY_POSTURE
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
    """

    period: float = 1.0 / 120.0
    gain: float = 0.3
    centering: float = 0.2
    joint_speed: float = 0.8
    joint_margin: float = 0.03

    def check(self) -> None:
        """Raises ValueError for a value that makes no sense."""
        if not self.period > 0.0:
            raise ValueError(f"joint_commands.period={self.period} s: expected > 0")
        for name in ("gain", "joint_speed"):
            value = getattr(self, name)
            if not 0.0 < value <= 1.0:
                raise ValueError(f"joint_commands.{name}={value}: expected in (0, 1]")
        for name in ("centering", "joint_margin"):
            value = getattr(self, name)
            if value < 0.0:
                raise ValueError(f"joint_commands.{name}={value}: expected >= 0")


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
    ) -> None:
        """Makes the block for an arm's servos, starting at a posture (7) [rad]."""
        super().__init__()
        self._params = params or JointCommandsParams()
        self._params.check()
        self._set_point = SetPoint(arm, self._params.period)
        self._plant = make_controller_plant()
        self._tip = self._plant.GetFrameByName(INSTRUMENT_TIP)
        self._limits = self._make_limits(np.asarray(posture, float))
        plant_context = self._plant.CreateDefaultContext()
        self._plant.SetPositions(plant_context, np.asarray(posture, float))
        X_WT = self._tip.CalcPoseInWorld(plant_context)
        p = X_WT.translation()
        u = X_WT.rotation().col(2)
        self._tool = self.vector_in("tool", [*p, *u, *[0.0] * 6, 0.0])
        self._kinematics = self.DeclareCacheEntry(
            "kinematics",
            ValueProducer(
                allocate=lambda: Value(self._plant.CreateDefaultContext()),
                calc=self._calc_kinematics,
            ),
            {self.xd_ticket()},
        )
        self._state = self.DeclareDiscreteState([*posture, *[0.0] * 7, 0.0])
        ticket = {self.xd_ticket()}
        self.vector_out("set_point", 14, self._calc_set_point, ticket)
        self.vector_out("posture", 7, self._calc_posture, ticket)
        self.vector_out("status", 1, self._calc_status, ticket)
        self.update_every(self._params.period, self._update)

    def _make_limits(self, posture: np.ndarray) -> Any:
        limits = DifferentialInverseKinematicsParameters(7, 7)
        margin = self._params.joint_margin
        speed = self._params.joint_speed * self._plant.GetVelocityUpperLimits()
        limits.set_time_step(self._params.period)
        limits.set_joint_position_limits(
            (
                self._plant.GetPositionLowerLimits() + margin,
                self._plant.GetPositionUpperLimits() - margin,
            )
        )
        limits.set_joint_velocity_limits((-speed, speed))
        limits.set_nominal_joint_position(posture)
        limits.set_joint_centering_gain(self._params.centering * np.eye(7))
        return limits

    def _value(self, context: Any) -> np.ndarray:
        return context.get_discrete_state(self._state).value()

    def _calc_kinematics(self, context: Any, value: Any) -> None:
        self._plant.SetPositions(value.get_mutable_value(), self._value(context)[:7])

    def _calc_set_point(self, context: Any) -> Sequence[float]:
        value = self._value(context)
        q, v = value[:7], value[7:14]
        plant_context = self._kinematics.Eval(context)
        weight = self._plant.CalcGravityGeneralizedForces(plant_context)
        return self._set_point(q - self._params.period * v, v, -weight)

    def _calc_posture(self, context: Any) -> Sequence[float]:
        return self._value(context)[:7]

    def _calc_status(self, context: Any) -> Sequence[float]:
        return self._value(context)[14:]

    def _update(self, context: Any) -> Sequence[float]:
        period = self._params.period
        value = self._value(context)
        tool = self._tool.Eval(context).tolist()
        if not all(map(math.isfinite, tool)):  # hold still
            return [*value[:7], *[0.0] * 7, 1.0]
        plant_context = self._kinematics.Eval(context)
        X_WT = self._tip.CalcPoseInWorld(plant_context)
        # The posture in the state is where the arm is to be now.
        twist = tool_twist(
            X_WT.translation().tolist(),
            X_WT.rotation().col(2).tolist(),
            tool,
            context.get_time(),
            period,
            self._params.gain,
        )
        result = DoDifferentialInverseKinematics(
            self._plant, plant_context, np.array(twist), self._tip, self._limits
        )
        if result.status != DifferentialInverseKinematicsStatus.kSolutionFound:
            return [*value[:7], *[0.0] * 7, 1.0]
        v = result.joint_velocities
        return [*(value[:7] + period * v), *v, 0.0]
