"""Place: odometry, put right by matching the scan with what is known to stand.

The pose is the minimum of the squared distances of the scan's points from the lines of
the grid's means (A. Censi, "An ICP variant using a point-to-line metric", ICRA 2008)
and of its distance from what odometry says, each weighted by how sure it is. Where
nothing stands odometry remains, along a corridor it remains along it; the inverse of
the curvature says how sure the robot is.
"""

from math import cos, hypot, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from plants.turtlebot.lidar import RAYS, ray
from plants.turtlebot.signals import RobotState
from systems.common.compiled import compiled
from systems.perception.grid import RELIABLE, cell_of, walks
from systems.perception.signals import CELLS

ITERATIONS, EVERY = 4, 3
"""Of the minimum, and every which ray it takes."""
STILL = 2e-3
"""A way [m] and turn [rad] that are none."""
GATE = 0.3
"""Points farther from all that is known [m] are matched with nothing."""
BENT = 0.01
"""Square of a line's breadth over its length from which it is worth half."""
ROBUST = 0.08
"""Distances from a line beyond this [m] count linearly (Huber)."""


class Belief(NamedTuple):
    """Where the robot was at the last scan, and what odometry said then."""

    x: float
    y: float
    theta: float
    reckoned_x: float
    reckoned_y: float
    reckoned_theta: float
    begun: float
    # Covariance of x, y, theta.
    xx: float
    xy: float
    yy: float
    xt: float
    yt: float
    tt: float


@compiled
def carried(belief: Belief, reckoned: RobotState) -> RobotState:
    """The place now: the last one, and the way that odometry went since."""
    if belief.begun == 0.0:
        return reckoned
    dx, dy = reckoned.x - belief.reckoned_x, reckoned.y - belief.reckoned_y
    turn = belief.theta - belief.reckoned_theta
    c, s = cos(turn), sin(turn)
    return RobotState(
        belief.x + c * dx - s * dy,
        belief.y + s * dx + c * dy,
        reckoned.theta + turn,
        reckoned.v,
        reckoned.omega,
    )


@compiled
def inverse(m: Any) -> Any:
    """Of a symmetric matrix, given as xx, xy, yy, xt, yt, tt."""
    a, b, d, c, e, f = m
    A, B, C = d * f - e * e, c * e - b * f, b * e - c * d
    k = 1.0 / (a * A + b * B + c * C)
    return (k * A, k * B, k * (a * f - c * c), k * C, k * (b * c - a * e),
            k * (a * d - b * b))  # fmt: skip


@compiled
def line_at(grid: np.ndarray, c: int) -> tuple[float, float, float]:
    """Unit normal of the line through a cell's mean and its neighbours', and its worth.

    The worth is 1 for a straight line, less for a bent one, 0 for none.
    """
    n = sx = sy = xx = xy = yy = 0.0
    for i in range(-1, 2):
        for j in range(-1, 2):
            k = c + i * CELLS + j
            if 0 <= k < len(grid) and grid[k, 0] >= RELIABLE:
                x, y = grid[k, 1] - grid[c, 1], grid[k, 2] - grid[c, 2]
                n, sx, sy = n + 1.0, sx + x, sy + y
                xx, xy, yy = xx + x * x, xy + x * y, yy + y * y
    if n < 3.0:
        return 0.0, 0.0, 0.0
    xx, xy, yy = xx - sx * sx / n, xy - sx * sy / n, yy - sy * sy / n
    half, root = 0.5 * (xx + yy), sqrt(0.25 * (xx - yy) ** 2 + xy * xy)
    if half - root > 0.1 * (half + root):
        return 0.0, 0.0, 0.0  # a corner
    x, y = (xy, half - root - xx) if xx > yy else (half - root - yy, xy)
    size = hypot(x, y)
    if size == 0.0:
        x, y, size = (0.0, 1.0, 1.0) if xx > yy else (1.0, 0.0, 1.0)
    bent = (half - root) / (half + root) / BENT
    return x / size, y / size, 1.0 / (1.0 + bent * bent)


