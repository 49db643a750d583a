"""The arm and its instrument alone, as a controller knows them."""

from dataclasses import replace
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.plant import MultibodyPlant

from plants.arm.arm import add_arm
from plants.instruments.instrument import InstrumentParams, add_instrument

INSTRUMENT_TIP = "instrument_tip"
"""Name of the frame at the instrument's tip, z along the shaft and out of it."""


def make_controller_plant(
    X_WB: RigidTransform | None = None, instrument: InstrumentParams | None = None
) -> Any:
    """Makes a plant of seven positions for kinematics and gravity, without geometry.

    Its instrument does not bend.
    Gravity acts on the instrument alone, so that
    `-CalcGravityGeneralizedForces(context)` is the torque that carries it.

    Args:
        X_WB: Pose of the arm's base; its usual place if None.
        instrument: Dimensions and masses.

    Returns:
        A finalized MultibodyPlant.
    """
    # Discrete, for no one integrates it: a continuous plant would warn that some
    # integrators pass over joint limits.
    plant = MultibodyPlant(time_step=1e-3)
    arm = add_arm(plant, X_WB)
    rigid = replace(instrument or InstrumentParams(), bending_stiffness=0.0)
    add_instrument(plant, plant.GetFrameByName("flange", arm), rigid)
    plant.Finalize()
    return plant


def accelerations(plant: Any, q: np.ndarray) -> np.ndarray:
    """What each joint alone can do with its rated torque, the others at rest.

    Args:
        plant: Of `make_controller_plant`.
        q: Posture (7) [rad].

    Returns:
        In rad/s^2 (7).
    """
    context = plant.CreateDefaultContext()
    plant.SetPositions(context, q)
    inertia = plant.CalcMassMatrix(context)
    return np.array(plant.GetEffortUpperLimits() / np.diag(inertia))
