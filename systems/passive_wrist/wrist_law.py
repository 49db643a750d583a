"""The emulation's law, compiled: pivot, probe, freeze, speed (section 3).

A free wrist turns until its moment vanishes, so its shaft points from the task's
tip P through the fulcrum I: with the estimate I^ (its remaining force is already
in it: I^_perp = p_C + f / K^, which is the angle phi = asin(|f| / (K^ lambda)) of
Figure 3, so nothing is added a second time)

    u_d = (p_P - I^) / |p_P - I^|,   du_d = (1 - u u^T)(v_P - v_I^) / |p_P - I^|.

Around it lie three guards, all kept in one small state vector:

- the *pivot* follows I^ within the wrist's speed and acceleration;
- the *probe*, a short force-limited sideways move at the start, makes stiffness
  and depth visible (the better the emulation, the less force there is to learn
  from); far above the wall it swings the shaft by a multiple, and keeps clear of
  other tools there;
- the *freeze*: over the force limit the task's tip stands still while the pivot
  goes on relaxing the wall.
"""

from dataclasses import dataclass
from math import exp, hypot, pi, sqrt
from typing import Any

import numpy as np

from systems.common.compiled import compiled, packed
from systems.common.geometry import (
    across,
    along,
    dot,
    limited,
    norm,
    over,
    plus,
    scaled,
    sub,
    unit,
    xyz,
)
from systems.common.parameter import Rules, check, parameter
from systems.common.signal import Vector, finiteness
from systems.common.signals import (
    UNHINDERED,
    Fulcrum,
    Leeway,
    MovingPoint,
    Permission,
    ShaftMotion,
    ToolMotion,
    Velocity,
    Wrench,
)
from systems.common.stops import Stop
from systems.passive_wrist.wall_model import lateral_basis

MODES = ("pwe", "spring", "off", "known")
PROBE_OFF, PROBE_ON, PROBE_BACK = 0.0, 1.0, 2.0
PIVOT = 0  # p_W (3)
TURN = 3  # its velocity (3)
TIP = 6  # commanded p_WP (3)
SPRING = 9  # filtered offset of the spring (3)
STARTED = 12  # 1 once the law has begun
FROZEN = 13  # the `Stop` of a frozen task, else 0
OVER = 14  # s over the force limit
CALM = 15  # s under the release force with a live sensor
SILENT = 16  # s without a live sensor
PROBE = 17  # PROBE_OFF before, then PROBE_ON, PROBE_BACK
OFFSET = 18  # of the probe, in m
WAY = 19  # +1 or -1
DWELL = 20  # s at the present end of the probe
PROBED = 21  # s of probing
DONE = 22  # 1 once the probe is over
FREEZES = 23  # so far
SCALE = 24  # share of the task's speed
TIME = 25  # of the last update, in s
SIZE = 26  # of the law's state


