"""Tracks: what is known of things that were seen, scan after scan.

A Kalman filter of constant velocity for each, whose circles are matched by the
assignment that is likeliest within gates (H. Kuhn's, by scipy).
"""

from math import atan2, hypot
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import linear_sum_assignment

from plants.turtlebot.lidar import RAYS, STEP
from plants.turtlebot.signals import RobotState
from systems.common.compiled import compiled
from systems.common.signal import reader, row_writer, size
from systems.perception.clusters import SEEN as WHOLE
from systems.perception.clusters import read_cluster, seen_as

FORBIDDEN = 1e6
"""Cost of a match beyond the gate."""


class Track(NamedTuple):
    """Something that was seen to be one thing; `number` 0 is none."""

    number: float
    x: float
    y: float
    v_x: float
    v_y: float
    # Variances of place, of place and velocity, of velocity: the same in x and y.
    pp: float
    pv: float
    vv: float
    radius: float
    hits: float
    # Scans since it was seen last, and whether it moves.
    missed: float
    moves: float
    # Where it stood last.
    stood_x: float
    stood_y: float
    # How often it was legs that were seen of it, lately: a share.
    legs: float


read_track, write_track = reader(Track), row_writer(Track)
TRACK_SIZE = size(Track)


@compiled
def predicted(params: Any, tracks: np.ndarray, dt: float) -> np.ndarray:
    """All tracks a time later."""
    rows = tracks.copy()
    q = params.agility**2
    for i in range(len(rows)):
        t = read_track(rows[i])
        if t.number > 0.0:
            # White acceleration that lasts for a scan.
            later = Track(
                t.number,
                t.x + dt * t.v_x,
                t.y + dt * t.v_y,
                t.v_x,
                t.v_y,
                t.pp + 2.0 * dt * t.pv + dt * dt * t.vv + 0.25 * q * dt**4,
                t.pv + dt * t.vv + 0.5 * q * dt**3,
                t.vv + q * dt * dt,
                t.radius,
                t.hits,
                t.missed,
                t.moves,
                t.stood_x,
                t.stood_y,
                t.legs,
            )
            write_track(rows, i, later)
    return rows


@compiled
def aged(t: Track, missed: float) -> Track:
    """A track that was not seen."""
    place = (t.number, t.x, t.y, t.v_x, t.v_y, t.pp, t.pv, t.vv, t.radius, t.hits)
    return Track(*place, missed, t.moves, t.stood_x, t.stood_y, t.legs)


@compiled
def costs(
    params: Any, tracks: np.ndarray, found: np.ndarray, place: RobotState
) -> np.ndarray:
    """Squared distances in standard deviations, by track and cluster.

    It is `FORBIDDEN` beyond the gate.
    """
    table = np.full((len(tracks), len(found)), FORBIDDEN)
    for i in range(len(tracks)):
        t = read_track(tracks[i])
        for j in range(len(found)):
            if t.number > 0.0:
                c = read_cluster(found[j])
                x, y, sigma = seen_as(params, place, c, t.x, t.y, t.radius)
                dd = (t.x - x) ** 2 + (t.y - y) ** 2
                cost = dd / (t.pp + sigma * sigma)
                if dd < params.leap**2 and (cost < params.gate**2 or dd < 0.01):
                    table[i, j] = cost
    return table


@compiled
def evident(table: np.ndarray) -> tuple[np.ndarray, bool]:
    """Matches that have no alternative, -1 for the rest, and whether others have."""
    mates = np.full(len(table), -1)
    free = table < FORBIDDEN
    chosen = False
    for i in range(len(table)):
        for j in range(table.shape[1]):
            if free[i, j]:
                if free[i].sum() == 1 and free[:, j].sum() == 1:
                    mates[i] = j
                else:
                    chosen = True
    return mates, chosen


