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
  from);
- the *freeze*: over the force limit the task's tip stands still while the pivot
  goes on relaxing the wall.
"""

from dataclasses import dataclass
from math import exp, hypot, pi, sqrt

import numpy as np

from systems.common.compiled import compiled, packed
from systems.common.geometry import dot, norm, sub, xyz
from systems.passive_wrist.wall_model import lateral_basis

MODES = ("pwe", "spring", "off", "known")
PROBE_OFF, PROBE_ON, PROBE_BACK = 0.0, 1.0, 2.0
STARTED = 12  # 1 once the law has begun
FROZEN = 13  # 1 for force, 2 for a lost sensor
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


@dataclass
class WristParams:
    """How the wrist is emulated.

    Attributes:
        mode: `pwe` (estimated fulcrum), `spring` (the printed law: the first
            guess corrected by force over a fixed stiffness), `off` (the first
            guess for ever) or `known` (told the true fulcrum).
        guess: First guess of the fulcrum p_WI, in m; used by `spring` and `off`.
        spring_stiffness: Fixed stiffness of `spring`, in N/m.
        spring_bandwidth: Its low-pass filter, in Hz.
        horizon: How far ahead the fulcrum is predicted, in s: the lag between
            this command and the arm's motion.
        wrist_speed: Limit of the relaxing motion at the sensor, in m/s.
        wrist_acceleration: In m/s^2.
        probe: Whether the probing move is made when the stiffness is unknown.
        probe_force: Its force limit, in N.
        probe_travel: Its limit of travel at the fulcrum, in m.
        probe_speed: At the fulcrum, in m/s.
        probe_force_rate: Bound on its speed times the believed stiffness, in N/s.
        probe_time: It ends after this time at the latest, in s.
        warning_force: Lateral force that is reported, in N.
        force_limit: Lateral force that freezes the task, in N.
        force_limit_time: If it lasts this long, in s.
        release_force: The task goes on below this force, in N ...
        release_time: ... if that lasts this long, in s.
        sensor_timeout: A sensor silent or saturated for this long freezes, in s.
        sure_across: Lateral sigma up to which the task keeps full speed, in m.
        sure_along: The same along the shaft, in m.
        slowest: Smallest speed scale while the task moves.
        period: Of the updates, in s.
    """

    mode: str = "pwe"
    guess: list[float] | None = None
    spring_stiffness: float = 2000.0
    spring_bandwidth: float = 5.0
    horizon: float = 0.0
    wrist_speed: float = 0.25
    wrist_acceleration: float = 5.0
    probe: bool = True
    probe_force: float = 1.0
    probe_travel: float = 0.012
    probe_speed: float = 0.03
    probe_force_rate: float = 15.0
    probe_time: float = 1.5
    warning_force: float = 3.0
    force_limit: float = 5.0
    force_limit_time: float = 0.3
    release_force: float = 1.0
    release_time: float = 0.2
    sensor_timeout: float = 0.05
    sure_across: float = 1e-3
    sure_along: float = 5e-3
    slowest: float = 0.25
    period: float = 1.0 / 120.0

    def check(self) -> None:
        """Raises ValueError naming the first field that makes no sense."""
        if self.mode not in MODES:
            raise ValueError(
                f"passive wrist: mode={self.mode!r} is unknown; "
                f"choose one of {', '.join(MODES)}"
            )
        for name, value in vars(self).items():
            if name in ("mode", "guess", "probe"):
                continue
            zero_ok = name in ("horizon", "slowest", "sensor_timeout")
            if not (value > 0.0 or (zero_ok and value == 0.0)):
                raise ValueError(f"passive wrist: {name}={value} must be > 0")
        if not 10.0 <= self.spring_stiffness <= 2e4:
            raise ValueError(
                f"passive wrist: spring_stiffness={self.spring_stiffness} N/m is no "
                "abdominal wall's; expected 10 to 20000 (100 to 3000 is usual)"
            )
        if self.guess is not None and len(self.guess) != 3:
            raise ValueError(
                f"passive wrist: guess={self.guess} must be 3 numbers in m"
            )


SIZE = 26
"""Length of the law's state: pivot (3), its velocity (3), commanded tip (3), filtered
spring offset (3), the scalars whose places are named above, and the time."""

_basis = compiled(lateral_basis)
_PWE, _SPRING, _OFF, _KNOWN = range(4)  # places in MODES
Floats = np.ndarray


def initial(params: WristParams) -> np.ndarray:
    """The law's state before the first update."""
    state = np.zeros(SIZE)
    state[WAY], state[TIME] = 1.0, -params.period
    return state


