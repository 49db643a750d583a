"""Surgeon's tool: a straight shaft that the surgeon moves through its fulcrum.

Section 2.1 of the paper (Figure 1): the target tool S and the obstacle tool O enter
through their fulcrums G_S and G_O, and the surgeon moves them as he or she likes.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
import math
from typing import Any

import numpy as np

from plants.surgeon.recording import load_recording
from plants.surgeon.tool_motion import (
    Motion,
    Push,
    evaluate,
    push_motion,
    recorded_motion,
    total,
    tremor_motion,
    waypoint_motion,
)
from systems.common.block import Block
from systems.common.compiled import compiled
from systems.common.geometry import Vector, sub, unit

_LEAST_DEPTH = 0.005  # m, of a tip below its fulcrum


@dataclass
class SurgeonToolParams:
    """How one of the surgeon's tools moves. Frame W, z up, SI units."""

    # The fulcrum G, in m.
    p_WG: list[float] = field(default_factory=lambda: [0.08, 0.0, 0.0])
    # Waypoints of the tip: times in s, and points in m. Minimum jerk from each to
    # the next, at rest at each of them, held before the first and after the last.
    times: list[float] = field(default_factory=lambda: [0.0])
    points: list[list[float]] = field(default_factory=lambda: [[0.05, 0.0, -0.12]])
    # A recording (CSV `t,x,y,z`) takes the waypoints' place if its path is given.
    recording: str | None = None
    # Tremor, 8 to 12 Hz: root mean square in three dimensions, in m. A surgeon's
    # is 50e-6 to 200e-6.
    tremor_rms: float = 0.0
    # Chooses the phases and frequencies of the tremor.
    tremor_seed: int = 0
    # Pushes on top of the motion.
    pushes: list[Push] = field(default_factory=list)

    def check(self) -> None:
        """Raises ValueError if a value makes no sense."""
        _check_vector("p_WG", self.p_WG)
        if len(self.times) != len(self.points) or not self.times:
            raise ValueError(
                f"surgeon's tool: {len(self.times)} times for {len(self.points)} "
                f"points; expected one time for every point, and at least one"
            )
        for time, after in zip(self.times, self.times[1:], strict=False):
            if not time < after:
                raise ValueError(
                    f"surgeon's tool: times={self.times} must increase, "
                    f"{after} s follows {time} s"
                )
        if not all(map(math.isfinite, self.times)):
            raise ValueError(f"surgeon's tool: times={self.times} must be finite")
        for point in self.points:
            _check_vector("points", point)
        if not 0.0 <= self.tremor_rms <= 0.002:
            raise ValueError(
                f"surgeon's tool: tremor_rms={self.tremor_rms} m must lie in "
                f"[0, 0.002]; a surgeon's is 50e-6 to 200e-6"
            )
        if self.tremor_seed < 0:
            raise ValueError(
                f"surgeon's tool: tremor_seed={self.tremor_seed} must be >= 0"
            )
        for push in self.pushes:
            push.check()


def _check_vector(name: str, value: Sequence[float]) -> None:
    if len(value) != 3 or not all(map(math.isfinite, value)):
        raise ValueError(
            f"surgeon's tool: {name}={list(value)} must be 3 finite numbers"
        )


def tip_motion(params: SurgeonToolParams) -> Motion:
    """The tip's motion p_WP(t), v_WP(t): all parts together.

    Raises:
        ValueError: If a parameter makes no sense, the recording cannot be used, or
            the tip would come to its fulcrum or above it.
    """
    params.check()
    times, points = params.times, params.points
    if not params.recording:
        base = waypoint_motion(times, points)
        key_times = list(times)
    else:
        recorded, path = load_recording(params.recording)
        base = recorded_motion(recorded, path)
        key_times = recorded.tolist()
    motions = [base, *map(push_motion, params.pushes)]
    if params.tremor_rms > 0.0:
        motions.append(tremor_motion(params.tremor_rms, params.tremor_seed))
    motion = total(motions)

    # The tip is highest at a waypoint, at a sample, or while a push is held.
    for push in params.pushes:
        key_times += [push.start + push.span(), push.start + push.span() + push.hold]
    ceiling = params.p_WG[2] - _LEAST_DEPTH
    for t in key_times:
        z = motion(float(t))[2]
        if z > ceiling:
            source = params.recording or "its waypoints and pushes"
            raise ValueError(
                f"surgeon's tool: at t={t:.3f} s {source} put the tip at z={z:.4f} m, "
                f"at or above its fulcrum (z={params.p_WG[2]:.4f} m); the highest "
                f"valid z is {ceiling:.4f} m"
            )
    return motion


@compiled
def _shaft(
    knots: np.ndarray, pieces: np.ndarray, waves: np.ndarray, p_WG: Vector, t: float
) -> np.ndarray:
    x, y, z, _, _, _ = evaluate(knots, pieces, waves, t)
    p = (x, y, z)
    return np.array(p + unit(sub(p, p_WG)))


class SurgeonTool(Block):
    """A tool in the surgeon's hand, always through its fulcrum (section 2.1).

    A pure function of time: it has no state, and the same parameters give the same
    motion. Port ``shaft`` emits the tool's true shaft (6): tip p_WP in m and unit
    vector u_W along the shaft, from outside towards the tip, both in the world frame
    W. Port ``tip_velocity`` emits the tip's true velocity v_WP (3) in m/s in W, for
    the log.

    Args:
        params: How the tool moves; waypoints, or a recording, tremor, pushes.

    Raises:
        ValueError: If `params` make no sense, see `tip_motion`.
    """

    def __init__(self, params: SurgeonToolParams | None = None) -> None:
        super().__init__()
        params = params or SurgeonToolParams()
        self._motion = tip_motion(params)
        x, y, z = params.p_WG
        self._p_WG = (float(x), float(y), float(z))
        time = {self.time_ticket()}
        self.vector_out("shaft", 6, self._calc_shaft, time)
        self.vector_out("tip_velocity", 3, self._calc_velocity, time)

    def _calc_shaft(self, context: Any) -> np.ndarray:
        motion = self._motion
        return _shaft(
            motion.knots, motion.pieces, motion.waves, self._p_WG, context.get_time()
        )

    def _calc_velocity(self, context: Any) -> np.ndarray:
        return np.array(self._motion(context.get_time())[3:])
