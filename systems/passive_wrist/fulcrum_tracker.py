"""The recursive estimate of a breathing fulcrum from wrench and shaft pose.

Four decisions keep it consistent where a plain extended Kalman filter is not:

- Breathing is switched on only once `breathing_rate` has found its rate in a
  record of the last twelve seconds, and that record is then *filtered again* from
  its start with the rate known: what an early probe said of the depth is not lost
  in the time in which the wall's motion was not yet understood. Before that the
  mean walks fast enough to follow a breathing wall, so that the depth stays
  honestly unknown (an untold lateral wall speed v under a shaft turning at rate w
  looks like a depth error v / w). A record without motion means a still wall.
- While the shaft has turned within the record, the depth is that of `wave_bank`,
  which weighs every rate at once, and the filter does not touch it.
- The stiffness is learnt only while it can be seen, above a force: at zero force
  K multiplies an offset that is mostly noise and would drift to its half. Below,
  it is *considered* (Schmidt): it widens the covariance and is not touched.
- A jump of the wall shows as two unlikely samples in a row. The first is coasted
  over, the second opens the mean's covariance, and only the mean is updated.
"""

from math import exp, log, pi, sqrt
from typing import Any

import numpy as np

from systems.common.compiled import rehearse
from systems.common.signal import example, flat, vector, view
from systems.common.signals import ShaftMotion, Wrench
from systems.passive_wrist.breathing_rate import (
    BreathingFit,
    find_breathing,
    fit_breathing,
)
from systems.passive_wrist.fulcrum_filter import FulcrumParams, prior
from systems.passive_wrist.fulcrum_kernels import (
    LN_K,
    LN_OMEGA,
    RECORD_PERIOD,
    Entry,
    filter_record,
    predict,
    read_entry,
    sample_of,
    spread,
)
from systems.passive_wrist.fulcrum_step import (
    AGREED,
    BREATHING,
    FOUND,
    LEAST_BREATHING,
    LEAST_RMS,
    LED,
    LED_FOR,
    NIS,
    PHASE,
    RECORD,
    RECORDED,
    SCALARS,
    STEPS,
    TIME,
    WALK,
    WAVE,
    Memory,
    advance,
    constants,
    memory,
    report,
    to_first_force,
    uncertainty,
)
from systems.passive_wrist.wave_bank import WaveFit, fit_waves

_CHECK = 3  # entries between two looks for the breathing
_CHECK_NEAR = 2  # the same near a rate that is known
_SELDOM = 12  # the same at every rate once the wall is understood
_SHORTEST = 28  # entries before the first look
_STILL = 50  # entries without motion that make a still wall
_EXPECTED = 1.5  # smoothed innovations up to which the wall is understood
_TURNED = 0.03  # rad, rms: below it a record's shafts tell no depth
_SURE = 1.5e-3  # [m] sigma along the shaft of a depth that is taken
_CERTAIN = 0.85  # of the evidence in the rate that is taken
_SAME_RATE = 0.04  # in ln rate
_BREATHS = 1.25  # that a record must hold
_LEAST_RATE_SIGMA = 5e-3  # in ln rate
_LEAST_LATERAL = 5e-4  # [m] rms of the first harmonic across the shaft


