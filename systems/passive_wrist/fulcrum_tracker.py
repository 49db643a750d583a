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

from math import exp, log, pi, sqrt

import numpy as np

from systems.common.compiled import packed
from systems.passive_wrist.breathing_rate import BreathingFit, find_breathing
from systems.passive_wrist.fulcrum_filter import FulcrumFilter, FulcrumParams
from systems.passive_wrist.fulcrum_kernels import sample_of, spread
from systems.passive_wrist.fulcrum_step import (
    AUX,
    BREATHING,
    LEAST_BREATHING,
    RECORD,
    WIDTH,
    advance,
    report,
)

_RECORD_PERIOD = 0.1  # [s]
_CHECK = 3  # entries between two looks for the breathing
_SHORTEST = 28  # entries before the first look
_STILL = 50  # entries without motion that make a still wall
_EXPECTED = 1.5  # smoothed innovations up to which the wall is understood
_DUE = AUX.index("due")


class FulcrumTracker:
    """The estimator over plain arrays; all it remembers is the vector `z`.

    Layout of z: x (n), P (n n), the record (120 x 13: mean p_WS, u, f, m and weight
    of the angle of a tenth of a second), the sums for its next entry (13), the
    scalars `AUX`, and each harmonic's rms in m when the breathing was found.

    The scalars: phase; steps so far; unlikely samples in a row; s of guard left after
    a jump; nis, smoothed normalised innovation squared / 4 (1 = as expected); entries
    recorded; looks in a row that agreed on a rate; the rate found, in Hz; jumps
    followed; estimates refused; lateral force in N; walk of the mean once the wall is
    understood, in m/sqrt(s); samples summed; time of the last update in s; 1 if an
    entry was just added.

    Attributes:
        filter: Prediction and updates.
        size: Length of z.
    """

    def __init__(self, params: FulcrumParams) -> None:
        self.filter = FulcrumFilter(params)
        self.p = params
        n = self.filter.n
        self._record = n + n * n
        self._sums = self._record + WIDTH * RECORD
        self._aux = self._sums + WIDTH
        self._parts = self._aux + len(AUX)
        self.size = self._parts + params.harmonics
        self._every = max(1, round(_RECORD_PERIOD / params.period))
        self._constants = packed(params, every=float(self._every))

    def initial(self) -> np.ndarray:
        """The state before the first sample, shape (size,)."""
        x, P = self.filter.prior()
        z = np.zeros(self.size)
        z[: self.filter.n], z[self.filter.n : self._record] = x, P.reshape(-1)
        z[self.at("nis")], z[self.at("time")] = 1.0, -self.p.period
        return z

    def at(self, name: str) -> int:
        """Index in z of a scalar named in `AUX`."""
        return self._aux + AUX.index(name)

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

    def report(self, z: np.ndarray, u: np.ndarray, time: float) -> np.ndarray:
        """The estimate as a vector (14); see `FulcrumEstimator`'s port."""
        vector: np.ndarray = report(self._constants, z, u, time)
        return vector

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
        if z[self.at("phase")] < BREATHING or z[self._parts] < LEAST_BREATHING:
            return 0.0
        return exp(z[self.filter.n - 2]) / (2.0 * pi)

    def ahead(self, z: np.ndarray, time: float) -> tuple[list[float], list[float]]:
        """Fulcrum and its velocity `time` s after the last update."""
        return self.filter.ahead(z[: self.filter.n], time)

    def step(
        self, z: np.ndarray, shaft: np.ndarray, wrench: np.ndarray, time: float = 0.0
    ) -> np.ndarray:
        """One update; `z` is not changed, the new state is returned.

        Args:
            z: The state.
            shaft: p_WS [m], u, v_WS [m/s], du [1/s] (12).
            wrench: f [N], m [N m], and 1 if they are valid (7).
            time: In s.
        """
        z = advance(self._constants, z, shaft, wrench, time)
        aux = z[self._aux : self._parts]
        third = aux[1] // self._every % _CHECK == 0
        if aux[_DUE] == 1.0 and aux[5] >= _SHORTEST and third:
            record = z[self._record : self._sums].reshape(RECORD, WIDTH)
            self._look(z, record[RECORD - int(aux[5]) :])
        return z

    def _part_walks(self, z: np.ndarray) -> np.ndarray:
        return self.p.amplitude_walk * np.maximum(z[self._parts :], 3e-4)

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
        f.to_first_force(x, P, sample_of(record[0], self._every))
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
    breaths = fit.rate * entries * _RECORD_PERIOD
    # A sharp wave seen for less than a breath fits a quicker one nearly as well.
    return breaths > 1.3 or fit.residual < 0.04 * fit.amplitude + 1.5 * noise
