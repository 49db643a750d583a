"""The recursive estimate of a breathing fulcrum from wrench and shaft pose.

Three decisions keep it consistent where a plain extended Kalman filter is not:

- Breathing is switched on only once `breathing_rate` has found its rate in a
  record of the last twelve seconds, and that record is then *filtered again* from
  its start with the rate known: what an early probe said of the depth is not lost
  in the time in which the wall's motion was not yet understood. Before that the
  mean walks fast enough to follow a breathing wall, so that the depth stays
  honestly unknown (an untold lateral wall speed v under a shaft turning at rate w
  looks like a depth error v / w). A record without motion means a still wall.
- The stiffness is learnt only while it can be seen, above a force: at zero force
  K multiplies an offset that is mostly noise and would drift to its half. Below,
  it is *considered* (Schmidt): it widens the covariance and is not touched.
- A jump of the wall shows as two unlikely samples in a row. The first is coasted
  over, the second opens the mean's covariance, and only the mean is updated.
"""

from math import dist, exp, hypot, log, pi, sqrt

import numpy as np

from systems.passive_wrist.breathing_rate import BreathingFit, find_breathing
from systems.passive_wrist.fulcrum_filter import FulcrumFilter, FulcrumParams, Sample
from systems.passive_wrist.fulcrum_kernels import add_to_record, sample_of, spread

BEFORE, FOLLOWING, BREATHING = 0.0, 1.0, 2.0  # phases
_RECORD = 120  # entries of the record
_RECORD_PERIOD = 0.1  # [s]
_CHECK = 3  # entries between two looks for the breathing
_SHORTEST = 28  # entries before the first look
_STILL = 50  # entries without motion that make a still wall
_UNLIKELY = 30.0  # normalised innovation squared of a jump
_EXPECTED = 1.5  # smoothed innovations up to which the wall is understood
_GUARD = 0.1  # s after a jump in which only the mean is updated


