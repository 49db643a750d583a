"""A posture of the snake, and how the paper and people write one.

A posture is x = (s, a1, b1, a2, b2, a3, b3): translation in m, and the angles in rad by
which both balls of a module turn. A module is Rx(a) Ry(b) Tz(2h) Ry(b) Rx(a) Tz(2h),
smooth everywhere. All blocks and kernels use it.

The paper writes (s, alpha1, beta1, ..., alpha3, beta3): the azimuth in which a module
bends and how far, *per ball*. There alpha turns freely at beta = 0. So do scenarios,
sliders and logs; what is here takes one for the other.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from systems.common.compiled import compiled

Array = NDArray[np.float64]


def _angles(alpha: ArrayLike, beta: ArrayLike) -> tuple[Array, Array]:
    """A and b from azimuth and bend."""
    sb = np.sin(beta)
    return np.arctan2(-sb * np.sin(alpha), np.cos(beta)), np.arcsin(sb * np.cos(alpha))


def _bend(a: ArrayLike, b: ArrayLike) -> tuple[Array, Array]:
    """Azimuth and bend, alpha and beta, from a and b."""
    x, y = np.sin(b), -np.sin(a) * np.cos(b)
    return np.arctan2(y, x), np.arctan2(np.hypot(x, y), np.cos(a) * np.cos(b))


module_angles = compiled(_angles)
"""a and b of one module from alpha and beta, for kernels."""


def posture_of(bends: ArrayLike) -> Array:
    """Postures x from how the paper writes them, (..., 1 + 2 modules)."""
    x = np.array(bends, float)
    x[..., 1::2], x[..., 2::2] = _angles(x[..., 1::2], x[..., 2::2])
    return x


def bends_of(x: ArrayLike) -> Array:
    """Postures as the paper writes them, (s, alpha1, beta1, ...), from x."""
    bends = np.array(x, float)
    bends[..., 1::2], bends[..., 2::2] = _bend(bends[..., 1::2], bends[..., 2::2])
    return bends


def whole_postures(x: ArrayLike) -> Array:
    """Checks the shape of postures of the whole robot, (..., 7).

    Raises:
        ValueError: If the last axis is not 7 long.
    """
    x = np.asarray(x, float)
    if x.ndim == 0 or x.shape[-1] != 7:
        raise ValueError(
            f"postures have shape {x.shape}, expected (..., 7): s, a1, b1, ..., b3"
        )
    return x
