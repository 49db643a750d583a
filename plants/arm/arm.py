"""The PA-10-7C arm: published figures, servo gains and its set-points.

Lengths, limits, speeds, torques, masses, motor inertias and friction stand in
`pa10.urdf` beside this file, which also says how the published inertias are read.
The joint servos are Drake's PD actuators, so that they are part of the continuous
dynamics.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.tree import ModelInstanceIndex, PdControllerGains

from plants.arm.parameters import BASE_POSITION, FRICTION, JOINTS
from plants.common.models import add_model
from systems.common.parameter import check, parameter


@dataclass
class ArmParams:
    """Servo gains of the arm.

    With friction the defaults have one time constant, 11 ms, at every joint: a shaft
    that turns about the trocar moves the proximal joints far more than its tip, and
    what they lag then cancels in the wrist. In the postures that the trocar allows,
    every joint has at least 14 Hz of bandwidth and every mode a damping ratio over
    0.55.
    """

    kp: list[float] = parameter(
        [1e5, 1e5, 4e4, 4e4, 3e3, 3e3, 1e3],
        "stiffness of each joint",
        "N m/rad",
        above=0,
        most=1e6,
        shape=(JOINTS,),
    )
    kd: list[float] = parameter(
        [1090.0, 1090.0, 435.0, 435.0, 31.0, 31.0, 9.0],
        "damping of each joint, on top of its friction",
        "N m s/rad",
        above=0,
        most=1e5,
        shape=(JOINTS,),
    )


def add_arm(
    plant: Any,
    X_PB: RigidTransform | None = None,
    parent: Any = None,
    params: ArmParams | None = None,
) -> ModelInstanceIndex:
    """Adds the arm to a plant, its base welded to a frame.

    The plant's frame `flange` (of the returned instance) is the tool mount, its z
    axis pointing out of the arm. Gravity is switched off for the arm: its own
    controller carries its weight, and not the weight of what hangs on it.

    Args:
        plant: A MultibodyPlant that is not yet finalized.
        X_PB: Pose of the base B (z up its first axis) in the parent frame P; the
            default stands at `BASE_POSITION`.
        parent: A frame of the plant; the world if None.
        params: Servo gains.

    Returns:
        The arm's model instance.

    Raises:
        ValueError: If a gain is not positive.
    """
    params = params or ArmParams()
    check(params)
    instance = add_model(plant, Path(__file__).parent, "pa10.urdf")
    plant.WeldFrames(
        parent or plant.world_frame(),
        plant.GetFrameByName("base", instance),
        X_PB or RigidTransform(BASE_POSITION),
    )
    plant.set_gravity_enabled(instance, False)
    for i, (kp, kd) in enumerate(zip(params.kp, params.kd, strict=True), start=1):
        actuator = plant.GetJointActuatorByName(f"joint{i}", instance)
        actuator.set_controller_gains(PdControllerGains(p=kp, d=kd))
    return instance


class SetPoint:
    """Turns a desired motion into the desired state that Drake's servos take.

    A PD servo with viscous friction b follows q_d, v_d without lag if it is given
    the torque (kd + b) v_d on top of its position term. Drake 1.58's CENIC applies
    the desired velocity with the wrong sign, so the whole term goes through the
    position and the desired velocity stays zero, which is exact for every
    integrator:

        q_sent = q_d + (kd + b) / kp v_d + tau / kp,   v_sent = 0.

    A set-point that is held for a period is meant for the hold's end: CENIC, at an
    accuracy of 1e-3, steps from one control instant to the next, and its implicit
    step arrives where the set-point says. (An integrator with many steps to a hold
    arrives in its middle, and then runs up to half a period ahead.)

    Attributes:
        lead: Of the sent position per desired velocity in s (7).
        compliance: Of the sent position per torque in rad/Nm (7).
    """

    def __init__(self, params: ArmParams | None = None, period: float = 0.0) -> None:
        """Prepares the constants.

        Args:
            params: Servo gains.
            period: How long each set-point is held, in s; 0 if it is continuous.

        Raises:
            ValueError: If a gain is not positive or the period is negative.
        """
        params = params or ArmParams()
        check(params)
        if not period >= 0.0:
            raise ValueError(f"SetPoint: period={period} s must be >= 0")
        kp = np.array(params.kp)
        self.lead = (np.array(params.kd) + FRICTION) / kp + period
        self.compliance = 1.0 / kp

    def __call__(
        self,
        q_d: Any,
        v_d: Any,
        tau: Any = None,
    ) -> np.ndarray:
        """Returns the desired state for the arm's port (14).

        Args:
            q_d: Desired joint positions at this instant, in rad (7).
            v_d: Desired joint velocities in rad/s (7).
            tau: Torque to feed forward in Nm (7), for example what carries the
                instrument's weight; None for none.
        """
        sent = np.zeros(2 * JOINTS)
        sent[:JOINTS] = q_d + self.lead * v_d
        if tau is not None:
            sent[:JOINTS] += self.compliance * tau
        return sent


def servo_step(
    plant: Any, posture: Any, params: ArmParams | None, period: float
) -> tuple[np.ndarray, np.ndarray]:
    """What is left of a lag after a period for which a `SetPoint` is held.

    Joints that lag e = q - q_d behind a command that goes on by d will lag

        A e + C (v period - d),   B = M / period + kd + b + kp period,
        C = B^-1 M / period,      A = 1 - period B^-1 kp,

    at its end: the implicit step that CENIC takes from one set-point to the next.

    Args:
        plant: A controller's plant.
        posture: At which the mass matrix is taken, in rad (7).
        params: Servo gains.
        period: In s.

    Returns:
        A and C, (7, 7).
    """
    params, context = params or ArmParams(), plant.CreateDefaultContext()
    plant.SetPositions(context, np.array(posture, float))
    inertia, kp = plant.CalcMassMatrix(context) / period, np.diag(params.kp)
    damping = np.diag(np.array(params.kd) + FRICTION) + period * kp
    C = np.linalg.solve(inertia + damping, inertia)
    A = np.eye(JOINTS) - period * np.linalg.solve(inertia + damping, kp)
    return A, C
