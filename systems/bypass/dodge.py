"""Dodge: when R retracts from a tool that sweeps it; see `safe_velocity`."""

from math import sqrt
from typing import Any

import numpy as np

from systems.bypass.distance_rate import DistanceRate
from systems.common.compiled import compiled
from systems.common.geometry import dot, row_of

_OUTWARDS = 0.05
"""Share of insertion in A above which retracting would bring R nearer to the tool."""
_CLOSING = 0.004
"""A tool that closes more slowly is not dodged, m/s: it may be the tracker's noise."""


@compiled
def withdrawal_time(params: Any, way: float) -> float:
    """Time in s to pull the tip back by `way`, m, from rest."""
    ramp = 0.5 * params.max_speed**2 / params.acceleration
    if way <= ramp:
        return sqrt(2.0 * max(0.0, way) / params.acceleration)
    return way / params.max_speed + 0.5 * params.max_speed / params.acceleration


@compiled
def driven_time(rate: DistanceRate, normals: np.ndarray, room: np.ndarray) -> float:
    """Time in s until a tool that R gives way to has driven its tip into a border.

    Args:
        rate: Of the distance to the tool.
        normals: Of the borders, inwards (n, 3).
        room: Before each, m (n).
    """
    left, square = 1e9, dot(rate.A, rate.A)
    if square < 1e-12:
        return 0.0
    for k in range(len(room)):
        outwards = -rate.c * dot(row_of(normals, k), rate.A) / square
        if outwards > 1e-6:
            left = min(left, max(0.0, room[k]) / outwards)
    return left


@compiled
def must_dodge(
    params: Any,
    is_dodging: bool,
    q: float,
    rate: DistanceRate,
    safe: float,
    outwards: float,
    evasion: float,
    driven: float,
) -> bool:
    """Whether R retracts from a tool that sweeps the inside of its shaft.

    Args:
        params: A record of `constants`.
        is_dodging: Whether it does already.
        q: Insertion, m.
        rate: Of the distance to the tool.
        safe: D_safe, m.
        outwards: Share of insertion in A.
        evasion: e, m/s.
        driven: See `driven_time`.
    """
    if outwards > _OUTWARDS or rate.c <= (0.5 if is_dodging else 1.0) * _CLOSING:
        return False
    left = max(0.0, rate.rho - safe) / rate.c
    if rate.c <= (0.4 if is_dodging else 0.6) * evasion:
        left += driven
    needed = withdrawal_time(params, q - (rate.s * q - safe))
    return left < 1.5 * needed + 0.3
