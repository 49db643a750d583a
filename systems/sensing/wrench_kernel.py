"""The tool's wrench from the sensor's reading, compiled (see `tool_wrench`)."""

from typing import Annotated, Any, NamedTuple

from plants.instruments.wrist_sensor import Felt, Mount
from systems.common.compiled import compiled
from systems.common.geometry import Pose, along, cross, outwards, plus, scaled, sub
from systems.common.signal import Field, Vector, finiteness
from systems.common.signals import ShaftMotion, Wrench

GRAVITY = 9.81
"""In m/s^2."""
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
def shaft_motion(mount: Mount) -> tuple[ShaftMotion]:
    """The shaft of a mount M, whose z axis it is."""
    return (ShaftMotion(mount.p, mount.z, mount.v, cross(mount.w, mount.z)),)


@compiled
def wall_wrench(
    params: Any,
    mount: Mount,
    felt: Felt,
    fault: Fault,
    load: Load,
) -> tuple[Wrench]:
    """What the wall does to the shaft, in W, about the sensor's origin.

    Args:
        params: A record: `mass` [kg] of the instrument, distance of its `centre` [m],
            its transverse `inertia` about the sensor [kg m^2]; `force_range` [N] and
            `moment_range` [N m] of an axis; `sleeve_mass` [kg], 0 for no sleeve.
        mount: The sensor's frame M; z along the shaft.
        felt: Ideal reading.
        fault: What is added to it.
        load: What slides along the instrument.

    Returns:
        The wrench; silence while an axis is saturated.
    """
    f_M, m_M = plus(felt.f, fault.f), plus(felt.m, fault.m)
    for i in range(3):
        in_range = abs(f_M[i]) <= params.force_range
        if not (in_range and abs(m_M[i]) <= params.moment_range):
            return (SILENCE,)  # a NaN is not in range either
    mass = params.mass + load.mass
    centre = (params.mass * params.centre + load.mass * load.at) / mass
    transverse = params.inertia + load.mass * load.at * load.at
    u = mount.z
    ddu = plus(cross(felt.alpha, u), cross(mount.w, cross(mount.w, u)))
    up = plus(felt.a, (0.0, 0.0, GRAVITY))  # a - g
    f = scaled(mass, along(up, centre, ddu))
    m = cross(u, along(scaled(transverse, ddu), mass * centre, up))
    if params.sleeve_mass > 0.0:
        inertia = scaled(params.sleeve_mass, felt.a_C)
        f = plus(f, inertia)
        m = plus(m, cross(sub(mount.p_C, mount.p), inertia))
    M = Pose(mount.p, mount.x, mount.y, mount.z)
    wrench = Wrench(sub(f, outwards(M, f_M)), sub(m, outwards(M, m_M)), 1.0)
    return (wrench if _finite(wrench) else SILENCE,)
