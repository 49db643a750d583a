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
from math import atan2, cos, hypot, isfinite, pi, sin, sqrt

from systems.switching.arcs import Disc, blocked_arcs, nearest_free, time_to_enter
from systems.switching.caution import cautious
from systems.switching.groups import (
    first_on_ray,
    free_range,
    shorter_side,
    way_round,
)
from systems.switching.signals import Corner, Seen
from systems.switching.switching_state import (
    ATTRACTIVE,
    BYPASS,
    GROUP,
    LEAVE,
    UNREACHABLE,
    YIELD,
    Plan,
    Sight,
    SwitchingParams,
    SwitchingState,
)

Point = tuple[float, float]


Step = tuple[float, float, SwitchingState]
"""Velocity v_x, v_y [m/s] and state."""


def plan(
    params: SwitchingParams,
    state: SwitchingState,
    place: Point,
    velocity: Point,
    goal: Point,
    obstacles: Sequence[Seen],
    corners: Sequence[Corner] = (),
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

    Returns:
        The velocity to take, and what to remember.

    Raises:
        ValueError: If a number is not finite.
    """
    ahead = params.response
    (px, py), (vx, vy), (gx, gy) = place, velocity, goal
    px, py = px + ahead * vx, py + ahead * vy
    gx, gy = gx - px, gy - py
    if not isfinite(gx + gy):
        raise ValueError(f"place={place}, velocity={velocity}, goal={goal}: not finite")
    distance = hypot(gx, gy)
    if distance < 1e-9:
        return Plan(0.0, 0.0, SwitchingState())
    standing: list[Disc] = []
    moving: list[Disc] = []
    slow = params.standing_speed**2
    fastest = total = 0.0
    for track, x, y, radius, wx, wy in obstacles:
        ww = wx * wx + wy * wy
        total += x + y + radius + ww
        if ww > slow:
            qx, qy = px - (x + ahead * wx), py - (y + ahead * wy)
            moving.append(Disc(track, qx, qy, radius, wx, wy))
            if ww > fastest:
                fastest = ww
        else:
            standing.append(Disc(track, px - x, py - y, radius, 0.0, 0.0))
    if not isfinite(total):
        lost = [obstacle for obstacle in obstacles if not isfinite(sum(obstacle))]
        raise ValueError(f"obstacles {lost}: not finite")
    sight = Sight(
        px,
        py,
        gx / distance,
        gy / distance,
        distance,
        standing + moving,
        standing,
        moving,
        [Disc(-2.0, px - c.x, py - c.y, 0.0, 0.0, 0.0) for c in corners],
    )
    vx, vy, state = _step(params, state, sight)
    if standing:
        vx, vy = _slow_down(params, sight, vx, vy)
    vx, vy = cautious(params, sight, corners, vx, vy)
    retreat = False
    if moving:
        clearance = params.body_radius + params.margins[0]
        meets = time_to_enter(0.0, 0.0, moving, clearance)
        retreat = meets < params.retreat_time
    return Plan(vx, vy, state, fastest >= params.speed**2, retreat)


def _step(params: SwitchingParams, state: SwitchingState, sight: Sight) -> Step:
    """The state's own rule."""
    if state.mode == GROUP or state.mode == UNREACHABLE:
        return _follow_group(params, state, sight)
    if state.mode == LEAVE and _leaves_straight(params, state, sight):
        return (*_to_goal(params, sight, params.speed), state)
    clearance = params.body_radius + params.margins[0]
    if _is_clear(params, sight, params.speed, clearance):
        if state.mode != ATTRACTIVE:
            state = SwitchingState(best=state.best)
        return (*_to_goal(params, sight, params.speed), state)
    return _bypass(params, state, sight)


def _is_clear(
    params: SwitchingParams, sight: Sight, speed: float, clearance: float
) -> bool:
    """Whether the straight way to the goal enters no safety circle."""
    vx, vy = speed * sight.gx, speed * sight.gy
    enters = time_to_enter(vx, vy, sight.discs, clearance)
    return enters >= min(params.horizon, sight.distance / speed)


def _to_goal(params: SwitchingParams, sight: Sight, speed: float) -> Point:
    """The attractive field (equation 2), its size limited to the speed."""
    speed = min(speed, params.approach_gain * sight.distance)
    return speed * sight.gx, speed * sight.gy


def _bypass(params: SwitchingParams, state: SwitchingState, sight: Sight) -> Step:
    """The free field nearest to the goal's, with the widest margin that leaves one."""
    standing, moving = sight.standing + sight.edges, sight.moving
    wanted = atan2(sight.gy, sight.gx)
    rungs = [(margin, params.speed) for margin in params.margins]
    rungs += [(params.margins[-1], f * params.speed) for f in params.slower]
    close = min(params.standing_horizon * params.speed, sight.distance)
    trapped = False
    commitment = params.commitment if state.mode in (BYPASS, YIELD) else 0.0
    memory = (params.hysteresis, state.track, state.side, commitment, state.heading)
    away: Step | None = None
    for rung, (margin, speed) in enumerate(rungs):
        clearance = params.body_radius + margin
        if margin == params.margins[-1]:
            clearance += 0.5 * params.closed_gap
        arcs = blocked_arcs(speed, standing, clearance, close / speed)
        if arcs:
            choice = nearest_free(arcs, wanted, speed, 0.0, *memory)
            if choice is None or choice.turn > params.trap_turn:
                trapped = True
                continue
        full = speed == params.speed
        # On the first rung it is not: that is why it comes here.
        if rung and _is_clear(params, sight, speed, clearance):
            mode = ATTRACTIVE if full else YIELD
            new = SwitchingState(mode, best=state.best)
            return (*_to_goal(params, sight, speed), new)
        walled = bool(arcs)
        arcs += blocked_arcs(speed, moving, clearance, params.horizon)
        choice = nearest_free(arcs, wanted, speed, params.behind_bias, *memory)
        if choice is not None:
            heading, edge = choice.heading, choice.disc
            mode = BYPASS if full else YIELD
            track = max(edge.track, -1.0) if edge is not None else -1.0
            new = SwitchingState(mode, track, choice.side, state.best, heading=heading)
            found = speed * cos(heading), speed * sin(heading), new
            # Between things that stand who comes goes where one flees to: what leads
            # away from the goal is left for when nothing leads nearer.
            if choice.turn <= 0.5 * pi or not walled:
                return found
            away = away or found
    if away is not None:
        return away
    if trapped:
        met = _meet_group(params, state, sight)
        if met is not None:
            return _follow_group(params, met, sight)
    return _least_bad(params, state, sight, wanted)


def _meet_group(
    params: SwitchingParams, state: SwitchingState, sight: Sight
) -> SwitchingState | None:
    """Begins to follow the group that stands on the ray to the goal, if any."""
    gx, gy, distance, standing = sight.gx, sight.gy, sight.distance, sight.standing
    clearance = params.body_radius + params.margins[-1]
    wide = clearance + 0.5 * params.closed_gap
    member = first_on_ray(gx, gy, standing, wide)
    if member is None:
        return None
    # The side of a bypass that has begun is kept unless it is much longer.
    kept = state.side * pi / 2.0 if state.mode == BYPASS else 0.0
    side = shorter_side(
        gx,
        gy,
        member,
        standing,
        clearance,
        params.body_radius,
        params.closed_gap,
        kept,
    )
    free = free_range(gx, gy, standing, wide, params.vision)
    return SwitchingState(GROUP, member.track, side, min(distance - free, state.best))


def _follow_group(params: SwitchingParams, state: SwitchingState, sight: Sight) -> Step:
    """Follows the group's boundary until the goal's ray leads nearer than ever."""
    gx, gy, distance = sight.gx, sight.gy, sight.distance
    standing, moving = sight.standing, sight.moving
    clearance = params.body_radius + params.margins[-1]
    wide = clearance + 0.5 * params.closed_gap
    # What stands near the group's boundary is passed with half the margin.
    narrow = params.body_radius + 0.5 * params.margins[-1]
    member = next((o for o in standing if o.track == state.track), None)
    if member is None:  # out of sight, or a point at an end that is not seen each time
        spare = params.body_radius + 2.0 * clearance  # nothing passes between
        member = min(standing, key=_gap, default=None)
        if member is not None and _gap(member) > spare:
            member = None
    if member is None:
        return _step(params, SwitchingState(best=state.best), sight)
    free = free_range(gx, gy, standing, wide, params.vision)
    if (
        free > min(distance, params.body_radius)
        and distance - free < state.best - params.leave_gain
    ):
        return _step(params, SwitchingState(LEAVE, best=distance - free), sight)
    ex, ey, member, straight = way_round(
        member,
        state.side,
        standing,
        clearance,
        params.body_radius,
        params.closed_gap,
    )
    state = _count_laps(state._replace(track=member.track), sight, member, clearance)
    if state.mode == UNREACHABLE:
        ex = ey = 0.0
    speed = params.speed
    vx, vy = speed * ex, speed * ey
    ahead = min(max(straight / speed, 0.3), 1.0)
    if (
        time_to_enter(vx, vy, moving, clearance) >= params.horizon
        and time_to_enter(vx, vy, standing + sight.edges, narrow) >= ahead
    ):
        return vx, vy, state
    arcs = blocked_arcs(speed, moving, clearance, params.horizon)
    arcs += blocked_arcs(speed, standing + sight.edges, narrow, ahead)
    wanted = atan2(ey, ex)
    choice = nearest_free(arcs, wanted, speed, params.behind_bias, 0.0, -1.0, 1.0)
    if choice is None:
        return _least_bad(params, state, sight, wanted)
    return speed * cos(choice.heading), speed * sin(choice.heading), state


def _gap(disc: Disc) -> float:
    """From the body's middle to a disc's surface [m]."""
    return hypot(disc.q_x, disc.q_y) - disc.radius


def _leaves_straight(
    params: SwitchingParams, state: SwitchingState, sight: Sight
) -> bool:
    """Whether the body may go on straight to the place for which it left a group."""
    gx, gy, distance = sight.gx, sight.gy, sight.distance
    standing, moving = sight.standing, sight.moving
    if distance <= state.best + params.leave_gain:
        return False
    clearance = params.body_radius + params.margins[-1]
    wide = clearance + 0.5 * params.closed_gap
    if time_to_enter(gx, gy, standing, wide) < params.body_radius:
        return False
    vx, vy = _to_goal(params, sight, params.speed)
    return time_to_enter(vx, vy, moving, clearance) >= params.horizon


def _count_laps(
    state: SwitchingState, sight: Sight, member: Disc, clearance: float
) -> SwitchingState:
    """Notes that the body comes round the group; after two rounds it gives up."""
    from_hit = hypot(sight.px - state.hit_x, sight.py - state.hit_y)
    if state.away < 0.0:
        if hypot(member.q_x, member.q_y) < member.radius + 1.2 * clearance:
            return state._replace(hit_x=sight.px, hit_y=sight.py, away=0.0)
    elif state.away == 0.0:
        if from_hit >= 3.0 * clearance:
            return state._replace(away=1.0)
    elif from_hit < clearance:
        laps = state.laps + 1.0
        mode = UNREACHABLE if laps >= 2.0 else GROUP
        return state._replace(away=0.0, laps=laps, mode=float(mode))
    return state


def _least_bad(
    params: SwitchingParams, state: SwitchingState, sight: Sight, wanted: float
) -> Step:
    """Where nothing is free: of 16 headings and rest, what meets a surface last."""
    latest, best = -1.0, (0.0, 0.0)
    for k in range(17):
        heading = wanted + k * pi / 8.0
        speed = params.speed if k < 16 else 0.0
        vx, vy = speed * cos(heading), speed * sin(heading)
        t = time_to_enter(vx, vy, sight.discs, params.body_radius)
        if t > latest:
            latest, best = min(t, 0.5 * params.horizon), (vx, vy)
    mode = GROUP if state.mode == GROUP else YIELD
    return *best, state._replace(mode=float(mode))


def _slow_down(params: SwitchingParams, sight: Sight, vx: float, vy: float) -> Point:
    """Limits the speed so that the body can stop before what stands ahead of it."""
    speed = hypot(vx, vy)
    if speed < 1e-9:
        return vx, vy
    ex, ey = vx / speed, vy / speed
    narrow = params.body_radius + 0.5 * params.margins[-1]
    free = time_to_enter(ex, ey, sight.standing + sight.edges, narrow)
    limit = max(sqrt(2.0 * params.deceleration * free), 0.1 * params.speed)
    if limit >= speed:
        return vx, vy
    return limit * ex, limit * ey