@dataclass
class WristParams:
    """How the wrist is emulated."""

    # `pwe` (estimated fulcrum), `spring` (the printed law: the first guess corrected
    # by force over a fixed stiffness), `off` (the first guess for ever), or `known`
    # (told the true fulcrum).
    mode: str = parameter("pwe", "what fulcrum it turns about", choices=MODES)
    guess: list[float] | None = parameter(
        None, "first one of p_WI, of spring and off", "m", least=-1, most=1, shape=(3,)
    )
    spring_stiffness: float = parameter(
        2000.0, "of spring; 100 to 3000 is usual of a wall", "N/m", least=10, most=2e4
    )
    spring_bandwidth: float = parameter(
        5.0, "of spring's low-pass filter", "Hz", above=0, most=60
    )
    # The lag between this command and the arm's motion.
    horizon: float = parameter(
        0.0, "how far ahead the fulcrum is predicted", "s", least=0, most=0.5
    )
    # Of the relaxing motion, at the sensor.
    wrist_speed: float = parameter(0.25, "at the most", "m/s", above=0, most=1)
    wrist_acceleration: float = parameter(5.0, "at the most", "m/s^2", above=0, most=50)
    # Along the shaft it turns nothing: a depth that jumps then costs no force.
    slides: bool = parameter(False, "whether the pivot follows at once along the shaft")
    probe: bool = parameter(True, "whether an unknown stiffness is probed")
    probe_force: float = parameter(1.0, "at the most", "N", above=0, most=5)
    probe_travel: float = parameter(
        0.012, "at the most, at the fulcrum", "m", above=0, most=0.03
    )
    probe_speed: float = parameter(0.03, "at the fulcrum", "m/s", above=0, most=0.2)
    probe_force_rate: float = parameter(
        15.0, "its speed times the believed stiffness", "N/s", above=0, most=100
    )
    probe_time: float = parameter(1.5, "at the most", "s", above=0, most=10)
    # Of the lateral force.
    warning_force: float = parameter(3.0, "that is reported", "N", above=0, most=50)
    force_limit: float = parameter(5.0, "that freezes the task", "N", above=0, most=50)
    force_limit_time: float = parameter(
        0.3, "if it lasts so long", "s", above=0, most=2
    )
    release_force: float = parameter(
        1.0, "below which the task goes on", "N", above=0, most=20
    )
    release_time: float = parameter(0.2, "if that lasts so long", "s", above=0, most=5)
    sensor_timeout: float = parameter(
        0.05, "silence of the sensor that freezes the task", "s", least=0, most=0.5
    )
    # Up to which the task keeps its full speed.
    sure_across: float = parameter(1e-3, "lateral sigma", "m", above=0, most=0.02)
    sure_along: float = parameter(5e-3, "sigma along", "m", above=0, most=0.05)
    slowest: float = parameter(
        0.25, "smallest speed scale while the task moves", least=0, most=1
    )
    period: float = parameter(1 / 120, "of the update", "s", above=0, most=0.1)

    def rules(self) -> Rules:
        """What must hold across fields."""
        below = f"at most force_limit, {self.force_limit} N"
        yield self.release_force <= self.force_limit, "release_force", below
        yield self.probe_force <= self.force_limit, "probe_force", below


_PWE, _SPRING, _OFF, _KNOWN = range(len(MODES))
_LOADED, _SENSOR_LOST = float(Stop.WALL_LOADED), float(Stop.SENSOR_LOST)
_PROBING = float(Stop.PROBING)
_STILL = (0.0, 0.0, 0.0)
_CREEP = 0.2
"""Share of the probe's speed: with less leeway it turns round."""
Floats = np.ndarray
finite_fulcrum = finiteness(Fulcrum)
finite_motion = finiteness(ToolMotion)
finite_point = finiteness(MovingPoint)
finite_shaft = finiteness(ShaftMotion)
finite_velocity = finiteness(Velocity)
finite_wrench = finiteness(Wrench)


def initial(params: WristParams) -> np.ndarray:
    """The law's state before the first update."""
    state = np.zeros(SIZE)
    state[WAY], state[TIME] = 1.0, -params.period
    return state


def constants(params: WristParams) -> np.ndarray:
    """The parameters as the compiled law takes them."""
    check(params, "passive_wrist")
    first = np.array(params.guess or [0.0, 0.0, 0.0])
    return packed(params, code=float(MODES.index(params.mode)), first=first)


@compiled
def _put(s: Floats, place: int, a: Vector) -> None:
    """Writes a vector into the state."""
    s[place], s[place + 1], s[place + 2] = a


@compiled
def _watch(s: Floats, c: Any, force: float, valid: bool) -> None:
    """Freezes and releases the task."""
    dt = c.period
    s[OVER] = s[OVER] + dt if valid and force > c.force_limit else 0.0
    s[SILENT] = 0.0 if valid else s[SILENT] + dt
    # A sensor that is back is enough: it is the wrist that unloads the wall.
    calm = valid and (force < c.release_force or s[FROZEN] == _SENSOR_LOST)
    s[CALM] = s[CALM] + dt if calm else 0.0
    if s[FROZEN] != 0.0:
        if s[CALM] >= c.release_time:
            s[FROZEN] = 0.0
    elif s[OVER] >= c.force_limit_time:
        s[FROZEN] = _LOADED
        s[FREEZES] += 1.0
    elif s[SILENT] > c.sensor_timeout:
        s[FROZEN] = _SENSOR_LOST
        s[FREEZES] += 1.0


