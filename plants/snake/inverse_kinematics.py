"""Inverse kinematics: positioning part, whole robot, last module, entry (paper, V).

The positioning part (translation, modules 1 and 2) takes the intermediate frame I,
which stands at O2, to a position p_WI with its axis along n_WI; its roll follows.
With v the axis between the two modules,

    p_WI = (0, 0, s) + 2h [ (z + v)/|z + v| + v + (v + n)/|v + n| + n ].

Given k = cos(beta2), the lateral part is a vector equation along the azimuth of
module 1 and gives alpha1 and beta1, hence v; what is left is one equation in k,
v . n = 2 k^2 - 1, with exactly one root within the limits: the paper's "unique
solution of the intermediate inverse kinematics" (V.B.2).

The whole robot has two freedoms more than a tool axis and position need. They are
taken as the intermediate axis n_WI itself, from which all else follows.
"""

from dataclasses import dataclass
import math
from typing import Any

from numba import njit
import numpy as np
from numpy.typing import ArrayLike, NDArray

from plants.snake.kinematics import Array
from plants.snake.parameters import SnakeParams

REACHED = 0
BEND = 1  # outside the reach of modules 1 and 2 whatever the translation
TRAVEL_LOW = 2
TRAVEL_HIGH = 3
LAST_BEND = 4  # the tool's axis lies too far from the intermediate axis

SLACK = 1e-9
"""Limits are kept to this many rad, and m, so that poses on them are reached."""


@njit(cache=True)
def half_bend(w: float, kappa: float, t_max: float) -> float:
    """Solves sin(b) (1 + kappa cos(b)) = w for t = tan(b/2), at most t_max.

    In t the left side is rational, rising and concave up to 45 deg, so Newton's
    method comes from below and needs no trigonometry (compiled).
    """
    up, down = 1 + kappa, 1 - kappa
    t = w / (2 * up)
    for _ in range(50):
        t = min(t, t_max)
        t2 = t * t
        s = 1 + t2
        f = 2 * t * (up + down * t2) / (s * s) - w
        slope = 2 * (up + 3 * down * t2) / (s * s) - 8 * t2 * (up + down * t2) / (
            s * s * s
        )
        step = f / slope
        t -= step
        if abs(step) < 1e-16 + 1e-15 * t or t > t_max + 1e-3:
            break
    return min(t, t_max)


@njit(cache=True)
def _middle_axis(k: float, x: float, y: float, n: Any, t_max: float) -> Any:
    """Axis v for a given k = cos(beta2), its error v . n - (2 k^2 - 1), and t1.

    (x, y) is the lateral part of (p_WI - 2h n)/(2h).
    """
    wx, wy = x - n[0] / (2 * k), y - n[1] / (2 * k)
    w = math.sqrt(wx * wx + wy * wy)
    t = half_bend(w, 2 + 1 / k, t_max)
    s = 1 + t * t
    sb, cb = 2 * t / s, (1 - t * t) / s
    lateral = 2 * sb * cb / w if w > 1e-300 else 0.0
    vx, vy, vz = lateral * wx, lateral * wy, cb * cb - sb * sb
    return vx * n[0] + vy * n[1] + vz * n[2] - (2 * k * k - 1), vx, vy, vz, t, w


@njit(cache=True)
def _turn_back(alpha: float, beta: float, n: Any) -> Any:
    """Azimuth and bend, per ball, that take a module's end axis to n.

    n is expressed in W; (alpha, beta) is the one module before.
    """
    ca, sa = math.cos(alpha), math.sin(alpha)
    c2, s2 = math.cos(2 * beta), math.sin(2 * beta)
    along, across = ca * n[0] + sa * n[1], ca * n[1] - sa * n[0]
    t, z = c2 * along - s2 * n[2], s2 * along + c2 * n[2]
    x, y = ca * t - sa * across, sa * t + ca * across
    return math.atan2(y, x), math.atan2(math.hypot(x, y), z) / 2