def constants(params: WristParams) -> np.ndarray:
    """The parameters as the compiled law takes them.

    Raises:
        ValueError: If one of them makes no sense.
    """
    params.check()
    first = np.array(params.guess or [0.0, 0.0, 0.0])
    return packed(params, code=float(MODES.index(params.mode)), first=first)


@compiled
def _watch(s: Floats, c, force: float, valid: bool) -> None:  # type: ignore[no-untyped-def]
    """Freezes and releases the task."""
    dt = c.period
    s[OVER] = s[OVER] + dt if valid and force > c.force_limit else 0.0
    s[SILENT] = 0.0 if valid else s[SILENT] + dt
    s[CALM] = s[CALM] + dt if valid and force < c.release_force else 0.0
    if s[FROZEN] != 0.0:
        if s[CALM] >= c.release_time:
            s[FROZEN] = 0.0
    elif s[OVER] >= c.force_limit_time:
        s[FROZEN] = 1.0
        s[FREEZES] += 1.0
    elif s[SILENT] > c.sensor_timeout:
        s[FROZEN] = 2.0
        s[FREEZES] += 1.0


@compiled
def _spring(s: Floats, c, shaft: Floats, f: Floats, valid: bool) -> Floats:  # type: ignore[no-untyped-def]
    """The printed law: the first guess's depth, the force over a fixed stiffness."""
    u = shaft[3:6]
    share = 1.0 - exp(-2.0 * pi * c.spring_bandwidth * c.period) if valid else 0.0
    push = f[0] * u[0] + f[1] * u[1] + f[2] * u[2]
    depth = 0.0
    for k in range(3):
        offset = (f[k] - push * u[k]) / c.spring_stiffness
        s[9 + k] += share * (offset - s[9 + k])
        depth += u[k] * (c.first[k] - shaft[k])
    return shaft[0:3] + depth * u + s[9:12]


@compiled
def _probe(s: Floats, c, u: Floats, f: Floats, estimate: Floats):  # type: ignore[no-untyped-def]
    """The probing move: what it adds to the pivot and to its velocity."""
    dt = c.period
    if s[PROBE] == PROBE_OFF:
        s[PROBE] = PROBE_ON if estimate[9] > 0.3 else PROBE_BACK
    s[PROBED] += dt
    if (estimate[9] < 0.15 and estimate[7] < 1.5e-3) or s[PROBED] > c.probe_time:
        s[PROBE] = PROBE_BACK
    e, _ = _basis(u)
    speed = min(c.probe_speed, c.probe_force_rate / estimate[8])
    offset, way, move = s[OFFSET], s[WAY], 0.0
    back = -(f[0] * e[0] + f[1] * e[1] + f[2] * e[2])
    if s[PROBE] == PROBE_BACK:
        move = max(-speed * dt, min(speed * dt, -offset))
        if offset + move == 0.0:
            s[DONE] = 1.0
    elif back * way >= c.probe_force or offset * way >= c.probe_travel:
        s[DWELL] += dt
        if s[DWELL] > 0.1:
            s[WAY], s[DWELL] = -way, 0.0
    else:
        move = way * speed * dt
    s[OFFSET] = offset + move
    side = np.array(e)
    return s[OFFSET] * side, move / dt * side


@compiled
def _move_pivot(s: Floats, c, target: Floats, velocity: Floats, ratio: float) -> None:  # type: ignore[no-untyped-def]
    """Moves the pivot to its target within the wrist's limits.

    What is fed forward is the target's own velocity: a difference of two estimates
    would send their noise twice. Only while the pivot cannot keep up it is the
    pivot's.
    """
    dt = c.period
    fastest, hardest = c.wrist_speed * ratio, c.wrist_acceleration * ratio
    error = sub(xyz(target, 0), xyz(s, 0))
    over = (
        error[0] / dt - velocity[0],
        error[1] / dt - velocity[1],
        error[2] / dt - velocity[2],
    )
    excess = norm(over)
    if excess <= max(hardest * dt, 0.2 * fastest):  # keeps up
        s[0:3], s[3:6] = target, velocity
        return
    # Approaches no faster than it can brake, than the wrist may move, and than it
    # can speed up.
    share = min(1.0, sqrt(2.0 * hardest * norm(error)) / excess)
    wanted = velocity + share * np.array(over)
    speed = norm(xyz(wanted, 0))
    if speed > fastest:
        wanted = wanted * (fastest / speed)
    change = wanted - s[3:6]
    size = norm(xyz(change, 0))
    s[3:6] += min(1.0, hardest * dt / max(size, 1e-12)) * change
    s[0:3] += s[3:6] * dt