@compiled
def _spring(s: Floats, c: Any, shaft: ShaftMotion, f: Vector, valid: bool) -> Vector:
    """The printed law: the first guess's depth, the force over a fixed stiffness."""
    share = 1.0 - exp(-2.0 * pi * c.spring_bandwidth * c.period) if valid else 0.0
    before = xyz(s, SPRING)
    offset = over(across(f, shaft.u), c.spring_stiffness)
    _put(s, SPRING, along(before, share, sub(offset, before)))
    depth = dot(shaft.u, sub(c.first, shaft.p))
    return plus(along(shaft.p, depth, shaft.u), xyz(s, SPRING))


@compiled
def _probe(
    s: Floats, c: Any, u: Vector, f: Vector, estimate: Fulcrum, leeway: Leeway
) -> tuple[Vector, Vector]:
    """The probing move: what it adds to the pivot and to its velocity."""
    dt = c.period
    unsure = estimate.sigma_ln_stiffness
    if s[PROBE] == PROBE_OFF:
        s[PROBE] = PROBE_ON if unsure > 0.3 else PROBE_BACK
    s[PROBED] += dt
    if (unsure < 0.15 and estimate.sigma_along < 1.5e-3) or s[PROBED] > c.probe_time:
        s[PROBE] = PROBE_BACK
    e, _ = lateral_basis(u)
    speed = min(c.probe_speed, c.probe_force_rate / estimate.stiffness)
    offset, way, move = s[OFFSET], s[WAY], 0.0
    back = -dot(f, e)
    slow = _CREEP * speed
    if s[PROBE] == PROBE_BACK:
        # A tool that has come into the way back is left time to be evaded.
        forth = max(slow, min(speed, leeway.forth)) * dt
        move = max(-max(slow, min(speed, leeway.back)) * dt, min(forth, -offset))
        if offset + move == 0.0:
            s[DONE] = 1.0
    elif (
        back * way >= c.probe_force
        or offset * way >= c.probe_travel
        or (leeway.forth if way > 0.0 else leeway.back) < slow
    ):
        s[DWELL] += dt
        if s[DWELL] > 0.1:
            s[WAY], s[DWELL] = -way, 0.0
    else:
        move = way * min(speed, leeway.forth if way > 0.0 else leeway.back) * dt
    s[OFFSET] = offset + move
    return scaled(s[OFFSET], e), scaled(move / dt, e)


@compiled
def _move_pivot(
    s: Floats, c: Any, target: Vector, velocity: Vector, ratio: float
) -> None:
    """Moves the pivot to its target within the wrist's limits.

    What is fed forward is the target's own velocity: a difference of two estimates
    would send their noise twice. Only while the pivot cannot keep up it is the
    pivot's.
    """
    dt = c.period
    fastest, hardest = c.wrist_speed * ratio, c.wrist_acceleration * ratio
    error = sub(target, xyz(s, PIVOT))
    probing = c.probe and s[DONE] == 0.0  # its depths are not to be followed so fast
    if c.slides and not probing:
        u = unit(sub(xyz(s, TIP), xyz(s, PIVOT)))
        _put(s, PIVOT, along(xyz(s, PIVOT), dot(error, u), u))
        error, velocity = across(error, u), across(velocity, u)
    more = sub(over(error, dt), velocity)
    excess = norm(more)
    if excess <= max(hardest * dt, 0.2 * fastest):  # keeps up
        _put(s, PIVOT, target)
        _put(s, TURN, velocity)
        return
    # Approaches no faster than it can brake, than the wrist may move, and than it
    # can speed up.
    share = min(1.0, sqrt(2.0 * hardest * norm(error)) / excess)
    wanted = limited(along(velocity, share, more), fastest)
    change = sub(wanted, xyz(s, TURN))
    share = min(1.0, hardest * dt / max(norm(change), 1e-12))
    _put(s, TURN, along(xyz(s, TURN), share, change))
    _put(s, PIVOT, along(xyz(s, PIVOT), dt, xyz(s, TURN)))