@compiled
def corrected(
    params: Any,
    tracks: np.ndarray,
    found: np.ndarray,
    mates: np.ndarray,
    place: RobotState,
    scan: np.ndarray,
    last: float,
) -> tuple[np.ndarray, float]:
    """Tracks after the match: filtered, aged, dropped and born.

    Args:
        params: A record of `TrackingParams`.
        tracks: Rows of `Track`, predicted.
        found: Rows of `Cluster`.
        mates: Of each track the cluster, -1 for none.
        place: Where the robot is.
        scan: Rows of `Ray`.
        last: Number of the track that was born last.

    Returns:
        The tracks, and the number of the last one.
    """
    rows = tracks.copy()
    taken = np.zeros(len(found), np.bool_)
    for i in range(len(rows)):
        t = read_track(rows[i])
        if t.number == 0.0:
            continue
        if mates[i] < 0:
            # Two bodies are not in one place: it is another's, told twice.
            twice = False
            for j in range(len(rows)):
                o = read_track(tracks[j])
                near = hypot(o.x - t.x, o.y - t.y) < 0.5 * max(o.radius, t.radius)
                if j != i and mates[j] >= 0 and o.number > 0.0 and near:
                    twice = True
            if twice:
                rows[i, :] = 0.0
                continue
            k = int(round((atan2(t.y - place.y, t.x - place.x) - place.theta) / STEP))
            d = hypot(t.x - place.x, t.y - place.y)
            r = scan[k % RAYS, 0]
            through = r == 0.0 or r > d + t.radius + 0.1
            missed = t.missed + (3.0 if through else 1.0)
            # What was seen for a moment is believed in for a moment.
            memory = min(params.memory, t.hits * params.period)
            if missed * params.period > memory or t.hits < 2.0:
                rows[i, :] = 0.0
            else:
                write_track(rows, i, aged(t, missed))
            continue
        c = read_cluster(found[mates[i]])
        taken[mates[i]] = True
        x, y, sigma = seen_as(params, place, c, t.x, t.y, t.radius)
        s = t.pp + sigma * sigma
        kp, kv = t.pp / s, t.pv / s
        v_x, v_y = t.v_x + kv * (x - t.x), t.v_y + kv * (y - t.y)
        speed = hypot(v_x, v_y)
        far = hypot(t.x - t.stood_x, t.y - t.stood_y) > params.strays
        # A wall's end that comes out of a shadow grows, and only seems to move.
        strip = c.cut > 0.0 and c.hidden != WHOLE and t.moves == 0.0
        if c.known > 1.0 or strip:  # where it stood long enough it still is
            moves = False
        elif t.moves > 0.0:
            moves = speed > params.stops
        else:
            moves = t.hits >= 4.0 and (far or speed > params.starts)
        gain = 0.0 if c.hidden != WHOLE and c.radius < t.radius else 0.3
        write_track(
            rows,
            i,
            Track(
                t.number,
                t.x + kp * (x - t.x),
                t.y + kp * (y - t.y),
                v_x,
                v_y,
                (1.0 - kp) * t.pp,
                (1.0 - kp) * t.pv,
                t.vv - kv * t.pv,
                t.radius + gain * (c.radius - t.radius),
                0.25 if strip else t.hits + 1.0,
                0.0,
                1.0 if moves else 0.0,
                t.stood_x if moves or t.moves == 0.0 else x,
                t.stood_y if moves or t.moves == 0.0 else y,
                t.legs + 0.2 * (c.legs - t.legs),
            ),
        )
    free = 0
    for j in range(len(found)):
        c = read_cluster(found[j])
        # What stands is not tracked, but a whole thing that has been there for a
        # moment only may be one that moves slowly, whose track was lost.
        settled = c.known > 0.0 and (c.hidden != WHOLE or c.cut > 0.0)
        if taken[j] or (c.legs == 0.0 and (c.known > 1.0 or settled)):
            continue
        inside = False  # a part of what is known already
        for i in range(len(rows)):
            t = read_track(rows[i])
            if t.number > 0.0 and hypot(t.x - c.x, t.y - c.y) < t.radius:
                inside = True
        while free < len(rows) and rows[free, 0] > 0.0:
            free += 1
        if inside or free == len(rows):
            continue
        last += 1.0
        sigma = params.noise if c.hidden == WHOLE else params.hidden_noise
        hits = 0.25 if c.cut > 0.0 and c.hidden != WHOLE else 1.0
        sure = (sigma**2, 0.0, 1.0, c.radius, hits, 0.0, 0.0)
        new = Track(last, c.x, c.y, 0.0, 0.0, *sure, c.x, c.y, c.legs)
        write_track(rows, free, new)
    return rows, last


def matched(table: np.ndarray) -> np.ndarray:
    """Of each track its cluster, -1 for none: the matches that cost least in all."""
    mates = np.full(len(table), -1)
    rows = np.flatnonzero((table < FORBIDDEN).any(axis=1))
    if rows.size:
        ones, others = linear_sum_assignment(table[rows])
        fits = table[rows[ones], others] < FORBIDDEN
        mates[rows[ones[fits]]] = others[fits]
    return mates
