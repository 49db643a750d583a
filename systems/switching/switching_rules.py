"""The switching planner: one potential at a time, moving obstacles included.

The body follows the goal's attractive potential until it would enter the safety
circle of an obstacle, then the involute-helicoid potential of one obstacle and one
side, in that obstacle's frame, and never a sum. See `arcs` for the choice among
several obstacles and `groups` for standing obstacles that touch.

Source: the thesis "Path planning locale per robot mobili basato su potenziali
artificiali alternati", after G. Fedele et al., "Obstacles avoidance based on
switching potential functions", J. Intell. Robot. Syst. 90(3), 2018. What the thesis
leaves open (senses, moving obstacles, groups, leaving) is worked out here.
"""

from collections.abc import Sequence
from math import atan2, cos, hypot, inf, isfinite, pi, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from systems.common.compiled import compiled
from systems.common.signal import reader
from systems.switching.arcs import (
    DISC_SIZE,
    Disc,
    blocked_arcs,
    nearest_free,
    read_disc,
    time_to_enter,
    write_disc,
)
from systems.switching.caution import cautious, read_corner
from systems.switching.evasion import HOLONOMIC, Body, Evasion, evasion
from systems.switching.groups import (
    first_on_ray,
    free_range,
    shorter_side,
    way_round,
)
from systems.switching.heading_law import UnicycleControlParams
from systems.switching.heading_law import constants as law_constants
from systems.switching.signals import Corner, Seen
from systems.switching.switching_state import (
    ATTRACTIVE,
    BYPASS,
    GROUP,
    LEAVE,
    START,
    UNREACHABLE,
    YIELD,
    Plan,
    Sight,
    SwitchingParams,
    SwitchingState,
    constants,
)

Point = tuple[float, float]
read_seen = reader(Seen)
LAW = law_constants(UnicycleControlParams())[0]
CHANGES = 8
"""How often a step may go from one state to another; then it takes the least bad."""


class Step(NamedTuple):
    """What a rule says: whether it is the step's end, velocity [m/s] and state."""

    ends: bool
    v_x: float
    v_y: float
    state: SwitchingState


def plan(
    params: SwitchingParams,
    state: SwitchingState,
    place: Point,
    velocity: Point,
    goal: Point,
    obstacles: Sequence[Seen],
    corners: Sequence[Corner] = (),
    body: Body = HOLONOMIC,
) -> Plan:
    """One step of the switching planner.

    Args:
        params: Parameters.
        state: State after the step before.
        place: Where the body is [m].
        velocity: How it moves [m/s].
        goal: Where it shall go [m].
        obstacles: The obstacles in sight.
        corners: Edges behind which somebody may be.
        body: How it stands; one that goes any way at once by default.

    Returns:
        The velocity to take, and what to remember.

    Raises:
        ParameterError: If a parameter is out of range.
        ValueError: If a number is not finite.
    """
    if not isfinite(sum(place) + sum(velocity) + sum(goal)):
        raise ValueError(f"place={place}, velocity={velocity}, goal={goal}: not finite")
    lost = [one for one in (*obstacles, *corners) if not isfinite(sum(one))]
    if lost:
        raise ValueError(f"obstacles {lost}: not finite")
    record, state = constants(params)[0], SwitchingState(*map(float, state))
    told = rows(obstacles, corners)
    return planned(record, LAW, state, place, velocity, goal, *told, body)


def rows(
    obstacles: Sequence[Seen], corners: Sequence[Corner]
) -> tuple[np.ndarray, np.ndarray]:
    """Obstacles and corners as `planned` takes them."""
    told = np.array(obstacles, float).reshape(-1, len(Seen._fields))
    return told, np.array(corners, float).reshape(-1, len(Corner._fields))


@compiled
def planned(
    params: Any,
    law: Any,
    state: SwitchingState,
    place: Point,
    velocity: Point,
    goal: Point,
    seen: np.ndarray,
    corners: np.ndarray,
    body: Body,
) -> Plan:
    """As `plan`, of numbers that are finite.

    Args:
        params: A record of `constants`.
        law: One of the wheels' control law.
        state: State after the step before.
        place: Where the body is [m].
        velocity: How it moves [m/s].
        goal: Where it shall go [m].
        seen: Rows of `Seen`; those of a track below 0 hold nothing.
        corners: Rows of `Corner`; not all need be there.
        body: How the body stands.
    """
    ahead, flee_x, flee_y = params.response, state.flee_x, state.flee_y
    (px, py), (vx, vy), (gx, gy) = place, velocity, goal
    px, py = px + ahead * vx, py + ahead * vy
    gx, gy = gx - px, gy - py
    distance = hypot(gx, gy)
    if distance < 1e-9:
        return Plan(0.0, 0.0, START, False, False)
    discs, stand, end, fastest = _discs(params, px, py, seen, corners)
    sight = Sight(
        px,
        py,
        gx / distance,
        gy / distance,
        distance,
        discs[:stand],
        discs[:end],
        discs[end:],
    )
    vx, vy, state = _step(params, _fleeing(state, 0.0, 0.0), sight)
    if stand:
        vx, vy = _slow_down(params, sight, vx, vy)
    vx, vy = cautious(params, sight, corners, vx, vy)
    clearance = params.body_radius + params.margin
    meets = time_to_enter(0.0, 0.0, sight.moving, clearance)
    outrun = fastest >= params.speed * params.speed
    wanted = Evasion(False, vx, vy, meets < params.retreat_time)
    if params.foresight > 0.0 and isfinite(body.theta):
        wanted = evasion(params, law, sight, body, wanted, flee_x, flee_y)
    if wanted.needed:
        state = _fleeing(state, wanted.v_x, wanted.v_y)
    return Plan(wanted.v_x, wanted.v_y, state, outrun, wanted.retreat)


