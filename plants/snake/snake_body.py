"""The snake's body as balls, and driving it from one posture to another.

A straight line between two postures (`plants.snake.posture`) keeps the bend's limit, a
cone that is convex there.

The body is balls of its radius along the axis, the last plate as a cylinder, and the
thin shank of the tool. Between two balls, 1.6 mm apart, it stands out by 0.08 mm.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from plants.snake.balls import ball_chain
from plants.snake.kinematics import POINTS, chain
from plants.snake.parameters import SnakeParams
from plants.tissue.space import (
    FREE,
    NEIGHBOUR,
    Space,
    body_solid,
    first_forbidden,
    first_solid,
    plate_solid,
    roll_back,
    stamp,
    voxel_of,
)
from systems.common.compiled import Numbers, compiled
from systems.common.geometry import Vector, along, dot, sub, xyz
from systems.common.signal import vector

OK = 0
BODY = 1  # some part of the body meets tissue
TOOL = 2  # the tool would leave what it may remove
BEND = 3  # a bend beyond its limit
TRAVEL = 4  # the translation beyond its travel

PLATE, SHANK, BALL = 6, 7, 8
"""Parts of the body beyond its links 0 to 5; see `check_body`."""

WHOLE, LAST = 0, 4
"""First parts of a body to be checked: all, or the last module alone."""

CULPRIT = 9
"""Numbers that name what a pose met: part, point, radius, voxel, axis of a plate."""

SHANK_RADIUS = 1.2e-3
"""Radius of the tool's shank in m."""

EDGE_SHARE = 8
"""How much oftener than round body and tool the last plate is checked.

Halfway between two checks a round body stands out of where it was found to fit by
0.01 mm, an edge by up to 0.7 of half the way: 0.02 mm at an eighth of 0.5 mm. The
plan's clearance covers that and the tracking's error.
"""


class Body(NamedTuple):
    """The robot's numbers for compiled functions. SI units.

    Attributes:
        h: Half the distance between ball centres.
        tool: Distance from O3 to the tool.
        radius: Of the tool's ball.
        frees: Radius of what the tool surely frees, path errors considered.
        body: Radius of the body, clearance included.
        face: Distance from the last ball's centre to the last plate's outer face.
        bend: Largest beta.
        low: Least translation.
        high: Largest translation.
        shank: Radius of the tool's shank.
        step: Longest stretch of the body's motion between two checks.
        o: Origin of the entry's frame E in the frame of the tissue, W.
        e: Its axis x in W.
        f: Its axis y.
        n: Its axis z, along the channel.
    """

    h: float
    tool: float
    radius: float
    frees: float
    body: float
    face: float
    bend: float
    low: float
    high: float
    shank: float
    step: float
    o: Vector
    e: Vector
    f: Vector
    n: Vector


def body_of(
    params: SnakeParams,
    clearance: float = 0.0,
    accuracy: float = 0.0,
    step: float = 0.5e-3,
    X_WE: Any = None,
) -> Body:
    """The robot's numbers.

    Args:
        params: The robot.
        clearance: By which its body is taken for wider, in m.
        accuracy: By which its tool is taken for smaller where it frees space, in m.
        step: Longest stretch of motion between two checks, in m.
        X_WE: Pose of the entry's frame, (4, 4); that of W if None.
    """
    X = np.eye(4) if X_WE is None else np.asarray(X_WE, float)
    return Body(
        params.half_pitch,
        params.tool_offset,
        params.tool_radius,
        params.tool_radius - accuracy,
        params.body_radius + clearance,
        params.half_pitch + params.plate_thickness / 2 + clearance,
        params.max_bend,
        params.travel[0],
        params.travel[1],
        SHANK_RADIUS + clearance,
        step,
        vector(X[:3, 3]),
        vector(X[:3, 0]),
        vector(X[:3, 1]),
        vector(X[:3, 2]),
    )


@compiled
def place(b: Body, x: Any, out: Any) -> None:
    """The corners of a posture (7,) in W, as `kinematics.corners`, into out (8, 3)."""
    chain(x, b.h, b.tool, b.o, b.e, b.f, b.n, out)


