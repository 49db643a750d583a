"""The posture that reaches a point through the trocar, to start from.

From its place beside the patient the arm keeps its elbow up and its wrist above the
trocar, and reaches every tip within 35 deg of the vertical and 60 to 180 mm inside,
far from the joints' limits (sampled by the tests).
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from pydrake.multibody.inverse_kinematics import InverseKinematics
from pydrake.solvers import SnoptSolver, SolverOptions

from plants.arm.parameters import JOINTS, POSITION_LIMIT, READY_POSTURE


def home_posture(
    plant: Any,
    arm: Any,
    tip: Any,
    p_WG: Sequence[float],
    p_WP: Sequence[float],
    seed: Sequence[float] | None = None,
) -> np.ndarray:
    """Joint angles that put the tip at a point, the shaft through the fulcrum.

    Args:
        plant: A finalized MultibodyPlant with the arm and its instrument.
        arm: The arm's model instance.
        tip: The instrument's tip frame, z along the shaft.
        p_WG: Fulcrum in m (3).
        p_WP: Tip in m (3).
        seed: Posture to stay near to, in rad (7); the ready one if None.

    Returns:
        q (7) in rad, within the limits.

    Raises:
        ValueError: If the point is the fulcrum itself or is out of reach.
    """
    target, fulcrum = np.asarray(p_WP, float), np.asarray(p_WG, float)
    inserted = float(np.linalg.norm(target - fulcrum))
    if not inserted > 1e-3:
        raise ValueError(f"home_posture: tip {list(p_WP)} is at the fulcrum")
    u = (target - fulcrum) / inserted
    ik = InverseKinematics(plant, with_joint_limits=True)
    world = plant.world_frame()
    ik.AddPositionConstraint(tip, np.zeros(3), world, target, target)
    # A far point of the shaft's line: on the tip's z axis, behind the tip.
    behind = [np.array([0.0, 0.0, z]) for z in (-1.0, 0.0)]
    ik.AddPositionConstraint(world, target - 0.4 * u, tip, *behind)
    start = plant.GetJointByName("joint1", arm).position_start()
    q = ik.q()[start : start + JOINTS]
    near = np.asarray(READY_POSTURE if seed is None else seed, float)
    # The roll about the shaft is free: a light weight keeps it near zero.
    weight = np.diag([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.3])
    ik.prog().AddQuadraticErrorCost(weight, near, q)
    guess = np.zeros(plant.num_positions())
    guess[start : start + JOINTS] = near
    ik.prog().SetInitialGuess(ik.q(), guess)
    options = SolverOptions()
    options.SetOption(SnoptSolver.id(), "Major feasibility tolerance", 1e-9)
    result = SnoptSolver().Solve(ik.prog(), None, options)
    if not result.is_success():
        raise ValueError(
            f"home_posture: no posture puts the tip at {target.round(4).tolist()} "
            f"through a trocar at {fulcrum.round(4).tolist()}; "
            "tips 60 to 180 mm inside, within 35 deg of the vertical, are in reach"
        )
    return np.clip(result.GetSolution(q), -POSITION_LIMIT, POSITION_LIMIT)
