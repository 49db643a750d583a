"""O as the robot sees it: through the optical tracker and the trajectory estimator."""

from collections.abc import Callable

import numpy as np

from systems.common.geometry import sub, unit
from systems.common.signals import Estimate
from systems.sensing import trajectory_estimator
from systems.sensing.optical_tracker import OpticalTrackerParams, disturb
from systems.sensing.trajectory_estimator import TrajectoryEstimatorParams


def tracked(
    seed: int, number: int, wall_height: float
) -> Callable[[float, Estimate], Estimate]:
    """A tracker and an estimator with their defaults, for one scene.

    A frame is delivered a period after its exposure (latency 14.2 ms), with the noise
    of a Polaris; O's fulcrum is found from its shaft's lines.

    Args:
        seed: Of the noise.
        number: Of the scene.
        wall_height: Of the abdominal wall where O enters, m; known to within 10 mm.

    Returns:
        A function of the time and the exact estimate that gives the estimate.
    """
    rng = np.random.default_rng([seed, 13, number])
    body = OpticalTrackerParams().body
    params = TrajectoryEstimatorParams(wall_height=wall_height)
    record = trajectory_estimator.constants(params)[0]
    state = trajectory_estimator.initial(params)
    frames: list[np.ndarray] = []

    def sense(time: float, exact: Estimate) -> Estimate:
        nonlocal state
        p = exact.p
        shaft = p + unit(sub(p, exact.fulcrum))
        seen = disturb(
            shaft,
            rng.standard_normal(6),
            body.lever,
            body.sigma_position(),
            body.sigma_direction(),
        )
        frames.append(np.array(seen + (time, 1.0)))
        if len(frames) > 1:
            state = trajectory_estimator.absorb(record, state, frames.pop(0))
        return trajectory_estimator.predict(record, state, time)

    return sense