@compiled
def _discs(
    params: Any, px: float, py: float, seen: np.ndarray, corners: np.ndarray
) -> tuple[np.ndarray, int, int, float]:
    """Rows of `Disc`: what stands, corners, what moves.

    Returns:
        The rows, the first of the corners and the first that moves, and the square of
        the fastest speed.
    """
    discs = np.empty((len(seen) + len(corners), DISC_SIZE))
    moving = np.empty((len(seen), DISC_SIZE))
    slow, fastest = params.standing_speed * params.standing_speed, 0.0
    count = movers = 0
    for i in range(len(seen)):
        o = read_seen(seen[i])
        if o.track < 0.0:
            continue
        ww = o.v_x * o.v_x + o.v_y * o.v_y
        if ww > slow:
            ahead = params.response
            qx, qy = px - (o.x + ahead * o.v_x), py - (o.y + ahead * o.v_y)
            write_disc(moving, movers, Disc(o.track, qx, qy, o.radius, o.v_x, o.v_y))
            movers += 1
            fastest = max(fastest, ww)
        else:
            disc = Disc(o.track, px - o.x, py - o.y, o.radius, 0.0, 0.0)
            write_disc(discs, count, disc)
            count += 1
    stand = count
    for i in range(len(corners)):
        corner = read_corner(corners[i])
        if corner.there > 0.0:
            disc = Disc(-2.0, px - corner.x, py - corner.y, 0.0, 0.0, 0.0)
            write_disc(discs, count, disc)
            count += 1
    discs[count : count + movers] = moving[:movers]
    return discs[: count + movers], stand, count, fastest


@compiled
def _step(
    params: Any, state: SwitchingState, sight: Sight
) -> tuple[float, float, SwitchingState]:
    """The state's own rule; velocity [m/s] and state."""
    for _ in range(CHANGES):
        if state.mode == GROUP or state.mode == UNREACHABLE:
            step = _follow_group(params, state, sight)
        elif state.mode == LEAVE and _leaves_straight(params, state, sight):
            step = _to_goal(params, sight, params.speed, state)
        elif _is_clear(params, sight, params.speed, params.body_radius + params.margin):
            if state.mode != ATTRACTIVE:
                state = _anew(ATTRACTIVE, state.best)
            step = _to_goal(params, sight, params.speed, state)
        else:
            step = _bypass(params, state, sight)
        if step.ends:
            return step.v_x, step.v_y, step.state
        state = step.state
    step = _least_bad(params, state, sight, atan2(sight.gy, sight.gx))
    return step.v_x, step.v_y, step.state


@compiled
def _anew(mode: int, best: float) -> SwitchingState:
    """A state of a mode that remembers nothing but how near a straight way has led."""
    return _changed(START, float(mode), START.track, START.side, best, START.heading)


@compiled
def _changed(
    state: SwitchingState,
    mode: float,
    track: float,
    side: float,
    best: float,
    heading: float,
) -> SwitchingState:
    """A state that remembers the same way about a group."""
    hit, laps = (state.hit_x, state.hit_y, state.away), state.laps
    return SwitchingState(mode, track, side, best, *hit, laps, heading, 0.0, 0.0)


@compiled
def _is_clear(params: Any, sight: Sight, speed: float, clearance: float) -> bool:
    """Whether the straight way to the goal enters no safety circle."""
    vx, vy = speed * sight.gx, speed * sight.gy
    enters = _enters(vx, vy, sight, clearance)
    return enters >= min(params.horizon, sight.distance / speed)


@compiled
def _enters(vx: float, vy: float, sight: Sight, clearance: float) -> float:
    """Time until anything that stands or moves is met [s]."""
    standing = time_to_enter(vx, vy, sight.standing, clearance)
    return min(standing, time_to_enter(vx, vy, sight.moving, clearance))