@compiled
def next_state(
    c: Any,
    old: Floats,
    time: float,
    wanted: ToolMotion,
    shaft: ShaftMotion,
    wrench: Wrench,
    estimate: Fulcrum,
    seen: MovingPoint,
    leeway: Leeway = UNHINDERED,
) -> Floats:
    """The law's next state; what is not a number counts as a sensor that is silent.

    Args:
        c: A record of `constants`.
        old: State (26), its places named above.
        time: In s.
        wanted: The task's tool.
        shaft: As the encoders have it.
        wrench: What the wall does to it.
        estimate: What the fulcrum estimator says.
        seen: The fulcrum that is believed in: the estimate's, or the true one.
        leeway: What other tools leave the probe.
    """
    s = old.copy()
    s[TIME] = time
    p_WP, v_WP = xyz(s, TIP), _STILL  # hold still without a number
    if finite_motion(wanted):
        p_WP, v_WP = along(wanted.tip, time - wanted.time, wanted.v), wanted.v
    is_told = finite_shaft(shaft) and finite_fulcrum(estimate) and finite_point(seen)
    valid = is_told and wrench.valid > 0.5 and finite_wrench(wrench)
    u, f = shaft.u, wrench.f if valid else _STILL
    force = sqrt(max(dot(f, f) - dot(f, u) ** 2, 0.0)) if valid else 0.0
    _watch(s, c, force, valid)
    target, velocity = along(seen.p, c.horizon, seen.v), seen.v
    if not is_told or (c.code == _PWE and not valid):  # it may have lied before
        target, velocity = xyz(s, PIVOT), _STILL
    elif c.code == _OFF:
        target, velocity = xyz(c.first, 0), _STILL
    elif c.code == _SPRING:
        target, velocity = _spring(s, c, shaft, f, valid), _STILL
    elif c.code == _PWE and c.probe and s[DONE] == 0.0 and valid:
        more, faster = _probe(s, c, u, f, estimate, leeway)
        target, velocity = plus(target, more), plus(velocity, faster)
    if s[STARTED] == 0.0:
        s[STARTED] = 1.0
        _put(s, PIVOT, target)
        _put(s, TURN, velocity)
        _put(s, TIP, p_WP)
    else:
        reach = norm(sub(p_WP, xyz(s, PIVOT)))
        length = norm(sub(p_WP, shaft.p)) if is_told else reach
        ratio = max(reach / max(length, 1e-3), 0.1)
        _move_pivot(s, c, target, velocity, ratio)
    if s[FROZEN] == 0.0:
        # The tip goes back to its task no faster than the wrist may move.
        step = (norm(v_WP) * 1.5 + 0.2 * c.wrist_speed) * c.period
        tip = xyz(s, TIP)
        _put(s, TIP, plus(tip, limited(sub(p_WP, tip), step)))
    probing = s[PROBE] != PROBE_OFF and s[DONE] == 0.0
    s[SCALE] = 1.0
    if s[FROZEN] != 0.0 or not is_told or (c.code == _PWE and probing):
        s[SCALE] = 0.0
    elif c.code == _PWE:
        across_it = estimate.sigma_across / c.sure_across
        doubt = hypot(across_it, estimate.sigma_along / c.sure_along)
        s[SCALE] = max(c.slowest, 1.0 / max(doubt, 1.0))
    return s


@compiled
def command(s: Floats, wanted: ToolMotion) -> ToolMotion:
    """The instrument that a state of the law commands, for the task's tool."""
    still = s[FROZEN] != 0.0 or not finite_velocity(Velocity(wanted.v))
    v = _STILL if still else wanted.v
    tip = xyz(s, TIP)
    away = sub(tip, xyz(s, PIVOT))
    reach = norm(away)
    u = over(away, reach)
    du = over(across(sub(v, xyz(s, TURN)), u), reach)
    return ToolMotion(tip, u, v, du, s[TIME])


@compiled
def permission(s: Floats) -> Permission:
    """What a state of the law allows the task."""
    if s[FROZEN] != 0.0:
        return Permission(0.0, s[FROZEN])
    return Permission(s[SCALE], 0.0 if s[SCALE] > 0.0 else _PROBING)
