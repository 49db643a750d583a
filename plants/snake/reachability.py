"""Why an intermediate pose is refused, and the nearest one that is not.

For a given axis n the positions within reach are a prism: modules 1 and 2 move
O2 over a region of the lateral plane, the image of all axes v between them that
are at most 2 max_bend from z and from n, and the translation sweeps it along z.
The nearest reachable pose keeps the axis and is the closest point of that prism;
the limits that are reached there are the ones that stop the pose asked for. Only
an axis tilted beyond 4 max_bend has to change.
"""

from dataclasses import dataclass
import math

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.inverse_kinematics import positioning, vectors
from plants.snake.parameters import SnakeParams
from plants.snake.posture import Array

Z = np.array([0.0, 0.0, 1.0])


def _spread(count: int) -> Array:
    """Axes spread evenly over the upper half sphere (Fibonacci), (count, 3)."""
    i = np.arange(count) + 0.5
    z, a = i / count, i * math.pi * (3 - math.sqrt(5))
    r = np.sqrt(1 - z * z)
    return np.stack([r * np.cos(a), r * np.sin(a), z], axis=1)


_SPREAD = _spread(400)
_STEP = 1e-4
_STENCIL = _STEP * np.array(
    [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1], [1, 1], [1, -1], [-1, 1], [-1, -1]]
)


@dataclass
class Refusal:
    """Why an intermediate pose is out of reach.

    Attributes:
        limits: Limits reached at the nearest pose: "beta1", "beta2", "s_min",
            "s_max", or "tilt" if the axis itself leans too far.
        gap: Distance in m to the nearest reachable position, at its axis.
        tilt_gap: Angle in rad by which the axis has to be turned, 0 unless "tilt".
        p_WI: Nearest position, (3,).
        n_WI: Its axis, (3,).
        x: Posture there, (5,).
    """

    limits: list[str]
    gap: float
    tilt_gap: float
    p_WI: Array
    n_WI: Array
    x: Array

    def __str__(self) -> str:
        where = ", ".join(f"{1e3 * x:.2f}" for x in self.p_WI)
        turn = f" and {math.degrees(self.tilt_gap):.2f} deg" if self.tilt_gap else ""
        return (
            f"out of reach by {1e3 * self.gap:.3f} mm{turn}, stopped by "
            f"{' and '.join(self.limits)}; nearest reachable position ({where}) mm"
        )


def _length(v: Array) -> Array:
    return np.sqrt((v * v).sum(axis=-1))


class _Prism:
    """Positions of O2 within reach for one axis n, by the axis v between modules."""

    def __init__(self, n: Array, azimuth: float, params: SnakeParams) -> None:
        self.n = n
        self.h = params.half_pitch
        self.low, self.high = params.travel
        self.c = math.cos(2 * params.max_bend)
        self.sine = math.sin(2 * params.max_bend)
        self.tilt = math.atan2(math.hypot(n[0], n[1]), n[2])
        self.e = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
        self.m = np.array([-self.e[1], self.e[0], 0.0])

    def miss(self, p: Array, v: Array) -> Array:
        """From the reachable point that v gives to p, (..., 3)."""
        first = np.sqrt(2 + 2 * v[..., 2:])
        second = np.sqrt(np.maximum(2 + 2 * (v @ self.n)[..., None], 1e-300))
        gap = p - 2 * self.h * ((Z + v) / first + v + (v + self.n) / second + self.n)
        gap[..., 2] -= np.clip(gap[..., 2], self.low, self.high)
        return gap

    def arc(self, module: int, turn: Array) -> Array:
        """Axes v where a module is bent to its limit; turn in [-1, 1] spans the arc."""
        ratio = self.c / self.sine * math.tan(self.tilt / 2)
        a = turn[:, None] * math.acos(min(max(ratio, 0.0), 1.0))
        ct, st = math.cos(self.tilt), math.sin(self.tilt)
        axis, towards = (Z, self.e) if module == 1 else (self.n, st * Z - ct * self.e)
        return self.c * axis + self.sine * (np.cos(a) * towards + np.sin(a) * self.m)

    def on_arc(self, p: Array, module: int) -> tuple[Array, float]:
        """The closest v on an arc, and its distance."""
        centre, half = 0.0, 1.0
        for samples in (129, *[17] * 11):
            turn = np.clip(centre + half * np.linspace(-1, 1, samples), -1, 1)
            v = self.arc(module, turn)
            d = _length(self.miss(p, v))
            best = int(np.argmin(d))
            centre, half = turn[best], 2 * half / (samples - 1)
        return v[best], float(d[best])

    def inside(self, p: Array) -> tuple[Array, float] | None:
        """The closest v off the arcs (then the travel stops it), and its distance.

        Newton's method on the squared distance, from the best of the spread axes.
        """
        v = _SPREAD[(_SPREAD[:, 2] > self.c) & (_SPREAD @ self.n > self.c)]
        if not len(v):
            return None
        v = v[int(np.argmin(_length(self.miss(p, v))))]
        damping = 1e-2
        for _ in range(30):
            across = np.cross(v, [1.0, 0.0, 0.0] if abs(v[0]) < 0.7 else Z)
            across /= math.sqrt(float(across @ across))
            basis = np.array([across, np.cross(v, across)])
            near = v + _STENCIL @ basis
            near /= _length(near)[:, None]
            f = _length(self.miss(p, near)) ** 2
            g = np.array([f[1] - f[2], f[3] - f[4]]) / (2 * _STEP)
            H = np.diag([f[1] + f[2] - 2 * f[0], f[3] + f[4] - 2 * f[0]]) / _STEP**2
            H[0, 1] = H[1, 0] = (f[5] - f[6] - f[7] + f[8]) / (4 * _STEP**2)
            size = float(np.abs(H).max())
            least = float(np.linalg.eigvalsh(H)[0])
            shift = max(damping * size, 1e-3 * size - least)
            step = -np.linalg.solve(H + shift * np.eye(2), g)
            w = v + step @ basis
            w /= math.sqrt(float(w @ w))
            inside = w[2] >= self.c and w @ self.n >= self.c
            miss = self.miss(p, w)
            if inside and miss @ miss < f[0]:
                v, damping = w, damping / 10 if damping > 1e-9 else 0.0
            else:
                damping = max(10 * damping, 1e-4)
            if step @ step < 1e-18 or damping > 1e4:
                break
        return v, float(_length(self.miss(p, v)))