@compiled
def locate(
    params: Any,
    belief: Belief,
    reckoned: RobotState,
    grid: np.ndarray,
    scan: np.ndarray,
    moving: np.ndarray,
) -> Belief:
    """The belief after another scan.

    Args:
        params: A record of `GridMappingParams` with the grid's `left` and `bottom`.
        belief: After the last scan.
        reckoned: By odometry.
        grid: Rows of `Cell`.
        scan: Rows of `Ray`.
        moving: Rows of `Seen`: what is matched with nothing.
    """
    p = carried(belief, reckoned)
    if belief.begun == 0.0:
        sure = 1e-6
        place = (p.x, p.y, p.theta)
        return Belief(*place, *place, 1.0, sure, 0.0, sure, 0.0, 0.0, sure)
    # Odometry's share: errors of the way along, of the heading across.
    dx, dy = p.x - belief.x, p.y - belief.y
    way, turn = hypot(dx, dy), abs(p.theta - belief.theta)
    if way + turn < STILL:
        return belief  # the same scan again tells nothing new
    along = params.way_error**2 * way
    tt = belief.tt + params.turn_error**2 * (way + turn)
    xt, yt = belief.xt - dy * belief.tt, belief.yt + dx * belief.tt
    c, s = cos(p.theta), sin(p.theta)
    xx = belief.xx - 2.0 * dy * belief.xt + dy * dy * belief.tt + along * c * c
    yy = belief.yy + 2.0 * dx * belief.yt + dx * dx * belief.tt + along * s * s
    xy = belief.xy + dx * belief.xt - dy * belief.yt - dx * dy * belief.tt
    xy += along * c * s
    told = inverse((xx + 1e-8, xy, yy + 1e-8, xt, yt, tt + 1e-8))
    x, y, theta = p.x, p.y, p.theta
    moving = moving[moving[:, 0] >= 0.0]
    info = told
    for _ in range(ITERATIONS):
        ex, ey, et = x - p.x, y - p.y, theta - p.theta
        a, b, d, ac, bc, f = told
        gx, gy = a * ex + b * ey + ac * et, b * ex + d * ey + bc * et
        gt = ac * ex + bc * ey + f * et
        ahead, across = cos(theta), sin(theta)
        for k in range(0, RAYS, EVERY):
            r = scan[k, 0]
            if r == 0.0:
                continue
            ux, uy = ray(ahead, across, k)
            rx, ry = r * ux, r * uy
            c0 = cell_of(params, x + rx, y + ry)
            if c0 < 0 or walks(moving, x + rx, y + ry, 0.15):
                continue
            nearest, least = -1, GATE * GATE
            for i in range(-1, 2):
                for j in range(-1, 2):
                    o = c0 + i * CELLS + j
                    if 0 <= o < len(grid) and grid[o, 0] >= RELIABLE:
                        gx0, gy0 = grid[o, 1] - x - rx, grid[o, 2] - y - ry
                        gap = gx0 * gx0 + gy0 * gy0
                        if gap < least:
                            nearest, least = o, gap
            if nearest < 0:
                continue
            nx, ny, worth = line_at(grid, nearest)
            if worth == 0.0:
                continue
            e = nx * (x + rx - grid[nearest, 1]) + ny * (y + ry - grid[nearest, 2])
            w = worth * min(1.0, ROBUST / max(abs(e), 1e-9))
            w /= params.match_error**2
            jt = ny * rx - nx * ry
            a, b, d = a + w * nx * nx, b + w * nx * ny, d + w * ny * ny
            ac, bc, f = ac + w * nx * jt, bc + w * ny * jt, f + w * jt * jt
            gx, gy, gt = gx + w * e * nx, gy + w * e * ny, gt + w * e * jt
        info = (a, b, d, ac, bc, f)
        a, b, d, ac, bc, f = inverse(info)
        sx, sy = a * gx + b * gy + ac * gt, b * gx + d * gy + bc * gt
        st = ac * gx + bc * gy + f * gt
        x, y, theta = x - sx, y - sy, theta - st
        if abs(sx) + abs(sy) + abs(st) < 5e-4:
            break
    xx, xy, yy, xt, yt, tt = inverse(info)
    return Belief(
        x, y, theta, reckoned.x, reckoned.y, reckoned.theta, 1.0, xx, xy, yy, xt, yt, tt
    )
