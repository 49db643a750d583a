"""Surgeon's tool: a straight shaft that the surgeon moves through its fulcrum.

Section 2.1 of the paper (Figure 1): the target tool S and the obstacle tool O enter
through their fulcrums G_S and G_O, and the surgeon moves them as he or she likes.
"""

from dataclasses import dataclass
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
from systems.common.geometry import sub, unit
from systems.common.parameter import Rules, check, parameter
from systems.common.signal import Vector, vector, writer
from systems.common.signals import Shaft, Velocity

write_shaft = writer(Shaft)
_LEAST_DEPTH = 0.005  # m, of a tip below its fulcrum


@dataclass
class SurgeonToolParams:
    """How one of the surgeon's tools moves. Frame W, z up, SI units."""

    p_WG: list[float] = parameter(
        [0.08, 0.0, 0.0], "its fulcrum in W", "m", least=-1, most=1, shape=(3,)
    )
    # Waypoints of the tip. Minimum jerk from each to the next, at rest at each of
    # them, held before the first and after the last.
    times: list[float] = parameter(
        [0.0], "of the waypoints", "s", least=0, most=1e4, shape=(-1,)
    )
    points: list[list[float]] = parameter(
        [[0.05, 0.0, -0.12]], "of the tip in W", "m", least=-1, most=1, shape=(-1, 3)
    )
    recording: str | None = parameter(
        None, "CSV `t,x,y,z` that takes the waypoints' place", file=True
    )
    # 8 to 12 Hz; a surgeon's is 50e-6 to 200e-6.
    tremor_rms: float = parameter(
        0.0, "tremor, rms in three dimensions", "m", least=0, most=0.002
    )
    tremor_seed: int = parameter(0, "of the tremor", least=0, most=2**63)
    pushes: list[Push] = parameter([], "on top of the motion", shape=(-1,))

    def rules(self) -> Rules:
        """What must hold across fields."""
        paired = len(self.times) == len(self.points) > 0
        one_each = f"one for each of the {len(self.points)} points, and at least one"
        yield paired, "times", one_each
        pairs = zip(self.times, self.times[1:], strict=False)
        yield all(a < b for a, b in pairs), "times", "increasing numbers"


def tip_motion(params: SurgeonToolParams) -> Motion:
    """The tip's motion p_WP(t), v_WP(t): all parts together.

    Raises:
        ValueError: If a parameter makes no sense, the recording cannot be used, or
            the tip would come to its fulcrum or above it.
    """
    check(params)
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
    return write_shaft(Shaft(p, unit(sub(p, p_WG))))


class SurgeonTool(Block):
    """A tool in the surgeon's hand, always through its fulcrum (section 2.1).

    A pure function of time: it has no state, and the same parameters give the same
    motion.

    Port ``shaft`` emits the tool's true `Shaft`.
    Port ``tip_velocity`` emits the tip's true `Velocity`, for the log.
    """

    def __init__(self, params: SurgeonToolParams | None = None) -> None:
        """Makes the block.

        Args:
            params: How the tool moves; waypoints, or a recording, tremor, pushes.

        Raises:
            ValueError: If `params` make no sense, see `tip_motion`.
        """
        super().__init__()
        params = params or SurgeonToolParams()
        self._motion = tip_motion(params)
        self._p_WG = vector(params.p_WG)
        time = {self.time_ticket()}
        self.signal_out("shaft", Shaft, self._calc_shaft, time)
        self.signal_out("tip_velocity", Velocity, self._calc_velocity, time)

    def _calc_shaft(self, context: Any) -> np.ndarray:
        motion = self._motion
        return _shaft(
            motion.knots, motion.pieces, motion.waves, self._p_WG, context.get_time()
        )

    def _calc_velocity(self, context: Any) -> np.ndarray:
        return np.array(self._motion(context.get_time())[3:])