def refusal(p_WI: ArrayLike, n_WI: ArrayLike, params: SnakeParams) -> Refusal | None:
    """Why an intermediate pose cannot be reached, or None if it can.

    Args:
        p_WI: Position of O2 in m, (3,).
        n_WI: Axis there, any length, (3,).
        params: The snake.
    """
    p, n = vectors("p_WI", p_WI), vectors("n_WI", n_WI, unit=True)
    if positioning(p, n, params).reached:
        return None
    lateral = math.hypot(n[0], n[1])
    azimuth = math.atan2(n[1], n[0]) if lateral > 0.0 else math.atan2(p[1], p[0])
    e = np.array([math.cos(azimuth), math.sin(azimuth), 0.0])
    tilt = math.atan2(lateral, n[2])
    most = 4 * params.max_bend
    tilt_gap = max(tilt - most, 0.0)
    if tilt_gap:
        n = math.cos(most) * Z + math.sin(most) * e
    prism = _Prism(n, azimuth, params)
    choices = [prism.on_arc(p, 1), prism.on_arc(p, 2), prism.inside(p)]
    v, gap = min((x for x in choices if x is not None), key=lambda x: x[1])
    p_best = p - prism.miss(p, v)
    limits = ["tilt"] if tilt_gap else []
    limits += ["beta1"] if v[2] <= prism.c + 1e-6 else []
    limits += ["beta2"] if float(v @ n) <= prism.c + 1e-6 else []
    missing = prism.miss(p, v)[2]
    limits += ["s_min"] if missing < -1e-12 else []
    limits += ["s_max"] if missing > 1e-12 else []
    return Refusal(limits, gap, tilt_gap, p_best, n, positioning(p_best, n, params).x)


def why_not(
    p_WT: ArrayLike, n_WT: ArrayLike, n_WI: ArrayLike, params: SnakeParams
) -> str:
    """Why a tool pose cannot be reached with an intermediate axis; "" if it can.

    Args:
        p_WT: Position of the tool in m, (3,).
        n_WT: Its axis, (3,).
        n_WI: Axis of the intermediate frame, (3,).
        params: The snake.
    """
    p = vectors("p_WT", p_WT)
    n, m = vectors("n_WT", n_WT, unit=True), vectors("n_WI", n_WI, unit=True)
    bend = math.atan2(float(np.linalg.norm(np.cross(m, n))), float(m @ n)) / 2
    if bend > params.max_bend + 1e-9:
        return (
            f"stopped by beta3: tool and intermediate axis ask for {bend:.4f} rad, "
            f"at most {params.max_bend:.4f} rad can be had"
        )
    mid = (m + n) / np.linalg.norm(m + n)
    p_WI = p - params.tool_offset * n - 2 * params.half_pitch * (mid + n)
    answer = refusal(p_WI, m, params)
    return f"intermediate pose {answer}" if answer else ""