@compiled
def next_state(
    law: Floats,
    old: Floats,
    tool: Floats,
    shaft: Floats,
    wrench: Floats,
    estimate: Floats,
    truth: Floats,
    time: float,
) -> Floats:
    """The law's next state.

    Args:
        law: What `constants` returns.
        old: State (26).
        tool: The task's p_WP, u, v_WP, du and their time (13).
        shaft: p_WS, u, v_WS, du (12).
        wrench: f, m, and 1 if they are valid (7).
        estimate: As the fulcrum estimator emits it (14).
        truth: The true p_WI and v_WI (6), for `known`.
        time: In s.
    """
    c = law[0]
    s = old.copy()
    s[TIME] = time
    p_WP, v_WP = s[6:9].copy(), np.zeros(3)  # hold still without a number
    if np.isfinite(tool).all():
        p_WP, v_WP = tool[0:3] + (time - tool[12]) * tool[6:9], tool[6:9].copy()
    valid = bool(wrench[6] > 0.5 and np.isfinite(wrench).all())
    u, f = shaft[3:6], wrench[0:3] if valid else np.zeros(3)
    push = dot(xyz(f, 0), xyz(u, 0))
    force = sqrt(max(dot(xyz(f, 0), xyz(f, 0)) - push**2, 0.0))
    _watch(s, c, force, valid)
    seen = truth if c.code == _KNOWN else estimate
    target, velocity = seen[0:3] + c.horizon * seen[3:6], seen[3:6].copy()
    if c.code == _OFF or c.code == _SPRING:
        velocity[:] = 0.0
        if c.code == _OFF:
            target[:] = c.first
        else:
            target[:] = _spring(s, c, shaft, f, valid)
    if c.code == _PWE and c.probe and s[DONE] == 0.0 and valid:
        more, faster = _probe(s, c, u, f, estimate)
        target, velocity = target + more, velocity + faster
    if s[STARTED] == 0.0:
        s[0:3], s[3:6], s[6:9], s[STARTED] = target, velocity, p_WP, 1.0
    else:
        reach = norm(sub(xyz(p_WP, 0), xyz(s, 0)))
        length = norm(sub(xyz(p_WP, 0), xyz(shaft, 0)))
        ratio = max(reach / max(length, 1e-3), 0.1)
        _move_pivot(s, c, target, velocity, ratio)
    if s[FROZEN] == 0.0:
        # The tip goes back to its task no faster than the wrist may move.
        away = p_WP - s[6:9]
        far = norm(xyz(away, 0))
        step = (norm(xyz(v_WP, 0)) * 1.5 + 0.2 * c.wrist_speed) * c.period
        s[6:9] += (1.0 if far <= step else step / far) * away
    probing = s[PROBE] != PROBE_OFF and s[DONE] == 0.0
    s[SCALE] = 1.0
    if s[FROZEN] != 0.0 or (c.code == _PWE and probing):
        s[SCALE] = 0.0
    elif c.code == _PWE:
        doubt = hypot(estimate[6] / c.sure_across, estimate[7] / c.sure_along)
        s[SCALE] = max(c.slowest, 1.0 / max(doubt, 1.0))
    return s


@compiled
def command(s: Floats, tool: Floats) -> Floats:
    """Desired instrument: p_WP, u_W, v_WP, du_W, and the time they hold at (13)."""
    v = tool[6:9].copy()
    if s[FROZEN] != 0.0 or not np.isfinite(v).all():
        v[:] = 0.0
    away = s[6:9] - s[0:3]
    reach = norm(xyz(away, 0))
    u = away / reach
    turn = v - s[3:6]
    out = np.empty(13)
    out[0:3], out[3:6], out[6:9], out[12] = s[6:9], u, v, s[TIME]
    out[9:12] = (turn - dot(xyz(turn, 0), xyz(u, 0)) * u) / reach
    return out
