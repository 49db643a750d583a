"""How the wall moves: breathing, a sudden step, and insufflation.

The wall's body is placed by stiff servos; what they are told is a trajectory of
Drake's own, so no Python runs inside the integrator's step. Respiration at 0.2 Hz
with I:E 1:1.5 is usual under a ventilator; how far a trocar moves with it was not
found: sweep 2 to 10 mm.
"""

from dataclasses import dataclass
from math import cos, exp, pi, sin, sqrt
from typing import Any

import numpy as np
from pydrake.systems.primitives import TrajectorySource
from pydrake.trajectories import PiecewisePolynomial

from plants.abdomen.abdomen import Abdomen, AbdomenParams
from plants.abdomen.breath import Irregular
from plants.abdomen.breathing_curve import load_curve
from plants.common.actuation import hold_still
from systems.common.parameter import check, parameter, part

_INSPIRATION = 0.4  # share of a breath, I:E 1:1.5
_EXPIRATION = 0.05  # time constant of the passive expiration, share of a breath
_KNOT = 1.0 / 30.0  # [s]


WAVES = ("sine", "ventilator")


@dataclass
class WallMotionParams:
    """Motion of the wall at the fulcrum; vectors in W, all zero is a still wall."""

    # The wall moves by plus and minus this.
    breathing: list[float] = parameter(
        [0.0, 0.0, 0.0], "its amplitude", "m", least=-0.05, most=0.05, shape=(3,)
    )
    rate: float = parameter(
        0.2, "of the breathing; 0.15 to 0.35 is usual", "Hz", least=0.05, most=1
    )
    # The ventilator's is smooth in, sharp out.
    wave: str = parameter("sine", "of the breathing", choices=WAVES)
    curve: str = parameter(
        "",
        "recorded, CSV t,b within -1 and 1, again and again; a wave if empty",
        file=True,
    )
    phase: float = parameter(
        0.0, "of the breathing at the start, in breaths", least=-1, most=1
    )
    step: list[float] = parameter(
        [0.0, 0.0, 0.0], "sudden displacement", "m", least=-0.05, most=0.05, shape=(3,)
    )
    step_time: float = parameter(0.0, "when it steps", "s", least=0, most=1e4)
    # At once it is a load that no arm can go before; a patient who is moved takes time.
    step_duration: float = parameter(0.0, "of the step", "s", least=0, most=10)
    rise: list[float] = parameter(
        [0.0, 0.0, 0.0], "by an insufflation", "m", least=-0.05, most=0.05, shape=(3,)
    )
    rise_time: float = parameter(0.0, "when the rise begins", "s", least=0, most=1e4)
    rise_duration: float = parameter(5.0, "of the rise", "s", above=0, most=1e4)
    stiffening: float = parameter(
        0.0, "relative growth of the stiffness in the rise", least=-0.9, most=10
    )

    cough: list[float] = parameter(
        [0.0, 0.0, 0.0],
        "how far one throws it",
        "m",
        least=-0.03,
        most=0.03,
        shape=(3,),
    )
    irregular: Irregular = part(Irregular)

    @property
    def still(self) -> bool:
        """Whether the wall never moves."""
        coughs = self.cough if self.irregular.coughs else []
        return not any((*self.breathing, *self.step, *self.rise, *coughs))

    def excursion(self, time: float, lag: float = 0.0) -> float:
        """The patient's breath in [-1, 1], as it is `lag` breaths behind the wall's."""
        if self.curve:
            times, curve = load_curve(self.curve)
            return float(np.interp((time - lag / self.rate) % times[-1], times, curve))
        phase, depth = self.irregular.breath(time, self.rate)
        g = wave(self.wave, phase + self.phase - lag)
        # A deeper breath ends where all do.
        return depth * (g + 1.0) - 1.0 if self.irregular.disturbed else g

    def displacement(self, time: float) -> list[float]:
        """Where the wall is told to be, from its rest, in m (3)."""
        g = self.excursion(time)
        thrown = self.irregular.coughing(time)
        jump = share_done(time, self.step_time, self.step_duration)
        r = share_done(time, self.rise_time, self.rise_duration)
        return [
            b * g + s * jump + up * r + thrown * c
            for b, s, up, c in zip(
                self.breathing, self.step, self.rise, self.cough, strict=True
            )
        ]

    def stiffness_factor(self, time: float) -> float:
        """Trocar's stiffness against that of `AbdomenParams`."""
        return 1.0 + self.stiffening * share_done(
            time, self.rise_time, self.rise_duration
        )


