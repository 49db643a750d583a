"""O as the robot sees it: through the optical tracker and the trajectory estimator."""

from collections.abc import Callable

import numpy as np

from systems.common.geometry import sub, unit
from systems.common.signal import vector
from systems.common.signals import Estimate, Shaft, TrackedShaft
from systems.sensing import optical_tracker, trajectory_estimator
from systems.sensing.optical_tracker import MarkerBody, MarkerNoise
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
    markers = optical_tracker.constants(MarkerBody())[0]
    params = TrajectoryEstimatorParams(wall_height=wall_height)
    record = trajectory_estimator.constants(params)[0]
    state = trajectory_estimator.initial(params)
    frames: list[TrackedShaft] = []

    def sense(time: float, exact: Estimate) -> Estimate:
        nonlocal state
        shaft = Shaft(exact.p, unit(sub(exact.p, exact.fulcrum)))
        place, turn = rng.standard_normal((2, 3))
        noise = MarkerNoise(vector(place), vector(turn))
        seen = optical_tracker.disturb(markers, shaft, noise)
        frames.append(TrackedShaft(seen.tip, seen.u, time, 1.0))
        if len(frames) > 1:
            state = trajectory_estimator.absorb(record, state, frames.pop(0))
        return trajectory_estimator.predict(record, state, time)

    return sense
