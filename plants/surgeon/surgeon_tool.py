"""Surgeon's tool: a straight shaft that the surgeon moves through its fulcrum.

Section 2.1 of the paper (Figure 1): the target tool S and the obstacle tool O enter
through their fulcrums G_S and G_O, and the surgeon moves them as he or she likes.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from plants.surgeon.recording import load_recording
from plants.surgeon.synthetic_hand import SyntheticHand, synthetic_motion
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
from systems.common.geometry import plus, sub, unit
from systems.common.parameter import Rules, check, parameter, part
from systems.common.signal import Vector, vector, writer
from systems.common.signals import Shaft, Velocity

write_shaft = writer(Shaft)
_LEAST_DEPTH = 0.005  # m, of a tip below its fulcrum
_LONGEST = 60.0  # s, of a synthetic hand that is not told how long it is needed


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
    hand: SyntheticHand = part(SyntheticHand)
    # The patient's breath is the wall's (`wall_motion`), and may come later here.
    breathing: list[float] = parameter(
        [0.0, 0.0, 0.0],
        "what a breath does to its trocar",
        "m",
        least=-0.03,
        most=0.03,
        shape=(3,),
    )
    carried: list[float] = parameter(
        [0.0, 0.0, 0.0],
        "what it does to the tip, with the tissue it holds",
        "m",
        least=-0.03,
        most=0.03,
        shape=(3,),
    )
    lag: float = parameter(
        0.0, "of both behind the wall, in breaths", least=-1.0, most=1.0
    )

    def rules(self) -> Rules:
        """What must hold across fields."""
        paired = len(self.times) == len(self.points) > 0
        one_each = f"one for each of the {len(self.points)} points, and at least one"
        yield paired, "times", one_each
        pairs = zip(self.times, self.times[1:], strict=False)
        yield all(a < b for a, b in pairs), "times", "increasing numbers"
        alone = not (self.hand.seed and self.recording)
        yield alone, "hand.seed", "0 together with a recording"

    @property
    def breathes(self) -> bool:
        """Whether a breath moves trocar or tip."""
        return any((*self.breathing, *self.carried))


@dataclass(frozen=True)
class Patient:
    """What the patient does to the tools.

    Attributes:
        excursion: The breath in [-1, 1] at a time in s, so many breaths late.
        duration: How long it is needed, in s.
    """

    excursion: Callable[[float, float], float]
    duration: float

    def moved(self, amplitude: Sequence[float], lag: float) -> Motion:
        """What moves with the breath, as far as `amplitude` (3) [m]."""
        times = np.arange(0.0, self.duration + 1.0, 1.0 / 60.0)
        breath = np.array([self.excursion(time, lag) for time in times.tolist()])
        return recorded_motion(times, breath[:, None] * np.asarray(amplitude))


def tip_motion(params: SurgeonToolParams, patient: Patient | None = None) -> Motion:
    """The tip's motion p_WP(t), v_WP(t): all parts together.

    Args:
        params: How the tool moves.
        patient: Who breathes; nobody if None.

    Raises:
        ValueError: If a parameter makes no sense, the recording cannot be used, or
            the tip would come to its fulcrum or above it.
    """
    check(params)
    times, points = params.times, params.points
    if params.hand.seed:
        span = patient.duration + 1.0 if patient else _LONGEST
        start = np.array(points[0])
        recorded, path = synthetic_motion(
            params.hand, np.array(params.p_WG), start, span
        )
        base = recorded_motion(recorded, path)
        key_times = recorded.tolist()
    elif not params.recording:
        base = waypoint_motion(times, points)
        key_times = list(times)
    else:
        recorded, path = load_recording(params.recording)
        base = recorded_motion(recorded, path)
        key_times = recorded.tolist()
    motions = [base, *map(push_motion, params.pushes)]
    if params.tremor_rms > 0.0:
        motions.append(tremor_motion(params.tremor_rms, params.tremor_seed))
    if patient and any(params.carried):
        motions.append(patient.moved(params.carried, params.lag))
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
    motion. The patient's breath may move its trocar, and the tip with the tissue.

    Port ``shaft`` emits the tool's true `Shaft`.
    Port ``tip_velocity`` emits the tip's true `Velocity`, for the log.
    """

    def __init__(
        self, params: SurgeonToolParams | None = None, patient: Patient | None = None
    ) -> None:
        """Makes the block.

        Args:
            params: How the tool moves; waypoints, or a recording, tremor, pushes.
            patient: Who breathes; nobody if None.

        Raises:
            ValueError: If `params` make no sense, see `tip_motion`.
        """
        super().__init__()
        params = params or SurgeonToolParams()
        self._motion = tip_motion(params, patient)
        self._p_WG = vector(params.p_WG)
        self._trocar: Motion | None = None
        if patient and any(params.breathing):
            self._trocar = patient.moved(params.breathing, params.lag)
        time = {self.time_ticket()}
        self.signal_out("shaft", Shaft, self._calc_shaft, time)
        self.signal_out("tip_velocity", Velocity, self._calc_velocity, time)

    def _calc_shaft(self, context: Any) -> np.ndarray:
        motion, p_WG, time = self._motion, self._p_WG, context.get_time()
        if self._trocar:
            p_WG = plus(p_WG, self._trocar(time)[:3])
        return _shaft(motion.knots, motion.pieces, motion.waves, p_WG, time)

    def _calc_velocity(self, context: Any) -> np.ndarray:
        return np.array(self._motion(context.get_time())[3:])