@compiled
def _to_goal(params: Any, sight: Sight, speed: float, state: SwitchingState) -> Step:
    """The attractive field (equation 2), its size limited to the speed."""
    speed = min(speed, params.approach_gain * sight.distance)
    return Step(True, speed * sight.gx, speed * sight.gy, state)


@compiled
def _bypass(params: Any, state: SwitchingState, sight: Sight) -> Step:
    """The free field nearest to the goal's, with the widest margin that leaves one."""
    wanted = atan2(sight.gy, sight.gx)
    close = min(params.standing_horizon * params.speed, sight.distance)
    trapped = False
    bypasses = state.mode == BYPASS or state.mode == YIELD
    commitment = params.commitment if bypasses else 0.0
    memory = (params.hysteresis, state.track, state.side, commitment, state.heading)
    away = Step(False, 0.0, 0.0, state)
    for rung in range(len(params.rungs)):
        margin, speed = params.rungs[rung, 0], params.rungs[rung, 1]
        clearance = params.body_radius + margin
        if margin == params.least:
            clearance += 0.5 * params.closed_gap
        walls = blocked_arcs(speed, sight.solid, clearance, close / speed)
        if len(walls):
            turn = nearest_free(walls, wanted, speed, 0.0, *memory).turn
            if turn > params.trap_turn:
                trapped = True
                continue
        full = speed == params.speed
        # On the first rung it is not: that is why it comes here.
        if rung and _is_clear(params, sight, speed, clearance):
            new = _anew(ATTRACTIVE if full else YIELD, state.best)
            return _to_goal(params, sight, speed, new)
        walkers = blocked_arcs(speed, sight.moving, clearance, params.horizon)
        arcs = np.concatenate((walls, walkers))
        choice = nearest_free(arcs, wanted, speed, params.behind_bias, *memory)
        if choice.turn < inf:
            heading, mode = choice.heading, float(BYPASS if full else YIELD)
            way = choice.track, choice.side, state.best, heading
            new = _changed(START, mode, *way)
            found = Step(True, speed * cos(heading), speed * sin(heading), new)
            # Between things that stand who comes goes where one flees to: what leads
            # away from the goal is left for when nothing leads nearer.
            if choice.turn <= 0.5 * pi or not len(walls):
                return found
            if not away.ends:
                away = found
    if away.ends:
        return away
    if trapped:
        met, group = _meet_group(params, state, sight)
        if met:
            return Step(False, 0.0, 0.0, group)
    return _least_bad(params, state, sight, wanted)


@compiled
def _meet_group(
    params: Any, state: SwitchingState, sight: Sight
) -> tuple[bool, SwitchingState]:
    """Begins to follow the group that stands on the ray to the goal, if any."""
    gx, gy, distance, standing = sight.gx, sight.gy, sight.distance, sight.standing
    clearance = params.body_radius + params.least
    wide = clearance + 0.5 * params.closed_gap
    member = first_on_ray(gx, gy, standing, wide)
    if member < 0:
        return False, state
    # The side of a bypass that has begun is kept unless it is much longer.
    kept = state.side * pi / 2.0 if state.mode == BYPASS else 0.0
    rest = params.body_radius, params.closed_gap, kept
    side = shorter_side(gx, gy, member, standing, clearance, *rest)
    free = free_range(gx, gy, standing, wide, params.vision)
    best = min(distance - free, state.best)
    track = read_disc(standing[member]).track
    return True, _changed(START, float(GROUP), track, side, best, START.heading)


@compiled
def _follow_group(params: Any, state: SwitchingState, sight: Sight) -> Step:
    """Follows the group's boundary until the goal's ray leads nearer than ever."""
    gx, gy, distance = sight.gx, sight.gy, sight.distance
    standing, moving = sight.standing, sight.moving
    clearance = params.body_radius + params.least
    wide = clearance + 0.5 * params.closed_gap
    # What stands near the group's boundary is passed with half the margin.
    narrow = params.body_radius + 0.5 * params.least
    member = _followed(params, state, standing, clearance)
    if member < 0:
        return Step(False, 0.0, 0.0, _anew(ATTRACTIVE, state.best))
    free = free_range(gx, gy, standing, wide, params.vision)
    nearer = distance - free < state.best - params.leave_gain
    if nearer and free > min(distance, params.body_radius):
        return Step(False, 0.0, 0.0, _anew(LEAVE, distance - free))
    rest = params.body_radius, params.closed_gap
    ex, ey, member, straight = way_round(member, state.side, standing, clearance, *rest)
    state = _count_laps(state, sight, read_disc(standing[member]), clearance)
    if state.mode == UNREACHABLE:
        ex = ey = 0.0
    speed = params.speed
    vx, vy = speed * ex, speed * ey
    ahead = min(max(straight / speed, 0.3), 1.0)
    if (
        time_to_enter(vx, vy, moving, clearance) >= params.horizon
        and time_to_enter(vx, vy, sight.solid, narrow) >= ahead
    ):
        return Step(True, vx, vy, state)
    walkers = blocked_arcs(speed, moving, clearance, params.horizon)
    walls = blocked_arcs(speed, sight.solid, narrow, ahead)
    arcs, wanted = np.concatenate((walkers, walls)), atan2(ey, ex)
    memory = 0.0, -1.0, 1.0, 0.0, 0.0
    choice = nearest_free(arcs, wanted, speed, params.behind_bias, *memory)
    if choice.turn == inf:
        return _least_bad(params, state, sight, wanted)
    return Step(True, speed * cos(choice.heading), speed * sin(choice.heading), state)