class FulcrumTracker:
    """The estimator over plain arrays; all it remembers is the vector `z`.

    Layout of z: x (n), P (n n), the record (120 x 13: mean p_WS, u, f, m and weight
    of the angle of a tenth of a second), the sums for its next entry (13), the
    scalars `AUX`, and each harmonic's rms in m when the breathing was found.

    Attributes:
        filter: Prediction and updates.
        size: Length of z.
    """

    AUX = (
        "phase",
        "steps",  # updates so far
        "unlikely",  # unlikely samples in a row
        "guard",  # s left after a jump
        "nis",  # smoothed normalised innovation squared / 4, 1 = as expected
        "recorded",  # entries of the record
        "agreed",  # looks in a row that found the same rate
        "found",  # that rate, in Hz
        "jumps",  # jumps followed so far
        "refused",  # estimates refused so far
        "force",  # lateral force of the last sample, in N
        "walk",  # of the mean, from what the breathing's fit left, in m/sqrt(s)
        "summed",  # samples in the sums
        "time",  # of the last update, in s; kept for the block
    )

    def __init__(self, params: FulcrumParams) -> None:
        self.filter = FulcrumFilter(params)
        self.p = params
        n = self.filter.n
        self._record = n + n * n
        self._sums = self._record + 13 * _RECORD
        self._aux = self._sums + 13
        self._parts = self._aux + len(self.AUX)
        self.size = self._parts + params.harmonics
        self._every = max(1, round(_RECORD_PERIOD / params.period))

    def initial(self) -> np.ndarray:
        """The state before the first sample, shape (size,)."""
        x, P = self.filter.prior()
        z = np.zeros(self.size)
        z[: self.filter.n], z[self.filter.n : self._record] = x, P.reshape(-1)
        z[self.at("nis")], z[self.at("time")] = 1.0, -self.p.period
        return z

    def at(self, name: str) -> int:
        """Index in z of a scalar named in `AUX`."""
        return self._aux + self.AUX.index(name)

    def mean(self, z: np.ndarray) -> np.ndarray:
        """The filter's state x, a view into z."""
        return z[: self.filter.n]

    def covariance(self, z: np.ndarray) -> np.ndarray:
        """Covariance (3, 3) of the fulcrum at the last update, in m^2.

        The sensor's slow bias shifts the estimate sideways however long one
        averages, so its share is added here.
        """
        n, total = self.filter.n, self.filter.total
        P = total @ z[n : self._record].reshape(n, n) @ total.T
        bias = self.p.force_bias * 0.5 / exp(z[n - 1])
        P.reshape(-1)[::4] += bias**2
        return P

    def spread(self, z: np.ndarray, u: np.ndarray) -> tuple[float, float]:
        """Standard deviations of the fulcrum across a shaft and along it, in m."""
        n = self.filter.n
        bias = self.p.force_bias * 0.5 / exp(z[n - 1])
        sigmas: tuple[float, float] = spread(z[n : self._record].reshape(n, n), u, bias)
        return sigmas

    def stiffness(self, z: np.ndarray) -> tuple[float, float]:
        """Believed stiffness in N/m and the standard deviation of its logarithm."""
        n = self.filter.n
        return exp(z[n - 1]), sqrt(z[self._record - 1])

    def breathing(self, z: np.ndarray) -> float:
        """Rate in Hz; zero while there is no breathing to see."""
        if z[self.at("phase")] < BREATHING or z[self._parts] < 2e-4:
            return 0.0
        return exp(z[self.filter.n - 2]) / (2.0 * pi)

    def ahead(self, z: np.ndarray, time: float) -> tuple[list[float], list[float]]:
        """Fulcrum and its velocity `time` s after the last update."""
        return self.filter.ahead(z[: self.filter.n], time)

    def step(self, z: np.ndarray, sample: Sample) -> np.ndarray:
        """One update; `z` is not changed, the new state is returned."""
        z = z.copy()
        p, f = self.p, self.filter
        n = f.n
        x, aux = z[:n], z[self._aux : self._parts]
        P = z[n : self._record].reshape(n, n)
        force = aux[10] = hypot(sample.f1, sample.f2)
        aux[1] += 1.0
        if aux[0] == BEFORE:
            f.to_first_force(x, P, sample)
            aux[0] = FOLLOWING
            return z
        guard = aux[3] > 0.0
        known = aux[0] == BREATHING
        walk = aux[11] * min(max(aux[4], 1.0), 10.0) if known else p.wall_walk
        if guard:
            aux[3] -= p.period
            walk = 0.05  # the rest of a jump that takes more than two samples
        f.predict(x, P, p.period, walk, self._part_walks(z), known)
        i = f.innovate(x, P, sample)
        nis = i.nis
        if nis > _UNLIKELY and not guard:
            aux[2] += 1.0
            if aux[2] < 2.0:
                return z  # coasted over: one unlikely sample
            size = 1.5 * hypot(i.y[0], i.y[1]) / exp(x[n - 1])
            f.jump(x, P, sample, min(0.02, size))
            aux[2], aux[3], aux[5], aux[8] = 0.0, _GUARD, 0.0, aux[8] + 1.0
        else:
            aux[2] = 0.0
            aux[4] += 0.02 * (min(nis, 60.0) / 4.0 - aux[4])
            f.update(x, P, i, 3 if guard else n if force > p.learn_above else n - 1)
        self._remember(z, sample, i.w)
        if (
            dist(f.total.dot(x).tolist(), p.guess) > p.neighbourhood
        ):  # refused: starts anew
            aux[9] += 1.0
            aux[0], aux[3], aux[5], aux[6] = FOLLOWING, 0.0, 0.0, 0.0
            x[:3], x[3 : n - 2] = p.guess, 0.0
            P[: n - 1, :] = P[:, : n - 1] = 0.0
            f.to_first_force(x, P, sample)
        return z

    def coast(self, z: np.ndarray) -> np.ndarray:
        """One period without a reading."""
        z = z.copy()
        f = self.filter
        n = f.n
        aux = z[self._aux : self._parts]
        if aux[0] != BEFORE:
            known = aux[0] == BREATHING
            walk = aux[11] if known else self.p.wall_walk
            parts = self._part_walks(z)
            P = z[n : self._record].reshape(n, n)
            f.predict(z[:n], P, self.p.period, walk, parts, known)
            aux[5], aux[12] = 0.0, 0.0  # a record must have no gaps
            z[self._sums : self._aux] = 0.0
        return z

    def _part_walks(self, z: np.ndarray) -> np.ndarray:
        return self.p.amplitude_walk * np.maximum(z[self._parts :], 3e-4)

    def _remember(self, z: np.ndarray, a: Sample, w: np.ndarray) -> None:
        """Adds a sample to the record and looks for the breathing in it."""
        sums = z[self._sums : self._aux]
        add_to_record(sums, z[: self.filter.n], a.packed, w)
        aux = z[self._aux : self._parts]
        aux[12] += 1.0
        if aux[12] < self._every:
            return
        record = z[self._record : self._sums].reshape(_RECORD, 13)
        record[:-1] = record[1:]
        record[-1] = sums / aux[12]
        sums[:], aux[12] = 0.0, 0.0
        aux[5] = min(aux[5] + 1.0, _RECORD)
        entries = aux[1] // self._every
        if aux[5] >= _SHORTEST and entries % _CHECK == 0.0:
            self._look(z, record[_RECORD - int(aux[5]) :])

    def _look(self, z: np.ndarray, record: np.ndarray) -> None:
        """Looks for the breathing, or for a still wall, in the record."""
        n, p, aux = self.filter.n, self.p, z[self._aux : self._parts]
        x = z[:n]
        stiffness = exp(x[n - 1])
        p_WS, u, f = record[:, 0:3], record[:, 3:6], record[:, 6:9]
        p_WI = self._where(x, len(record)) if aux[0] == BREATHING else x[:3]
        depth = ((p_WI - p_WS) * u).sum(axis=1)
        place = p_WS + depth[:, None] * u + f / stiffness
        # Across the mean shaft: along it the filter's belief would confirm itself.
        axis = u.mean(axis=0)
        axis /= sqrt(axis.dot(axis))
        lateral = place - place.dot(axis)[:, None] * axis
        noise = p.force_noise / sqrt(self._every) / stiffness
        fit = find_breathing(lateral, _RECORD_PERIOD, p.harmonics)
        known = aux[0] == BREATHING
        if fit is None or not believable(fit, len(record), noise):
            aux[6] = 0.0
            moved = float(np.sqrt(lateral.var(axis=0).sum()))
            still = moved < max(2e-4, 3.0 * noise)
            if not known and len(record) >= _STILL and still:
                self._filter_again(z, record, None, noise)
            return
        agrees = abs(fit.rate / aux[7] - 1.0) < 0.06 if aux[7] > 0.0 else False
        aux[6] = aux[6] + 1.0 if agrees else 1.0
        aux[7] = fit.rate
        # Another rate than the one that is followed: the first may have been found
        # in less than a breath. It is taken when the record has long said so, or at
        # once when the wall is not understood.
        other = abs(log(2.0 * pi * fit.rate) - x[n - 2]) > 0.04 or not self.breathing(z)
        breaths = fit.rate * len(record) * _RECORD_PERIOD
        certain = (aux[6] >= 4.0 and breaths > 1.3) or aux[4] > _EXPECTED
        if aux[6] >= 2.0 and (not known or (other and certain)):
            self._filter_again(z, record, fit, noise)

    def _where(self, x: np.ndarray, entries: int) -> np.ndarray:
        """The fulcrum at the record's last entries, shape (entries, 3)."""
        back = -_RECORD_PERIOD * (np.arange(entries)[::-1] + 0.5)
        omega = exp(x[self.filter.n - 2])
        place = np.tile(x[:3], (entries, 1))
        for k, i in enumerate(self.filter.parts, 1):
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
        f, p, n = self.filter, self.p, self.filter.n
        aux = z[self._aux : self._parts]
        x, P = f.prior()
        old = z[n : self._record].reshape(n, n)
        x[n - 1], P[n - 1, n - 1] = z[n - 1], old[n - 1, n - 1]
        x[:3] = z[:3] if aux[0] == BREATHING else p.guess
        x[n - 2] = log(2.0 * pi * (fit.rate if fit else 0.25))
        P[n - 2, n - 2] = 0.05**2
        f.to_first_force(x, P, self._entry(record[0]))
        u = record[0, 3:6]
        U = np.outer(u, u)
        z[self._parts :] = fit.parts if fit else 0.0
        for k, i in enumerate(f.parts):
            side = (1.5 * z[self._parts + k]) ** 2 + 1e-8
            spread = side * (np.eye(3) - U) + p.axial_ratio**2 * side * U
            P[i : i + 3, i : i + 3] = P[i + 3 : i + 6, i + 3 : i + 6] = spread
            P[:3, :3] += spread  # the first sample was taken somewhere in the wave
        # What the harmonics miss of the wave, as a walk that wanders as far in the
        # time of the first harmonic left out.
        left = max(fit.residual**2 - 2.0 * noise**2, 0.0) if fit else 0.0
        omega = 2.0 * pi * (fit.rate if fit else 0.0) * (p.harmonics + 1)
        aux[11] = sqrt(p.still_walk**2 + 2.0 * omega * left)
        walks = self._part_walks(z)
        f.filter_record(x, P, record, _RECORD_PERIOD, self._every, aux[11], walks)
        # An entry is the mean of a tenth of a second: half of that old.
        f.predict(x, P, 0.5 * _RECORD_PERIOD, 0.0, walks, True)
        z[:n], z[n : self._record] = x, P.reshape(-1)
        aux[0], aux[4], aux[6] = BREATHING, 1.0, 0.0

    def _entry(self, row: np.ndarray) -> Sample:
        """An entry of the record as a sample."""
        a = sample_of(row, self._every).tolist()
        return Sample(
            a[0:3], a[3:6], a[6:9], a[9:12], a[12:15], a[15:18], 0.0, self._every, a[20]
        )


def believable(fit: BreathingFit, entries: int, noise: float) -> bool:
    """Whether a fitted wave is more than noise, and not a piece of a slower one.

    Args:
        fit: The fit.
        entries: Length of its record.
        noise: Standard deviation of the record's noise, in m.
    """
    clear = 2.5 if entries == _RECORD else 4.0
    if fit.amplitude < max(2e-4, 3.0 * noise, clear * fit.residual):
        return False
    breaths = fit.rate * entries * _RECORD_PERIOD
    # A sharp wave seen for less than a breath fits a quicker one nearly as well.
    return breaths > 1.3 or fit.residual < 0.04 * fit.amplitude + 1.5 * noise
