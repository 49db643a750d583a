"""The switching planner: one potential at a time, moving obstacles included.

The robot follows the goal's attractive potential until it would enter the
safety circle of an obstacle, then the involute-helicoid potential of one
obstacle and side, in that obstacle's frame, and never a sum. See
`systems.switching.arcs` for the choice among several obstacles and
`systems.switching.groups` for standing obstacles that touch.

Source: the thesis "Path planning locale per robot mobili basato su potenziali
artificiali alternati", after G. Fedele et al., "Obstacles avoidance based on
switching potential functions", J. Intell. Robot. Syst. 90(3), 2018. What the
thesis leaves open (senses, moving obstacles, groups) is worked out here.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from math import atan2, cos, hypot, inf, isfinite, pi, sin
from typing import NamedTuple

from systems.switching.arcs import (
    Obstacle,
    blocked_arcs,
    nearest_free,
    time_to_enter,
)
from systems.switching.groups import (
    first_on_ray,
    free_range,
    near,
    shorter_side,
    way_round,
)

ATTRACTIVE, BYPASS, GROUP, LEAVE, YIELD, UNREACHABLE = range(6)
SP=.2; F0=.2; AA=.4; NA=.5; A0=.3; A1=1.; H2=1.
MODES = ("attractive", "bypass", "group", "leave", "yield", "unreachable")
"""Names of the planner's states, by number."""