class FulcrumTracker:
    """The estimator over plain arrays; all it remembers is the vector z.

    Its layout stands in `fulcrum_step`.
    """

    def __init__(self, params: FulcrumParams) -> None:
        self.p = params
        self._constants = constants(params)
        self._c = self._constants[0]
        self._every = float(self._c["every"])
        self._due = self.at("due")
        self._parts = [6 * k + 3 for k in range(params.harmonics)]
        rehearse(self._call_all)

    def _call_all(self) -> None:
        """Calls every kernel once."""
        shaft, wrench = example(ShaftMotion), example(Wrench)
        entry = Entry(shaft.p, shaft.u, wrench.f, wrench.m, 1.0)
        z = self.initial()
        for _ in range(2):
            z = self.step(z, flat(shaft), flat(wrench))
        self._filter_again(z, np.tile(flat(entry), (2, 1)), None, 0.0)
        self.report(z, 0.0, flat(shaft))
        self.covariance(z)

    def initial(self) -> np.ndarray:
        """The state before the first sample, shape (end,)."""
        z = np.zeros(self._c["end"])
        m = self.memory(z)
        m.x[:], m.P[:] = prior(self.p)
        m.scalars[NIS], m.scalars[TIME] = 1.0, -self.p.period
        return z

    def memory(self, z: np.ndarray) -> Memory:
        """The parts of z; nothing is copied."""
        return memory(self._constants, z)

    def at(self, name: str) -> int:
        """Index in z of a scalar named in `SCALARS`."""
        return int(self._c["scalars"]) + SCALARS.index(name)

    def covariance(self, z: np.ndarray) -> np.ndarray:
        """Covariance (3, 3) of the fulcrum at the last update, row by row, in m^2."""
        return uncertainty(self._constants, z)

    def report(self, z: np.ndarray, time: float, shaft: np.ndarray) -> np.ndarray:
        """The elements of the `Fulcrum` at a time, of those of the `ShaftMotion`."""
        return report(self._constants, z, time, shaft)

    def breathing(self, z: np.ndarray) -> float:
        """Rate in Hz; zero while there is no breathing to see."""
        m = self.memory(z)
        if m.scalars[PHASE] < BREATHING or m.rms[0] < LEAST_BREATHING:
            return 0.0
        return exp(m.x[LN_OMEGA]) / (2.0 * pi)

    def step(
        self, z: np.ndarray, shaft: np.ndarray, wrench: np.ndarray, time: float = 0.0
    ) -> np.ndarray:
        """One update; `z` is not changed, the new state is returned.

        Args:
            z: The state.
            shaft: Elements of the `ShaftMotion`.
            wrench: Elements of the `Wrench`.
            time: In s.
        """
        z = advance(self._constants, z, time, shaft, wrench)
        if z[self._due] == 1.0:
            self._look(z)
        return z

    def _look(self, z: np.ndarray) -> None:
        """Looks for the breathing, or for a still wall, in the record."""
        p, m = self.p, self.memory(z)
        x, scalars = m.x, m.scalars
        if scalars[RECORDED] < _SHORTEST:
            return
        entries = scalars[STEPS] // self._every
        if scalars[LED] > 0.0 and entries % _CHECK_NEAR == 0:
            self._look_near(m)
        if entries % _CHECK:
            return
        record = m.record[RECORD - int(scalars[RECORDED]) :]
        stiffness = exp(x[LN_K])
        seen = view(Entry, record)
        known = scalars[PHASE] == BREATHING
        p_WI = self._where(x, len(record)) if known else x[:3]
        depth = ((p_WI - seen.p) * seen.u).sum(axis=1)
        place = seen.p + depth[:, None] * seen.u + seen.f / stiffness
        # Across the mean shaft: along it the filter's belief would confirm itself.
        axis = seen.u.mean(axis=0)
        axis /= sqrt(axis.dot(axis))
        lateral = place - place.dot(axis)[:, None] * axis
        noise = p.force_noise / sqrt(self._every) / stiffness
        wave = None if known and p.steady else self._waves(m, seen, axis)
        if wave is not None:
            same = fit_breathing(lateral, RECORD_PERIOD, p.harmonics, wave.rate)
            other = abs(log(2.0 * pi * wave.rate) - x[LN_OMEGA]) > _SAME_RATE
            u = seen.u[-1]
            if not known or other:
                self._filter_again(z, record, same, noise)
                scalars[LED] = 0.0
            self._lead(m, wave, u)
            return
        if scalars[LED] > 0.0 and scalars[NIS] < _EXPECTED:
            return
        fit = find_breathing(lateral, RECORD_PERIOD, p.harmonics)
        if fit is None or not believable(fit, len(record), noise):
            scalars[AGREED] = 0.0
            moved = float(np.sqrt(lateral.var(axis=0).sum()))
            still = moved < max(2e-4, 3.0 * noise)
            if not known and len(record) >= _STILL and still:
                self._filter_again(z, record, None, noise)
            return
        before = scalars[FOUND]
        agrees = abs(fit.rate / before - 1.0) < 0.06 if before > 0.0 else False
        scalars[AGREED] = scalars[AGREED] + 1.0 if agrees else 1.0
        scalars[FOUND] = fit.rate
        # Another rate than the one that is followed: the first may have been found
        # in less than a breath. It is taken when the record has long said so, or at
        # once when the wall is not understood.
        strange = abs(log(2.0 * pi * fit.rate) - x[LN_OMEGA]) > _SAME_RATE
        other = strange or not self.breathing(z)
        breaths = fit.rate * len(record) * RECORD_PERIOD
        long_said = scalars[AGREED] >= 4.0 and breaths > 1.3
        certain = long_said or scalars[NIS] > _EXPECTED
        if scalars[AGREED] >= 2.0 and (not known or (other and certain)):
            self._filter_again(z, record, fit, noise)

    def _look_near(self, m: Memory) -> None:
        """Goes on with a wave that is known: a sharp one is not foreseen for long."""
        seen = view(Entry, m.record[RECORD - int(m.scalars[RECORDED]) :])
        stiffness, doubt = exp(m.x[LN_K]), sqrt(m.P[LN_K, LN_K])
        wave = fit_waves(self.p, seen, stiffness, doubt, m.scalars[WAVE])
        if wave is not None:
            m.scalars[WAVE] = wave.rate
            self._lead(m, wave, seen.u[-1])

    def _waves(self, m: Memory, seen: Any, axis: np.ndarray) -> WaveFit | None:
        """The bank's fit of the record, if it knows rate and depth."""
        turned = float(np.sqrt(np.mean(1.0 - (seen.u @ axis) ** 2)))
        # Every rate at once is work: seldom where the wall is understood.
        rare = m.scalars[PHASE] == BREATHING and m.scalars[NIS] < _EXPECTED
        due = m.scalars[STEPS] // self._every % (_SELDOM if rare else _CHECK) == 0
        if turned < _TURNED or not due:
            return None
        doubt = sqrt(m.P[LN_K, LN_K])
        wave = fit_waves(self.p, seen, exp(m.x[LN_K]), doubt)
        if wave is None:
            return None
        before, m.scalars[WAVE] = m.scalars[WAVE], wave.rate
        if wave.share < _CERTAIN:
            return None
        agrees = abs(wave.rate - before) < _SAME_RATE * wave.rate
        breaths = wave.rate * len(seen.u) * RECORD_PERIOD
        # Along the shaft alone one rise of the wall is a wave as well.
        moves = wave.lateral(axis) > _LEAST_LATERAL
        sure = moves and breaths > _BREATHS and wave.along(seen.u[-1]) < _SURE
        return wave if agrees and sure else None

    def _lead(self, m: Memory, wave: WaveFit, u: np.ndarray) -> None:
        """Takes the depth from the bank, the filter's place across the shaft stays.

        What the bank knew before is kept where the record tells less by now.
        """
        before = spread(m.P, vector(u), 0.0)[1]
        if m.scalars[LED] > 0.0 and wave.along(u) > before:
            return
        U = np.outer(u, u)
        n = 3 + 6 * self.p.harmonics
        blocks = np.kron(np.eye(n // 3), U)  # of the mean and each harmonic's parts
        m.x[:n] += blocks @ (wave.x[:n] - m.x[:n])
        keep = np.eye(len(m.x))
        keep[:n, :n] -= blocks
        m.P[:] = keep @ m.P @ keep
        m.P[:n, :n] += blocks @ wave.P[:n, :n] @ blocks
        m.x[LN_OMEGA] = log(2.0 * pi * wave.rate)
        m.P[LN_OMEGA, :] = m.P[:, LN_OMEGA] = 0.0
        m.P[LN_OMEGA, LN_OMEGA] = max(wave.rate_sigma, _LEAST_RATE_SIGMA) ** 2
        m.finer[:] = wave.x[n:-1]
        m.scalars[LED] = LED_FOR

    def _where(self, x: np.ndarray, entries: int) -> np.ndarray:
        """The fulcrum at the record's last entries, shape (entries, 3)."""
        back = -RECORD_PERIOD * (np.arange(entries)[::-1] + 0.5)
        omega = exp(x[LN_OMEGA])
        place = np.tile(x[:3], (entries, 1))
        for k, i in enumerate(self._parts, 1):
            phase = k * omega * back
            place += np.outer(np.cos(phase), x[i : i + 3])
            place -= np.outer(np.sin(phase), x[i + 3 : i + 6])
        return place

    def _filter_again(
        self,
        z: np.ndarray,
        record: np.ndarray,
        fit: BreathingFit | None,
        noise: float,
    ) -> None:
        """Filters the record again, now with the breathing's rate."""
        p, m = self.p, self.memory(z)
        x, P = prior(p)
        x[LN_K], P[LN_K, LN_K] = m.x[LN_K], m.P[LN_K, LN_K]
        x[:3] = m.x[:3] if m.scalars[PHASE] == BREATHING else p.guess
        x[LN_OMEGA] = log(2.0 * pi * (fit.rate if fit else 0.25))
        P[LN_OMEGA, LN_OMEGA] = 0.05**2
        to_first_force(self._c, x, P, sample_of(read_entry(record[0]), self._every))
        u = view(Entry, record[0]).u
        U = np.outer(u, u)
        m.rms[:] = fit.parts if fit else 0.0
        for i, rms in zip(self._parts, m.rms, strict=True):
            side = (1.5 * rms) ** 2 + 1e-8
            wide = side * (np.eye(3) - U) + p.axial_ratio**2 * side * U
            P[i : i + 3, i : i + 3] = P[i + 3 : i + 6, i + 3 : i + 6] = wide
            P[:3, :3] += wide  # the first sample was taken somewhere in the wave
        # What the harmonics miss of the wave, as a walk that wanders as far in the
        # time of the first harmonic left out.
        left = max(fit.residual**2 - 2.0 * noise**2, 0.0) if fit else 0.0
        omega = 2.0 * pi * (fit.rate if fit else 0.0) * (p.harmonics + 1)
        walk = sqrt(p.still_walk**2 + 2.0 * omega * left)
        walks = p.amplitude_walk * np.maximum(m.rms, LEAST_RMS)
        if not filter_record(self._constants, x, P, record, walk, walks):
            raise ValueError("fulcrum estimator: the record cannot be filtered again")
        # An entry is the mean of a tenth of a second: half of that old.
        predict(x, P, 0.5 * RECORD_PERIOD, 0.0, walks, True)
        m.x[:], m.P[:] = x, P
        m.scalars[WALK] = walk
        m.scalars[PHASE], m.scalars[NIS], m.scalars[AGREED] = BREATHING, 1.0, 0.0


def believable(fit: BreathingFit, entries: int, noise: float) -> bool:
    """Whether a fitted wave is more than noise, and not a piece of a slower one.

    Args:
        fit: The fit.
        entries: Length of its record.
        noise: Standard deviation of the record's noise, in m.
    """
    clear = 2.5 if entries == RECORD else 4.0
    if fit.amplitude < max(2e-4, 3.0 * noise, clear * fit.residual):
        return False
    if len(fit.parts) > 1 and fit.parts[1] > 0.8 * fit.parts[0]:
        return False  # half the rate: of a breath the first harmonic is the largest
    breaths = fit.rate * entries * RECORD_PERIOD
    # A sharp wave seen for less than a breath fits a quicker one nearly as well.
    return breaths > 1.3 or fit.residual < 0.04 * fit.amplitude + 1.5 * noise
