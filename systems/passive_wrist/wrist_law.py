"""The emulation's law over plain floats: pivot, probe, freeze, speed (section 3).

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
from math import dist, exp, hypot, pi, sqrt

from systems.passive_wrist.wall_model import Vector, dot, lateral_basis

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


@dataclass
class WristInput:
    """What the law reads at one instant; vectors in W, SI units.

    Attributes:
        p_WP: Task's tip now.
        v_WP: Its velocity.
        p_WS: Sensor's origin.
        u: Shaft's unit vector.
        f: The wall's force on the shaft.
        valid: Whether the sensor is alive and not saturated.
        p_WI: The fulcrum `horizon` ahead (estimated, or true for `known`).
        v_WI: Its velocity.
        stiffness: Believed stiffness.
        stiffness_sigma: Standard deviation of its logarithm.
        sigma_across: Of the estimate across the shaft.
        sigma_along: Of the estimate along the shaft.
    """

    p_WP: Vector
    v_WP: Vector
    p_WS: Vector
    u: Vector
    f: Vector
    valid: bool
    p_WI: Vector
    v_WI: Vector
    stiffness: float
    stiffness_sigma: float
    sigma_across: float
    sigma_along: float


class WristLaw:
    """The law; everything it remembers is a list of `size` floats.

    Layout: pivot (3), its velocity (3), commanded tip (3), filtered spring
    offset (3), and the scalars whose places are named above.
    """

    size = 25

    def __init__(self, params: WristParams) -> None:
        params.check()
        self.p = params

    def initial(self) -> list[float]:
        """The state before the first update."""
        state = [0.0] * self.size
        state[WAY] = 1.0
        return state

    def step(self, state: list[float], i: WristInput) -> list[float]:
        """The next state."""
        s = list(state)
        p = self.p
        dt = p.period
        force = sqrt(max(dot(i.f, i.f) - dot(i.f, i.u) ** 2, 0.0))
        self._watch(s, force, i.valid)
        target, velocity = self._pivot(s, i)
        if p.mode == "pwe" and p.probe:
            target, velocity = self._probe(s, i, target, velocity)
        if s[STARTED] == 0.0:
            s[0:3], s[3:6], s[6:9] = target, velocity, i.p_WP
            s[STARTED] = 1.0
        else:
            reach, length = dist(i.p_WP, s[0:3]), dist(i.p_WP, i.p_WS)
            ratio = max(reach / max(length, 1e-3), 0.1)
            self._move_pivot(s, target, velocity, ratio)
        if s[FROZEN] == 0.0:
            # The tip goes back to its task no faster than the wrist may move.
            away = [i.p_WP[k] - s[6 + k] for k in (0, 1, 2)]
            far = sqrt(dot(away, away))
            step = (sqrt(dot(i.v_WP, i.v_WP)) * 1.5 + 0.2 * p.wrist_speed) * dt
            share = 1.0 if far <= step else step / far
            for k in (0, 1, 2):
                s[6 + k] += share * away[k]
        s[SCALE] = self._scale(s, i)
        return s

    def pose(self, state: list[float], v_WP: Vector) -> list[float]:
        """Desired instrument: p_WP, u_W, v_WP, du_W (12)."""
        pivot, dpivot, tip = state[0:3], state[3:6], state[6:9]
        frozen = state[FROZEN] != 0.0
        v = [0.0, 0.0, 0.0] if frozen else list(v_WP)
        away = [tip[k] - pivot[k] for k in (0, 1, 2)]
        reach = sqrt(dot(away, away))
        u = [a / reach for a in away]
        turn = [v[k] - dpivot[k] for k in (0, 1, 2)]
        along = dot(turn, u)
        du = [(turn[k] - along * u[k]) / reach for k in (0, 1, 2)]
        return [*tip, *u, *v, *du]

    def _pivot(self, s: list[float], i: WristInput) -> tuple[list[float], list[float]]:
        """Where the mode wants the pivot."""
        p = self.p
        still = [0.0, 0.0, 0.0]
        guess = p.guess or [0.0, 0.0, 0.0]
        if p.mode == "off":
            return list(guess), still
        if p.mode == "spring":
            share = 1.0 - exp(-2.0 * pi * p.spring_bandwidth * p.period)
            along = dot(i.f, i.u)
            for k in (0, 1, 2):
                offset = (i.f[k] - along * i.u[k]) / p.spring_stiffness
                s[9 + k] += share * (offset - s[9 + k])
            depth = sum(i.u[k] * (guess[k] - i.p_WS[k]) for k in (0, 1, 2))
            return [i.p_WS[k] + depth * i.u[k] + s[9 + k] for k in (0, 1, 2)], still
        return list(i.p_WI), list(i.v_WI)

    def _move_pivot(
        self, s: list[float], target: Vector, velocity: Vector, ratio: float
    ) -> None:
        """Moves the pivot to its target within the wrist's limits.

        What is fed forward is the target's own velocity: a difference of two
        estimates would send their noise twice. Only while the pivot cannot keep up
        it is the pivot's.
        """
        p, dt = self.p, self.p.period
        fastest = p.wrist_speed * ratio
        hardest = p.wrist_acceleration * ratio
        error = [target[k] - s[k] for k in (0, 1, 2)]
        over = [error[k] / dt - velocity[k] for k in (0, 1, 2)]
        excess = sqrt(dot(over, over))
        braking = sqrt(2.0 * hardest * sqrt(dot(error, error)))
        if excess <= max(hardest * dt, 0.2 * fastest):  # keeps up
            s[0:3], s[3:6] = target, velocity
            return
        # Approaches no faster than it can brake, than the wrist may move, and than
        # it can speed up.
        share = min(1.0, braking / excess)
        wanted = [velocity[k] + share * over[k] for k in (0, 1, 2)]
        speed = sqrt(dot(wanted, wanted))
        if speed > fastest:
            wanted = [w * fastest / speed for w in wanted]
        change = [wanted[k] - s[3 + k] for k in (0, 1, 2)]
        size = sqrt(dot(change, change))
        share = min(1.0, hardest * dt / size) if size > 0.0 else 1.0
        for k in (0, 1, 2):
            s[3 + k] += share * change[k]
            s[k] += s[3 + k] * dt

    def _probe(
        self, s: list[float], i: WristInput, target: list[float], velocity: list[float]
    ) -> tuple[list[float], list[float]]:
        """Adds the probing move to the pivot's target."""
        p = self.p
        dt = p.period
        if s[DONE] == 1.0 or not i.valid:
            return target, velocity
        known = i.stiffness_sigma < 0.15 and i.sigma_along < 1.5e-3
        if s[PROBE] == PROBE_OFF:
            s[PROBE] = PROBE_ON if i.stiffness_sigma > 0.3 else PROBE_BACK
        s[PROBED] += dt
        if known or s[PROBED] > p.probe_time:
            s[PROBE] = PROBE_BACK
        e = lateral_basis(i.u)[0]
        speed = min(p.probe_speed, p.probe_force_rate / i.stiffness)
        offset, way = s[OFFSET], s[WAY]
        move = 0.0
        if s[PROBE] == PROBE_BACK:
            move = max(-speed * dt, min(speed * dt, -offset))
            if offset + move == 0.0:
                s[DONE] = 1.0
        elif -dot(i.f, e) * way >= p.probe_force or offset * way >= p.probe_travel:
            s[DWELL] += dt
            if s[DWELL] > 0.1:
                s[WAY], s[DWELL] = -way, 0.0
        else:
            move = way * speed * dt
        s[OFFSET] = offset + move
        for k in (0, 1, 2):
            target[k] += s[OFFSET] * e[k]
            velocity[k] += move / dt * e[k]
        return target, velocity

    def _watch(self, s: list[float], force: float, valid: bool) -> None:
        """Freezes and releases the task."""
        p = self.p
        dt = p.period
        s[OVER] = s[OVER] + dt if valid and force > p.force_limit else 0.0
        s[SILENT] = 0.0 if valid else s[SILENT] + dt
        calm = valid and force < p.release_force
        s[CALM] = s[CALM] + dt if calm else 0.0
        if s[FROZEN] != 0.0:
            if s[CALM] >= p.release_time:
                s[FROZEN] = 0.0
        elif s[OVER] >= p.force_limit_time:
            s[FROZEN] = 1.0
            s[FREEZES] += 1.0
        elif s[SILENT] > p.sensor_timeout:
            s[FROZEN] = 2.0
            s[FREEZES] += 1.0

    def _scale(self, s: list[float], i: WristInput) -> float:
        """Share of the task's speed that is safe now."""
        p = self.p
        if s[FROZEN] != 0.0:
            return 0.0
        if p.mode != "pwe":
            return 1.0
        if s[PROBE] != PROBE_OFF and s[DONE] == 0.0:
            return 0.0
        doubt = hypot(i.sigma_across / p.sure_across, i.sigma_along / p.sure_along)
        return 1.0 if doubt <= 1.0 else max(p.slowest, 1.0 / doubt)