@dataclass
class SwitchingParams:
    """Parameters of the switching planner."""

    # Radius of the body [m].
    body_radius: float = 0.18
    # Speed of the body [m/s].
    speed: float = 0.5
    # Radius of vision R_v [m].
    vision: float = 3.0
    # Distances to keep from obstacles' surfaces [m], the preferred one first;
    # the next is taken where no heading keeps the one before.
    margins: list[float] = field(default_factory=lambda: [0.2, 0.1])
    # Fractions of the speed to try where no heading at full speed is free.
    slower: list[float] = field(default_factory=lambda: [0.5])
    # Obstacles that cannot be met within this time [s] do not matter.
    horizon: float = 6.0
    # The same for standing obstacles [s].
    standing_horizon: float = 2.5
    # Advantage of the obstacle and side chosen last [rad].
    hysteresis: float = 0.3
    # Advantage of passing behind an obstacle of the body's own speed [rad].
    behind_bias: float = 0.35
    # Standing obstacles that turn the body by more than this [rad] are a group.
    trap_turn: float = 1.4
    # An obstacle slower than this [m/s] stands.
    standing_speed: float = 0.05
    # A group is left once this [m] nearer to the goal than where it was met.
    leave_gain: float = 0.05
    # Speed per distance to the goal [1/s], near the goal.
    approach_gain: float = 2.0

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: If one is out of range; tells the range.
        """
        for name in (
            "body_radius",
            "speed",
            "vision",
            "horizon",
            "standing_horizon",
            "trap_turn",
            "approach_gain",
        ):
            value = getattr(self, name)
            if not (value > 0.0 and isfinite(value)):
                raise ValueError(f"{name}={value} must be positive and finite")
        for name in ("hysteresis", "behind_bias", "standing_speed", "leave_gain"):
            value = getattr(self, name)
            if not (value >= 0.0 and isfinite(value)):
                raise ValueError(f"{name}={value} must be at least 0 and finite")
        if not self.margins or min(self.margins) < 0.0:
            raise ValueError(f"margins={self.margins} must be distances >= 0, one or more")
        if any(not 0.0 < f < 1.0 for f in self.slower):
            raise ValueError(f"slower={self.slower} must be fractions between 0 and 1")


class SwitchingState(NamedTuple):
    """What the planner remembers from step to step."""

    # One of MODES.
    mode: float = 0.0
    # Identity of the obstacle followed; -1 for none.
    track: float = -1.0
    # Sense about it: +1 counter-clockwise, -1 clockwise.
    side: float = 1.0
    # How near to the goal the way straight to it leads before it meets the
    # group [m].
    hit_distance: float = inf
    # Where the body first touched the group's boundary [m].
    hit_x: float = 0.0
    hit_y: float = 0.0
    # -1 before that, 0 near that place, 1 away from it; how often it came back.
    away: float = -1.0
    laps: float = 0.0


class Plan(NamedTuple):
    """Velocity to take [m/s] and what to remember."""

    v_x: float
    v_y: float
    state: SwitchingState


def plan(
    params: SwitchingParams,
    state: SwitchingState,
    place: tuple[float, float],
    goal: tuple[float, float],
    obstacles: Sequence[Obstacle],
) -> Plan:
    vx, vy, state = plan_(params, state, place, goal, obstacles)
    v=hypot(vx,vy)
    if v>1e-6:
        limit = params.standing_speed**2
        standing = [o for o in obstacles if o[4] * o[4] + o[5] * o[5] <= limit]
        L=time_to_enter(*place, vx/v, vy/v, standing, params.body_radius+NA*params.margins[-1])
        m=max((2*AA*L)**.5,.1*params.speed)
        if m<v: vx*=m/v; vy*=m/v
    return Plan(vx,vy,state)


def plan_(
    params: SwitchingParams,
    state: SwitchingState,
    place: tuple[float, float],
    goal: tuple[float, float],
    obstacles: Sequence[Obstacle],
) -> Plan:
    """One step of the switching planner.

    Args:
        params: Parameters.
        state: State after the step before.
        place: Body's place [m].
        goal: Goal [m].
        obstacles: The obstacles in sight.
    """
    px, py = place
    gx, gy = goal[0] - px, goal[1] - py
    distance = hypot(gx, gy)
    if distance < 1e-9:
        return Plan(0.0, 0.0, SwitchingState())
    gx /= distance
    gy /= distance
    speed = min(params.speed, params.approach_gain * distance)
    if state.mode == GROUP or state.mode == UNREACHABLE:
        return _around_group(params, state, place, (gx, gy), distance, obstacles)
    if state.mode == LEAVE:
        step = _leave(params, state, place, (gx, gy), distance, obstacles)
        if step is not None:
            return step
    clearance = params.body_radius + params.margins[0]
    enters = time_to_enter(
        px, py, params.speed * gx, params.speed * gy, obstacles, clearance
    )
    if enters >= min(params.horizon, distance / params.speed):
        return Plan(speed * gx, speed * gy, SwitchingState(hit_distance=state.hit_distance))
    return _bypass(params, state, place, (gx, gy), distance, obstacles)


def _bypass(
    params: SwitchingParams,
    state: SwitchingState,
    place: tuple[float, float],
    g: tuple[float, float],
    distance: float,
    obstacles: Sequence[Obstacle],
) -> Plan:
    """Follows the free field nearest to the goal's, with the widest margin."""
    px, py = place
    gx, gy = g
    limit = params.standing_speed**2
    standing = [o for o in obstacles if o[4] * o[4] + o[5] * o[5] <= limit]
    moving = [o for o in obstacles if o[4] * o[4] + o[5] * o[5] > limit]
    wanted = atan2(gy, gx)
    rungs = [(margin, 1.0, 1.0) for margin in params.margins]
    rungs += [(params.margins[-1], 1.0, H2)]
    rungs += [(params.margins[-1], fraction, H2) for fraction in params.slower]
    trapped = False
    for margin, fraction, near_sight in rungs:
        speed = fraction * params.speed
        clearance = params.body_radius + margin
        if margin==params.margins[-1]: clearance+=0.5*SP*margin
        close = min(near_sight * params.standing_horizon * params.speed, distance)
        arcs = blocked_arcs(px, py, speed, standing, clearance, close / speed)
        if arcs:
            choice = nearest_free(arcs, wanted, speed, 0.0, params.hysteresis, state.track, state.side)
            if choice is None or choice[2] > params.trap_turn:
                trapped = True
                continue
        enters = time_to_enter(
            px, py, speed * gx, speed * gy, obstacles, clearance
        )
        if enters >= min(params.horizon, distance / speed):
            slow = min(speed, params.approach_gain * distance)
            mode = ATTRACTIVE if fraction == 1.0 else YIELD
            return Plan(slow * gx, slow * gy, SwitchingState(mode, hit_distance=state.hit_distance))
        arcs += blocked_arcs(px, py, speed, moving, clearance, params.horizon)
        choice = nearest_free(
            arcs,
            wanted,
            speed,
            params.behind_bias,
            params.hysteresis,
            state.track,
            state.side,
        )
        if choice is not None:
            _, heading, _, edge, side = choice
            mode = BYPASS if fraction == 1.0 else YIELD
            track = edge[0] if edge is not None else -1.0
            new = SwitchingState(mode, track, side, state.hit_distance)
            return Plan(speed * cos(heading), speed * sin(heading), new)
    if trapped:
        clearance = params.body_radius + params.margins[-1]*(1+.5*SP)
        member = first_on_ray(px, py, gx, gy, standing, clearance)
        if member is not None:
            clearance = params.body_radius + params.margins[-1]
            look_ahead = params.body_radius
            side = shorter_side(
                px, py, gx, gy, member, standing, clearance, look_ahead, SP*params.margins[-1]
            )
            free = free_range(px, py, gx, gy, standing, clearance + 0.5*SP*params.margins[-1], params.vision)
            new = SwitchingState(GROUP, member[0], side, min(distance - free, state.hit_distance))
            return _around_group(params, new, place, g, distance, obstacles)
    return _least_bad(params, state, place, wanted, obstacles)