@compiled
def _followed(
    params: Any, state: SwitchingState, standing: np.ndarray, clearance: float
) -> int:
    """The row of the group's member that is followed, or -1."""
    nearest, least = -1, inf
    for i in range(len(standing)):
        disc = read_disc(standing[i])
        if disc.track == state.track:
            return i
        gap = _gap(disc)
        if gap < least:
            nearest, least = i, gap
    # It is out of sight, or a point at an end that is not seen each time.
    spare = params.body_radius + 2.0 * clearance  # nothing passes between
    return nearest if least <= spare else -1


@compiled
def _gap(disc: Disc) -> float:
    """From the body's middle to a disc's surface [m]."""
    return hypot(disc.q_x, disc.q_y) - disc.radius


@compiled
def _leaves_straight(params: Any, state: SwitchingState, sight: Sight) -> bool:
    """Whether the body may go on straight to the place for which it left a group."""
    gx, gy, distance = sight.gx, sight.gy, sight.distance
    standing, moving = sight.standing, sight.moving
    if distance <= state.best + params.leave_gain:
        return False
    clearance = params.body_radius + params.least
    wide = clearance + 0.5 * params.closed_gap
    if time_to_enter(gx, gy, standing, wide) < params.body_radius:
        return False
    step = _to_goal(params, sight, params.speed, state)
    return time_to_enter(step.v_x, step.v_y, moving, clearance) >= params.horizon


@compiled
def _count_laps(
    state: SwitchingState, sight: Sight, member: Disc, clearance: float
) -> SwitchingState:
    """Notes that the body comes round the group; after two rounds it gives up."""
    hit_x, hit_y, away, laps = state.hit_x, state.hit_y, state.away, state.laps
    from_hit, mode = hypot(sight.px - hit_x, sight.py - hit_y), state.mode
    if away < 0.0:
        if hypot(member.q_x, member.q_y) < member.radius + 1.2 * clearance:
            hit_x, hit_y, away = sight.px, sight.py, 0.0
    elif away == 0.0:
        if from_hit >= 3.0 * clearance:
            away = 1.0
    elif from_hit < clearance:
        away, laps = 0.0, laps + 1.0
        mode = float(UNREACHABLE if laps >= 2.0 else GROUP)
    way = (state.side, state.best, hit_x, hit_y, away, laps, state.heading)
    return SwitchingState(mode, member.track, *way, 0.0, 0.0)


@compiled
def _fleeing(s: SwitchingState, v_x: float, v_y: float) -> SwitchingState:
    """The state with an evasion under way."""
    way = s.track, s.side, s.best, s.hit_x, s.hit_y, s.away, s.laps, s.heading
    return SwitchingState(s.mode, *way, v_x, v_y)


@compiled
def _least_bad(params: Any, state: SwitchingState, sight: Sight, wanted: float) -> Step:
    """Where nothing is free: of 16 headings and rest, what meets a surface last."""
    latest, best_x, best_y = -1.0, 0.0, 0.0
    for k in range(17):
        heading = wanted + k * pi / 8.0
        speed = params.speed if k < 16 else 0.0
        vx, vy = speed * cos(heading), speed * sin(heading)
        t = _enters(vx, vy, sight, params.body_radius)
        if t > latest:
            latest, best_x, best_y = min(t, 0.5 * params.horizon), vx, vy
    mode = float(GROUP if state.mode == GROUP else YIELD)
    way = state.track, state.side, state.best, state.heading
    return Step(True, best_x, best_y, _changed(state, mode, *way))


@compiled
def _slow_down(params: Any, sight: Sight, vx: float, vy: float) -> Point:
    """Limits the speed so that the body can stop before what stands ahead of it."""
    speed = hypot(vx, vy)
    if speed < 1e-9:
        return vx, vy
    ex, ey = vx / speed, vy / speed
    narrow = params.body_radius + 0.5 * params.least
    free = time_to_enter(ex, ey, sight.solid, narrow)
    limit = max(sqrt(2.0 * params.deceleration * free), 0.1 * params.speed)
    if limit >= speed:
        return vx, vy
    return limit * ex, limit * ey
