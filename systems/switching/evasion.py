"""Evasion: a way out where what is wanted ends in a collision for this very body.

A body turns and speeds up no faster than it can, and may come too late for a heading
that is free for a point without inertia. So the velocity that the rules want is
carried on with the wheels' control law and limits, against those who move as they do
now. If it soon ends in a collision, headings all round are tried in the same way, held
for some time and then left for rest: the one is taken that collides latest, then passes
farther, then changes least of the evasion under way (who changes his mind loses the
time to turn).

D. Fox, W. Burgard, S. Thrun, "The dynamic window approach to collision avoidance",
IEEE Robotics and Automation Magazine 4(1), 1997, tries what a body can do, too.
"""

from math import cos, hypot, inf, nan, pi, sin
from typing import Any, NamedTuple

import numpy as np

from plants.turtlebot.signals import Command
from systems.common.compiled import compiled
from systems.switching.arcs import read_disc
from systems.switching.heading_law import heading_law
from systems.switching.switching_state import Sight

STEP = 0.1
"""Of a way [s]."""
HEADINGS = 24
HOLDS = (0.8, 1.6, inf)
"""For how long [s] a heading is held before the body stands."""
ALARM, GRAZE = 2.0, 0.05
"""The wanted is left if within this time [s] it comes so near to a surface [m]; what
is later the rules still pass."""
EASE = 0.15
"""An evasion ends when what is wanted passes so far from surfaces [m]."""
TOUCH = 0.02
"""An evasion that comes so near [m] collides: it may squeeze through."""
WIDE = 0.4
"""What passes farther [m] is no better."""
WORTH_OF_GAP, COST_OF_CHANGE = 0.5, 0.1
"""A metre farther is worth half a second later; so much costs a change by 5 m/s."""


class Body(NamedTuple):
    """How a body stands and moves; `theta` is NaN if it goes any way at once."""

    theta: float  # rad
    v: float  # m/s
    omega: float  # rad/s


HOLONOMIC = Body(nan, 0.0, 0.0)


class Evasion(NamedTuple):
    """What to do."""

    needed: bool
    v_x: float
    v_y: float
    retreat: bool


class Way(NamedTuple):
    """What comes of a velocity."""

    meets: float  # s, infinite if it does not collide within the foresight
    gap: float  # m, least distance between surfaces until then


@compiled
def way(
    params: Any,
    law: Any,
    body: Body,
    wanted: Evasion,
    hold: float,
    discs: np.ndarray,
    touch: float,
) -> Way:
    """What comes of a velocity that is held for a time [s], and then of rest.

    Args:
        params: A record of the planner's `constants`.
        law: One of the wheels' control law.
        body: How the body stands.
        wanted: The velocity.
        hold: For how long.
        discs: Rows of `Disc`.
        touch: What comes so near to a surface [m] collides.
    """
    theta, v, omega = body.theta, body.v, body.omega
    x = y = 0.0
    gap = inf
    dv, dw = params.braking * STEP, law.turn_acceleration * STEP
    for k in range(int(params.foresight / STEP)):
        told = Command(0.0, 0.0)
        if k * STEP < hold:
            told = heading_law(law, theta, wanted.v_x, wanted.v_y, wanted.retreat)
        v = min(max(told.speed, v - dv), v + dv)
        omega = min(max(told.turn_rate, omega - dw), omega + dw)
        middle = theta + 0.5 * STEP * omega
        x, y = x + STEP * v * cos(middle), y + STEP * v * sin(middle)
        theta += STEP * omega
        t = (k + 1) * STEP
        for i in range(len(discs)):
            d = read_disc(discs[i])
            qx, qy = d.q_x + x - t * d.w_x, d.q_y + y - t * d.w_y
            size = d.radius + params.body_radius
            if abs(qx) < size + gap and abs(qy) < size + gap:
                gap = min(gap, hypot(qx, qy) - size)
        if gap < touch:
            return Way(t, gap)
    return Way(inf, gap)


@compiled
def evasion(
    params: Any,
    law: Any,
    sight: Sight,
    body: Body,
    wanted: Evasion,
    flee_x: float,
    flee_y: float,
) -> Evasion:
    """What to do instead of what is wanted, if that ends in a collision.

    Args:
        params: A record of the planner's `constants`.
        law: One of the wheels' control law.
        sight: What is seen.
        body: How the body stands.
        wanted: What the rules want.
        flee_x: Velocity of the evasion under way, x [m/s].
        flee_y: The same, y [m/s]; both 0 for none.
    """
    found = way(params, law, body, wanted, inf, sight.moving, GRAZE)
    flees = flee_x != 0.0 or flee_y != 0.0
    if found.meets > ALARM and (found.gap > EASE or not flees):
        return wanted
    if not flees:
        flee_x, flee_y = wanted.v_x, wanted.v_y
    discs = _near(params, sight)
    best, least = wanted, inf
    for k in range(2 * HEADINGS + 2):
        heading = (k // 2) * 2.0 * pi / HEADINGS
        speed = params.speed if k < 2 * HEADINGS else 0.0
        tried = Evasion(True, speed * cos(heading), speed * sin(heading), k % 2 == 0)
        if k > 2 * HEADINGS:
            tried = Evasion(True, wanted.v_x, wanted.v_y, wanted.retreat)
        change = hypot(tried.v_x - flee_x, tried.v_y - flee_y)
        for hold in HOLDS:
            found = way(params, law, body, tried, hold, discs, TOUCH)
            late = min(found.meets, params.foresight + STEP)
            cost = COST_OF_CHANGE * change - late - WORTH_OF_GAP * min(found.gap, WIDE)
            if cost < least:
                best, least = tried, cost
    return best


@compiled
def _near(params: Any, sight: Sight) -> np.ndarray:
    """Rows of `Disc`: what can be met within the foresight."""
    discs = np.concatenate((sight.moving, sight.standing))
    near = np.empty(len(discs), np.bool_)
    for i in range(len(discs)):
        d = read_disc(discs[i])
        reach = params.foresight * (params.speed + hypot(d.w_x, d.w_y)) + d.radius
        near[i] = hypot(d.q_x, d.q_y) < reach + params.body_radius
    return discs[near]