@compiled
def place_any(b: Body, x: Any, out: Any) -> None:
    """As `place`, also of a `BallPosture` (19,)."""
    if len(x) == 7:
        place(b, x, out)
    else:
        ball_chain(x, b.h, b.tool, b.o, b.e, b.f, b.n, out)


@compiled
def from_entry(b: Body, p: Numbers) -> Vector:
    """A point of W in the entry's frame E."""
    return axis_from_entry(b, sub(p, b.o))


@compiled
def axis_from_entry(b: Body, n: Numbers) -> Vector:
    """A direction of W in the entry's frame E."""
    return dot(n, b.e), dot(n, b.f), dot(n, b.n)


@compiled
def _blame(why: Any, part: int, p: Numbers, rho: float, at: int) -> int:
    why[0], why[1], why[2], why[3] = part, p[0], p[1], p[2]
    why[4], why[5] = rho, at
    return BODY


@compiled
def check_links(s: Space, b: Body, c: Any, first: int, why: Any) -> int:
    """OK or BODY for the round body up to the last ball; as `check_body`."""
    if first == 0:
        z = dot(sub(c[0], b.o), b.n) - b.h / 2
        while z > -b.body:
            p = along(b.o, z, b.n)
            at = body_solid(s, p, b.body)
            if at != FREE:
                return _blame(why, 0, p, b.body, at)
            z -= b.h / 2
    for link in range(first, 5):
        for n in range(4):
            p = along(c[link], n / 4, sub(c[link + 1], c[link]))
            at = body_solid(s, p, b.body)
            if at != FREE:
                return _blame(why, link, p, b.body, at)
    p = xyz(c[5], 0)
    at = body_solid(s, p, b.body)
    if at != FREE:
        return _blame(why, 5, p, b.body, at)
    return OK


@compiled
def check_plate(s: Space, b: Body, c: Any, more: float, why: Any) -> int:
    """OK or BODY for the last plate, taken for wider all round by `more` in m."""
    length = 2 * b.h + b.tool
    d = sub(c[7], c[5])
    n = (d[0] / length, d[1] / length, d[2] / length)
    p = along(c[5], -more, n)
    at = plate_solid(s, p, n, b.face + 2 * more, b.body + more)
    if at == FREE:
        return OK
    why[6], why[7], why[8] = n
    return _blame(why, PLATE, along(c[5], b.face / 2, n), b.body, at)


@compiled
def check_shank(s: Space, b: Body, c: Any, why: Any) -> int:
    """OK or BODY for the tool's shank."""
    length = 2 * b.h + b.tool
    far = b.face
    while far < length - b.radius + b.shank:
        p = along(c[5], far / length, sub(c[7], c[5]))
        at = first_solid(s, p, b.shank)
        if at != FREE:
            return _blame(why, SHANK, p, b.shank, at)
        far += b.shank
    return OK


@compiled
def check_body(s: Space, b: Body, c: Any, first: int, why: Any) -> int:
    """OK or BODY for a body with corners c (8, 3); the culprit goes to why (9,).

    Parts 0 to 5 are the links behind each ball (0 what lies in the channel), then
    PLATE and SHANK. Those before `first` are taken for free.
    """
    status = check_links(s, b, c, first, why)
    if status == OK:
        status = check_plate(s, b, c, 0.0, why)
    if status == OK:
        status = check_shank(s, b, c, why)
    return status


@compiled
def check_limits(b: Body, x: Any) -> int:
    """OK, BEND or TRAVEL."""
    if x[0] < b.low - 1e-9 or x[0] > b.high + 1e-9:
        return TRAVEL
    least = math.cos(b.bend) - 1e-9
    for k in range(3):
        if math.cos(x[1 + 2 * k]) * math.cos(x[2 + 2 * k]) < least:
            return BEND
    return OK


@compiled
def between(x0: Any, x1: Any, share: float, out: Any) -> None:
    """The posture at a share of the straight way; at 1 exactly x1."""
    for r in range(len(x0)):
        out[r] = x1[r] if share == 1.0 else x0[r] + share * (x1[r] - x0[r])


