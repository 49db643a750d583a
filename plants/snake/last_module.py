"""The last module and the entry procedure in closed form (paper, V.A and V.B.1).

The tool of the last module sweeps a surface of revolution about the intermediate
axis, the elementary volume's middle. In the plane of the bend,

    r(beta) = 2h (sin beta + sin 2 beta) + l sin 2 beta       (rises up to 45 deg)
    z(beta) = 2h (cos beta + cos 2 beta) + l cos 2 beta

from O2. During the entry modules 1 and 2 are straight, so the translation makes up
for z and any point of a cylinder is reached.
"""

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.inverse_kernels import half_bend
from plants.snake.inverse_kinematics import vectors
from plants.snake.parameters import SnakeParams
from plants.snake.posture import Array, posture_of


def meridian(beta: ArrayLike, params: SnakeParams) -> tuple[Array, Array]:
    """Radius and height (r, z) in m of the tool from O2, for beta in rad (...)."""
    beta = np.asarray(beta, float)
    h, tool = params.half_pitch, params.tool_offset
    r = 2 * h * (np.sin(beta) + np.sin(2 * beta)) + tool * np.sin(2 * beta)
    z = 2 * h * (np.cos(beta) + np.cos(2 * beta)) + tool * np.cos(2 * beta)
    return r, z


def bend_for_radius(r: float, params: SnakeParams) -> float:
    """Bend beta in rad of the last module whose tool is r m off the intermediate axis.

    Raises:
        ValueError: If the module's bend does not reach that far.
    """
    widest = float(meridian(params.max_bend, params)[0])
    if not -1e-12 <= r <= widest + 1e-12:
        raise ValueError(
            f"radius={r:.6g} m is out of the last module's reach: its bend of at "
            f"most {params.max_bend:.4f} rad gives 0 to {widest:.6g} m; nearest: "
            f"{min(max(r, 0.0), widest):.6g}"
        )
    h, tool = params.half_pitch, params.tool_offset
    t = half_bend(max(r, 0.0) / (2 * h), 2 + tool / h, np.tan(params.max_bend / 2))
    return float(2 * np.arctan(t))


def last_module(p_IT: ArrayLike, params: SnakeParams) -> tuple[float, float, float]:
    """Azimuth and bend that bring the tool nearest to a point along the axis.

    Args:
        p_IT: The point in the intermediate frame at O2, in m, (3,).
        params: The snake.

    Returns:
        (alpha3, beta3, gap): rad, rad, and how far in m the point lies ahead of
        the surface that the tool sweeps (0 on it, < 0 behind it).

    Raises:
        ValueError: If the point is farther off the axis than the bend reaches.
    """
    x, y, z = vectors("p_IT", p_IT).tolist()
    beta = bend_for_radius(float(np.hypot(x, y)), params)
    return float(np.arctan2(y, x)), beta, z - float(meridian(beta, params)[1])


def entry(p_WT: ArrayLike, params: SnakeParams) -> Array:
    """The posture (7,) of the entry procedure that has the tool at p_WT (3,), in m.

    Raises:
        ValueError: If the bend or the translation's travel does not reach it.
    """
    p = vectors("p_WT", p_WT)
    alpha, beta, gap = last_module(p, params)
    s = gap - 2 * params.straight_module
    low, high = params.travel
    if not low <= s <= high:
        raise ValueError(
            f"translation s={s:.6g} m is outside its travel [{low:g}, {high:g}] m; "
            f"nearest: p_WT with z={p[2] + min(max(s, low), high) - s:.6g} m"
        )
    return posture_of([s, 0.0, 0.0, 0.0, 0.0, alpha, beta])
