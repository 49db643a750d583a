"""The tool's wrench from the sensor's reading, compiled (see `tool_wrench`)."""

from typing import Annotated, Any, NamedTuple

import numpy as np

from systems.common.compiled import Numbers, compiled
from systems.common.geometry import along, cross, plus, scaled, sub, xyz
from systems.common.signal import Field, Vector, finiteness
from systems.common.signals import ShaftMotion, Wrench

_GRAVITY = 9.81
SILENCE = Wrench((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.0)
"""The wrench of a sensor that says nothing."""
_finite = finiteness(Wrench)


class Fault(NamedTuple):
    """What noise, drift and offset add to a reading: force in N, moment in N m."""

    f: Vector
    m: Vector


class Load(NamedTuple):
    """A mass that slides along the instrument: a snake in its tube."""

    mass: Annotated[float, Field("kg", "of it", 0.0)]
    at: Annotated[float, Field("m", "of its centre from the sensor", 0.35)]


NO_LOAD = Load(0.0, 0.0)


@compiled
def shaft_motion(
    R_WM: np.ndarray, p_WM: Numbers, v_WM: Numbers, w_WM: Numbers
) -> tuple[ShaftMotion]:
    """The shaft of a mount M, whose z axis it is."""
    u = xyz(R_WM[:, 2], 0)
    return (ShaftMotion(xyz(p_WM, 0), u, xyz(v_WM, 0), cross(w_WM, u)),)


@compiled
def _less_turned(a: Vector, R: np.ndarray, b: Vector) -> Vector:
    """The difference a - R b."""
    for j in range(3):
        a = along(a, -b[j], R[:, j])
    return a


@compiled
def wall_wrench(
    params: Any,
    R_WM: np.ndarray,
    shaft: ShaftMotion,
    w: Numbers,
    alpha: Numbers,
    a: Numbers,
    force: Numbers,
    moment: Numbers,
    fault: Fault,
    p_WC: Numbers,
    a_WC: Numbers,
    load: Load,
) -> tuple[Wrench]:
    """What the wall does to the shaft, in W, about the sensor's origin.

    Args:
        params: A record: `mass` [kg] of the instrument, distance of its `centre` [m],
            its transverse `inertia` about the sensor [kg m^2]; `force_range` [N] and
            `moment_range` [N m] of an axis; `sleeve_mass` [kg], 0 for no sleeve.
        R_WM: Orientation of the mount.
        shaft: The sensor's origin S and the shaft.
        w: Angular velocity of the mount.
        alpha: Its angular acceleration.
        a: Acceleration of S.
        force: Ideal reading, in M.
        moment: Ideal reading, in M.
        fault: What is added to it.
        p_WC: Place of the sleeve.
        a_WC: Its acceleration.
        load: What slides along the instrument.

    Returns:
        The wrench; silence while an axis is saturated.
    """
    f_M, m_M = plus(force, fault.f), plus(moment, fault.m)
    for i in range(3):
        in_range = abs(f_M[i]) <= params.force_range
        if not (in_range and abs(m_M[i]) <= params.moment_range):
            return (SILENCE,)  # a NaN is not in range either
    mass = params.mass + load.mass
    centre = (params.mass * params.centre + load.mass * load.at) / mass
    transverse = params.inertia + load.mass * load.at * load.at
    ddu = plus(cross(alpha, shaft.u), cross(w, shaft.du))
    felt = plus(a, (0.0, 0.0, _GRAVITY))  # a - g
    f = scaled(mass, along(felt, centre, ddu))
    m = cross(shaft.u, along(scaled(transverse, ddu), mass * centre, felt))
    if params.sleeve_mass > 0.0:
        inertia = scaled(params.sleeve_mass, a_WC)
        f = plus(f, inertia)
        m = plus(m, cross(sub(p_WC, shaft.p), inertia))
    wrench = Wrench(_less_turned(f, R_WM, f_M), _less_turned(m, R_WM, m_M), 1.0)
    return (wrench if _finite(wrench) else SILENCE,)