def share_done(time: float, start: float, duration: float) -> float:
    """Share of a motion that is done at a time in s, smooth from 0 to 1."""
    if time < start or not duration:
        return float(time >= start)
    share = min((time - start) / duration, 1.0)
    return share * share * (3.0 - 2.0 * share)


def wave(kind: str, breaths: float) -> float:
    """The breathing wave in [-1, 1] at a phase in breaths; the sine starts at zero."""
    if kind == "sine":
        return sin(2.0 * pi * breaths)
    phase = breaths % 1.0
    if phase < _INSPIRATION:
        return -cos(pi * phase / _INSPIRATION)
    out = (phase - _INSPIRATION) / _EXPIRATION
    rest = (1.0 - _INSPIRATION) / _EXPIRATION
    left = (1.0 + rest) * exp(-rest)  # what is not yet out at the breath's end
    return 2.0 * ((1.0 + out) * exp(-out) - left * out / rest) - 1.0


class Course:
    """Where the wall's servos are told to be, over a time.

    Attributes:
        trajectory: Places and, all zero, speeds over time.
    """

    def __init__(
        self, motion: WallMotionParams, wall: AbdomenParams, duration: float
    ) -> None:
        """Computes it.

        Args:
            motion: The wall's motion.
            wall: Its mass and stiffness.
            duration: How long it is needed, in s.
        """
        times = np.arange(0.0, duration + 1.0, _KNOT)
        if any(motion.step) and not motion.step_duration:
            edge = motion.step_time
            times = np.sort(np.append(times, [edge - 1e-3, edge]))
            times = times[np.append(True, np.diff(times) > 1e-6)]
        # A PD servo that is sent positions alone lags by kd / kp: sent ahead by it.
        self._lead = 2.0 * sqrt(wall.wall_mass / wall.wall_stiffness)
        self._times = times
        self._samples, self._slopes = np.zeros((2, 6, len(times)))
        self.change(motion, 0.0, duration + 1.0)

    def change(self, motion: WallMotionParams, start: float, end: float) -> None:
        """Computes it anew from a time to another, in s: the motion is another."""
        first, last = np.searchsorted(self._times, [start, end])
        small = 1e-4
        for i in range(first, last):
            time = float(self._times[i])
            before, at, after = (
                np.array(motion.displacement(time + d)) for d in (-small, 0.0, small)
            )
            v = (after - before) / (2.0 * small)
            if np.linalg.norm(v) > 1.0:  # the step's edge
                v = np.zeros(3)
            self._samples[:3, i], self._slopes[:3, i] = at + self._lead * v, v
        self.trajectory = PiecewisePolynomial.CubicHermite(
            self._times, self._samples, self._slopes
        )


def add_wall_motion(
    builder: Any,
    plant: Any,
    abdomen: Abdomen,
    params: WallMotionParams,
    duration: float,
) -> None:
    """Connects the wall's servos to its motion.

    Args:
        builder: The diagram that owns the plant.
        plant: The finalized plant.
        abdomen: What `add_abdomen` returned.
        params: The motion.
        duration: How long it is needed, in s.

    Raises:
        ValueError: If a parameter makes no sense.
    """
    check(params)
    if params.still:
        hold_still(builder, plant, abdomen.wall_instance)
        return
    course = Course(params, abdomen.params, duration)
    source = builder.AddNamedSystem("wall_motion", TrajectorySource(course.trajectory))
    builder.Connect(
        source.get_output_port(),
        plant.get_desired_state_input_port(abdomen.wall_instance),
    )