@njit(cache=True)
def _stroke(travel: Any, q: Any) -> int:
    """The status of a translation; one within SLACK is put on its limit."""
    if q[0] < travel[0] - SLACK:
        return TRAVEL_LOW
    if q[0] > travel[1] + SLACK:
        return TRAVEL_HIGH
    q[0] = min(max(q[0], travel[0]), travel[1])
    return REACHED


@njit(cache=True)
def _positioning(p: Any, n: Any, h: float, bend: float, travel: Any, q: Any) -> int:
    """Writes (s, alpha1, beta1, alpha2, beta2) to q; returns the status."""
    t_max = math.tan((bend + SLACK) / 2)
    x, y = p[0] / (2 * h) - n[0], p[1] / (2 * h) - n[1]
    if n[2] < 0 and math.hypot(n[0], n[1]) < SLACK and bend > math.pi / 4 - SLACK:
        # A U-turn takes both bends whole, in one plane: a circle, whose root is
        # double. Here alone the search would miss it.
        if abs(math.hypot(x, y) - 1 - math.sqrt(2)) > SLACK:
            return BEND
        q[1] = q[3] = math.atan2(y, x)
        q[2] = q[4] = math.pi / 4
        q[0] = p[2] + 2 * h
        return _stroke(travel, q)
    low, high = math.cos(bend + SLACK), 1.0
    g_low = _middle_axis(low, x, y, n, t_max)[0]
    if g_low < 0.0:
        return BEND
    g_high = _middle_axis(high, x, y, n, t_max)[0]
    # The error has one root: regula falsi (Illinois) keeps the bracket; near a
    # U-turn, where the root is almost double, every second step bisects.
    k = high
    side = 0
    for i in range(150):
        if g_high >= 0.0:
            k = high
        elif i > 12 and i % 2:
            k = (low + high) / 2
        else:
            k = (low * g_high - high * g_low) / (g_high - g_low)
        g = _middle_axis(k, x, y, n, t_max)[0]
        if abs(g) < 2e-16 or high - low < 2e-16:
            break
        if g > 0.0:
            low, g_low = k, g
            if side == 1:
                g_high /= 2
            side = 1
        else:
            high, g_high = k, g
            if side == -1:
                g_low /= 2
            side = -1
    _, _, _, vz, t, w = _middle_axis(k, x, y, n, t_max)
    if t >= t_max and w > 0:
        return BEND
    q[1] = math.atan2(y - n[1] / (2 * k), x - n[0] / (2 * k)) if w > 0.0 else 0.0
    q[2] = min(2 * math.atan(t), bend)
    q[3], q[4] = _turn_back(q[1], q[2], n)
    q[4] = min(q[4], bend)
    k = math.cos(q[4])
    q[0] = p[2] - 2 * h * (math.cos(q[2]) + vz + (vz + n[2]) / (2 * k) + n[2])
    return _stroke(travel, q)


@njit(cache=True)
def _positionings(
    p: Any, n: Any, h: float, bend: float, travel: Any, q: Any, status: Any
) -> None:
    for i in range(p.shape[0]):
        q[i, :] = np.nan
        status[i] = _positioning(p[i], n[i], h, bend, travel, q[i])


@njit(cache=True)
def _tools(
    p: Any,
    n: Any,
    m: Any,
    h: float,
    tool: float,
    bend: float,
    travel: Any,
    q: Any,
    status: Any,
) -> None:
    p_I = np.empty(3)
    for i in range(p.shape[0]):
        q[i, :] = np.nan
        c = m[i, 0] * n[i, 0] + m[i, 1] * n[i, 1] + m[i, 2] * n[i, 2]
        if c < math.cos(2 * bend) - 2 * SLACK:
            status[i] = LAST_BEND
            continue
        both = math.sqrt(2 + 2 * c)
        for r in range(3):
            mid = (m[i, r] + n[i, r]) / both
            p_I[r] = p[i, r] - tool * n[i, r] - 2 * h * (mid + n[i, r])
        status[i] = _positioning(p_I, m[i], h, bend, travel, q[i])
        if status[i] != BEND:
            # Undo module 1, then module 2 gives the last one's azimuth and bend.
            a, b = q[i, 1], q[i, 2]
            ca, sa, c2, s2 = math.cos(a), math.sin(a), math.cos(2 * b), math.sin(2 * b)
            along, across = ca * n[i, 0] + sa * n[i, 1], ca * n[i, 1] - sa * n[i, 0]
            t, z = c2 * along - s2 * n[i, 2], s2 * along + c2 * n[i, 2]
            p_I[0], p_I[1], p_I[2] = ca * t - sa * across, sa * t + ca * across, z
            q[i, 5], q[i, 6] = _turn_back(q[i, 3], q[i, 4], p_I)