@compiled
def could_fit(s: Space, b: Body, c: Any) -> bool:
    """Whether a body with corners c (8, 3) lies in what may ever be free.

    Quick and not strict: where it says no, `check_body` never finds it free.
    """
    least = b.body / s.spacing - 2 * NEIGHBOUR
    for link in range(5):
        for n in range(4):
            at = voxel_of(s, along(c[link], n / 4, sub(c[link + 1], c[link])))
            if at >= 0 and s.inside[at] < least:
                return False
    at = voxel_of(s, xyz(c[5], 0))
    return at < 0 or s.inside[at] >= least


@compiled
def as_far_as_fits(s: Space, b: Body, x0: Any, x1: Any) -> bool:
    """Shortens the way from x0 to x1, in place, to where the body could ever be.

    Returns:
        Whether a tenth of it is left.
    """
    c, x = np.empty((POINTS, 3)), np.empty(7)
    place(b, x1, c)
    if could_fit(s, b, c):
        return True
    low, high = 0.0, 1.0
    for _ in range(5):
        share = (low + high) / 2
        between(x0, x1, share, x)
        place(b, x, c)
        if could_fit(s, b, c):
            low = share
        else:
            high = share
    between(x0, x1, low, x)
    x1[:] = x
    return low >= 0.1


@compiled
def drive(s: Space, b: Body, x0: Any, x1: Any, time: int, why: Any) -> int:
    """Moves from a posture that fits to another, freeing what the tool sweeps.

    Every step of the straight line is checked, body first, then tool: the body may
    use what the tool has freed ahead of it. The last plate, which has an edge, is
    looked at `EDGE_SHARE` times as often. If a step fails, nothing has happened.

    Args:
        s: The space.
        b: The body.
        x0: Posture (7,) at which the robot stands.
        x1: Posture (7,) to reach.
        time: Arrival time of what this motion frees.
        why: Takes the culprit (9): part, point [m], radius [m], voxel, plate's axis.

    Returns:
        OK, BODY, TOOL, BEND or TRAVEL.
    """
    freed, roomed = s.used[0], s.used[1]
    status, _ = drive_far(s, b, x0, x1, time, why)
    if status != OK:
        roll_back(s, freed, roomed)
    return status


@compiled
def drive_far(s: Space, b: Body, x0: Any, x1: Any, time: int, why: Any) -> Any:
    """As `drive`, but goes as far as it can and stops there.

    Returns:
        The status, and the share of the way that was gone.
    """
    status = check_limits(b, x1)
    if status != OK:
        return status, 0.0
    c0, c1, x = np.empty((POINTS, 3)), np.empty((POINTS, 3)), np.empty(7)
    place(b, x0, c0)
    place(b, x1, c1)
    longest = 0.0
    for n in range(POINTS):
        d = sub(c1[n], c0[n])
        longest = max(longest, dot(d, d))
    longest = math.sqrt(longest)
    steps = max(1, math.ceil(EDGE_SHARE * longest / b.step))
    sure, freed, roomed = 0, s.used[0], s.used[1]
    moving = LAST  # the first part of the body that moves
    for r in range(5):
        if x0[r] != x1[r]:
            moving = WHOLE
    roomy = False  # the plate has room all along this stretch
    for n in range(1, steps + 1):
        if n % EDGE_SHARE == 1:
            # Once for all of it: no corner of the body goes farther from its middle.
            last = min(n + EDGE_SHARE - 1, steps)
            between(x0, x1, (n + last) / (2 * steps), x)
            place(b, x, c0)
            more = (last - n) / (2 * steps) * longest
            roomy = check_plate(s, b, c0, more, why) == OK
        whole = n % EDGE_SHARE == 0 or n == steps
        if roomy and not whole:
            continue
        between(x0, x1, n / steps, x)
        place(b, x, c0)
        status = OK if roomy else check_plate(s, b, c0, 0.0, why)
        if whole and status == OK:
            status = check_links(s, b, c0, moving, why)
        if whole and status == OK:
            status = check_shank(s, b, c0, why)
        if whole and status == OK:
            p = xyz(c0[7], 0)
            at = first_forbidden(s, p, b.radius)
            if at != FREE:
                _blame(why, BALL, p, b.radius, at)
                status = TOOL
        if status != OK:
            roll_back(s, freed, roomed)
            return status, sure / steps
        if whole:
            stamp(s, xyz(c0[7], 0), b.frees, time)
            sure, freed, roomed = n, s.used[0], s.used[1]
    return OK, 1.0
