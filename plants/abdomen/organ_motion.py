"""How an organ moves: with the breath of the wall, or as it was recorded.

A point of an abdominal organ moves along its own line, in phase with the wall or
behind it; liver and kidneys move 5 to 25 mm from head to foot. It does not turn.
"""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial, StackedTrajectory

from plants.abdomen.wall_motion import WallMotionParams
from plants.surgeon.recording import load_recording
from systems.common.parameter import check, parameter

_KNOT = 1.0 / 120.0  # [s]


@dataclass
class OrganMotionParams:
    """Motion of the organ; vectors in W."""

    breathing: list[float] = parameter(
        [0.0, 0.0, 0.0], "its amplitude", "m", least=-0.03, most=0.03, shape=(3,)
    )
    lag: float = parameter(
        0.0, "behind the wall, in breaths; 0.5 is antiphase", least=-1.0, most=1.0
    )
    cough: list[float] = parameter(
        [0.0, 0.0, 0.0],
        "how far one throws it",
        "m",
        least=-0.03,
        most=0.03,
        shape=(3,),
    )
    recording: str = parameter(
        "", "of its displacement, t,x,y,z, again and again; none if empty", file=True
    )

    def displacement(self, time: float, wall: WallMotionParams) -> np.ndarray:
        """From its place at rest, in m (3)."""
        thrown = wall.irregular.coughing(time) * np.array(self.cough)
        if self.recording:
            return thrown + _recorded(self.recording, time)
        breath: np.ndarray = wall.excursion(time, self.lag) * np.array(self.breathing)
        return thrown + breath


_load = lru_cache(maxsize=4)(load_recording)


def _recorded(path: str, time: float) -> np.ndarray:
    """A recording's displacement from its mean, played again and again."""
    times, points = _load(path)
    at = time % times[-1]
    return np.array([np.interp(at, times, axis - axis.mean()) for axis in points.T])


class OrganCourse:
    """Where a point of the organ is over time.

    Attributes:
        trajectory: Its place in m (3) over the time in s.
    """

    def __init__(
        self,
        params: OrganMotionParams,
        wall: WallMotionParams,
        p_W: Any,
        duration: float,
    ) -> None:
        """Computes it, p_W its place at rest, in m (3).

        Raises:
            ValueError: If a parameter or the recording makes no sense.
        """
        self._params, self._p_W = check(params), np.asarray(p_W)
        self._times = np.arange(0.0, duration + 1.0, _KNOT)
        self._rows = np.zeros((len(self._times), 3))
        self.change(wall, 0.0, duration + 1.0)

    def change(self, wall: WallMotionParams, start: float, end: float) -> None:
        """Computes it anew from a time to another, in s: the breath is another."""
        first, last = np.searchsorted(self._times, [start, end])
        times = self._times[first:last].tolist()
        self._rows[first:last] = [self._params.displacement(t, wall) for t in times]
        slopes: Any = np.gradient(self._rows, self._times, axis=0)
        self.trajectory = PiecewisePolynomial.CubicHermite(
            self._times, (self._p_W + self._rows).T, slopes.T
        )


def organ_trajectory(
    params: OrganMotionParams, wall: WallMotionParams, p_W: Any, duration: float
) -> PiecewisePolynomial:
    """The trajectory of an `OrganCourse`."""
    return OrganCourse(params, wall, p_W, duration).trajectory


def with_axis(motion: PiecewisePolynomial, u: Any) -> StackedTrajectory:
    """A trajectory of a point with an axis that stays, as a `Shaft` has them."""
    ends = [motion.start_time(), motion.end_time()]
    shaft = StackedTrajectory()
    shaft.Append(motion.Clone())
    shaft.Append(PiecewisePolynomial.ZeroOrderHold(ends, np.tile(u, (2, 1)).T))
    return shaft


def add_organ_motion(builder: Any, motion: PiecewisePolynomial, u: Any) -> Any:
    """Adds what moves an organ's point.

    Args:
        builder: The diagram's builder.
        motion: Of `organ_trajectory`.
        u: An axis fixed to the organ, (3).

    Returns:
        The sources `organ_motion`, whose port emits a `MovingPoint`, p_WE and v_WE,
        and `organ_shaft`, which emits point and axis as a `Shaft`, for a tracker.
    """
    source = builder.AddNamedSystem("organ_motion", TrajectorySource(motion, 1))
    shaft = TrajectorySource(with_axis(motion, u))
    return source, builder.AddNamedSystem("organ_shaft", shaft)