def _leave(
    params: SwitchingParams,
    state: SwitchingState,
    place: tuple[float, float],
    g: tuple[float, float],
    distance: float,
    obstacles: Sequence[Obstacle],
) -> Plan | None:
    """Goes straight to the goal until nearer to it than any place before."""
    px, py = place
    gx, gy = g
    if distance <= state.hit_distance + 0.05:
        return None
    clearance = params.body_radius + params.margins[-1]
    speed = min(params.speed, params.approach_gain * distance)
    limit = params.standing_speed**2
    standing = [o for o in obstacles if o[4] * o[4] + o[5] * o[5] <= limit]
    moving = [o for o in obstacles if o[4] * o[4] + o[5] * o[5] > limit]
    if time_to_enter(px, py, gx, gy, standing, clearance+ 0.5*SP*params.margins[-1]) < params.body_radius:
        return None
    if time_to_enter(px, py, speed * gx, speed * gy, moving, clearance) < params.horizon:
        return None
    return Plan(speed * gx, speed * gy, state)


def _around_group(
    params: SwitchingParams,
    state: SwitchingState,
    place: tuple[float, float],
    g: tuple[float, float],
    distance: float,
    obstacles: Sequence[Obstacle],
) -> Plan:
    """Follows the group's boundary until the goal's ray is free far enough."""
    px, py = place
    gx, gy = g
    clearance = params.body_radius + params.margins[-1]
    # Others stand near a group's boundary: they are passed with half the margin.
    narrow = params.body_radius + 0.5 * params.margins[-1]
    limit = params.standing_speed**2
    standing = [o for o in obstacles if o[4] * o[4] + o[5] * o[5] <= limit]
    moving = [o for o in obstacles if o[4] * o[4] + o[5] * o[5] > limit]
    free = free_range(px, py, gx, gy, standing, clearance + 0.5*SP*params.margins[-1], params.vision)
    member = next((o for o in standing if o[0] == state.track), None)
    gone = member is None
    leaves = free > min(distance, F0) and (
        distance - free < state.hit_distance - params.leave_gain
    )
    if gone or leaves:
        fresh = SwitchingState(ATTRACTIVE if gone else LEAVE, -1.0, 1.0, state.hit_distance if gone else distance - free)
        return plan(params, fresh, place, (px + distance * gx, py + distance * gy), obstacles)
    look_ahead = params.body_radius
    ex, ey, member, straight = way_round(
        px, py, member, state.side, standing, clearance, look_ahead, SP*params.margins[-1]
    )
    state = state._replace(track=member[0])
    state = _count_laps(state, px, py, member, clearance)
    speed = params.speed
    if state.mode == UNREACHABLE:
        ex, ey = 0.0, 0.0
    enters = time_to_enter(px, py, speed * ex, speed * ey, moving, clearance)
    hits = time_to_enter(px, py, speed * ex, speed * ey, standing, narrow)
    ahead = min(max(straight / speed, A0), A1)
    if enters >= params.horizon and hits >= ahead:
        return Plan(speed * ex, speed * ey, state)
    arcs = blocked_arcs(px, py, speed, moving, clearance, params.horizon)
    arcs += blocked_arcs(px, py, speed, standing, narrow, ahead)
    wanted = atan2(ey, ex)
    choice = nearest_free(
        arcs, wanted, speed, params.behind_bias, params.hysteresis, -1.0, 1.0
    )
    if choice is not None:
        return Plan(speed * cos(choice[1]), speed * sin(choice[1]), state)
    return _least_bad(params, state, place, wanted, obstacles)


def _count_laps(
    state: SwitchingState, px: float, py: float, member: Obstacle, clearance: float
) -> SwitchingState:
    """Notes that the body comes round the group; twice is enough."""
    if state.away < 0.0:
        if near(px, py, member[1], member[2], member[3] + 1.2 * clearance):
            return state._replace(hit_x=px, hit_y=py, away=0.0)
    elif state.away == 0.0:
        if not near(px, py, state.hit_x, state.hit_y, 3.0 * clearance):
            return state._replace(away=1.0)
    elif near(px, py, state.hit_x, state.hit_y, clearance):
        laps = state.laps + 1.0
        mode = UNREACHABLE if laps >= 2.0 else GROUP
        return state._replace(away=0.0, laps=laps, mode=float(mode))
    return state


def _least_bad(
    params: SwitchingParams,
    state: SwitchingState,
    place: tuple[float, float],
    wanted: float,
    obstacles: Sequence[Obstacle],
) -> Plan:
    """Where nothing is free: the velocity that meets an obstacle last."""
    px, py = place
    best = (-1.0, 0.0, 0.0)
    for k in range(17):
        heading = wanted + k * pi / 8.0
        speed = params.speed if k < 16 else 0.0
        vx, vy = speed * cos(heading), speed * sin(heading)
        t = time_to_enter(px, py, vx, vy, obstacles, params.body_radius)
        if t > best[0]:
            best = (min(t, 0.5 * params.horizon), vx, vy)
    mode = GROUP if state.mode == GROUP else YIELD
    return Plan(best[1], best[2], state._replace(mode=float(mode)))