def vectors(name: str, value: ArrayLike, unit: bool = False) -> Array:
    """Checks 3-vectors (..., 3) and returns them contiguous; axes made unit.

    Raises:
        ValueError: If the shape is wrong, a number is not finite or an axis zero.
    """
    value = np.asarray(value, float)
    if value.ndim == 0 or value.shape[-1] != 3:
        raise ValueError(f"{name} has shape {value.shape}, expected (..., 3)")
    if not np.isfinite(value).all():
        raise ValueError(f"{name} holds numbers that are not finite")
    if unit:
        norm = np.sqrt(np.einsum("...i,...i", value, value))[..., None]
        if not (norm > 0).all():
            raise ValueError(f"{name} holds a zero vector: an axis has a direction")
        value = value / norm
    return np.ascontiguousarray(value)


@dataclass
class Solutions:
    """Answers of the inverse kinematics.

    Attributes:
        q: Postures, (..., 5) or (..., 7): s, alpha1, beta1, ... NaN if the bends
            do not reach; if only the translation falls short, the posture that
            its travel forbids.
        status: REACHED, or the limit in the way, (...) of int.
    """

    q: Array
    status: NDArray[np.int64]

    @property
    def reached(self) -> NDArray[np.bool_]:
        """Whether each pose is reached, (...)."""
        return self.status == REACHED


def positioning(p_WI: ArrayLike, n_WI: ArrayLike, params: SnakeParams) -> Solutions:
    """Postures of the positioning part for intermediate poses (paper, V.B.2).

    Args:
        p_WI: Positions of O2 in m, (..., 3).
        n_WI: Axes there, any length, (..., 3).
        params: The snake.

    Returns:
        Postures (..., 5). For why a pose is refused ask `reachability.refusal`.
    """
    p, n = np.broadcast_arrays(vectors("p_WI", p_WI), vectors("n_WI", n_WI, unit=True))
    q = np.empty((*p.shape[:-1], 5))
    status = np.empty(p.shape[:-1], np.int64)
    _positionings(
        np.ascontiguousarray(p).reshape(-1, 3),
        np.ascontiguousarray(n).reshape(-1, 3),
        params.half_pitch,
        params.max_bend,
        np.asarray(params.travel, float),
        q.reshape(-1, 5),
        status.reshape(-1),
    )
    return Solutions(q, status)


def tool_postures(
    p_WT: ArrayLike, n_WT: ArrayLike, n_WI: ArrayLike, params: SnakeParams
) -> Solutions:
    """Postures of the whole robot for a tool position and axis.

    Args:
        p_WT: Positions of the tool in m, (..., 3).
        n_WT: Its axes, (..., 3).
        n_WI: Intermediate axes, (..., 3): the two redundant freedoms. Equal to
            n_WT, the last module is straight.
        params: The snake.

    Returns:
        Postures (..., 7).
    """
    p, n, m = np.broadcast_arrays(
        vectors("p_WT", p_WT),
        vectors("n_WT", n_WT, unit=True),
        vectors("n_WI", n_WI, unit=True),
    )
    q = np.empty((*p.shape[:-1], 7))
    status = np.empty(p.shape[:-1], np.int64)
    _tools(
        np.ascontiguousarray(p).reshape(-1, 3),
        np.ascontiguousarray(n).reshape(-1, 3),
        np.ascontiguousarray(m).reshape(-1, 3),
        params.half_pitch,
        params.tool_offset,
        params.max_bend,
        np.asarray(params.travel, float),
        q.reshape(-1, 7),
        status.reshape(-1),
    )
    return Solutions(q, status)
