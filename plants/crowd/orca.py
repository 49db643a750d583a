"""Optimal reciprocal collision avoidance (ORCA) for discs: the crowds' motion.

J. van den Berg, S. Guy, M. Lin, D. Manocha, "Reciprocal n-body collision
avoidance", ISRR 2011. Each agent takes half of the smallest change of relative
velocity that keeps a pair apart for a time tau: one half-plane of velocities
per neighbour. The velocity nearest to the preferred one that lies in all of
them solves a linear program in two variables; where none does, the velocity
that violates the worst half-plane least.
"""

from collections.abc import Sequence
from math import hypot, sqrt

from plants.crowd.signals import Obstacle

Line = tuple[float, float, float, float]
"""A half-plane: point and unit direction; velocities on its left are allowed."""

_EPSILON = 1e-5


def half_plane(agent: Obstacle, other: Obstacle, tau: float, dt: float) -> Line:
    """The velocities that `agent` may take as its half of avoiding `other`.

    Args:
        agent: The agent that chooses.
        other: Its neighbour.
        tau: Time [s] for which the pair must stay apart.
        dt: Time [s] in which discs that overlap must separate.
    """
    x, y, r, vx, vy = agent
    qx, qy, s, wx, wy = other
    px, py = qx - x, qy - y
    ux, uy = vx - wx, vy - wy
    radius = r + s
    dd = px * px + py * py
    rr = radius * radius
    if dd > rr:
        # Velocity obstacle: a cone cut off by a disc of radius / tau.
        cx, cy = ux - px / tau, uy - py / tau
        cc = cx * cx + cy * cy
        dot = cx * px + cy * py
        if dot < 0.0 and dot * dot > rr * cc:  # nearest to the cut-off disc
            length = sqrt(cc)
            nx, ny = cx / length, cy / length
            lx, ly = ny, -nx
            k = radius / tau - length
            dx, dy = k * nx, k * ny
        else:  # nearest to a leg
            leg = sqrt(dd - rr)
            if px * cy - py * cx > 0.0:
                lx, ly = (px * leg - py * radius) / dd, (px * radius + py * leg) / dd
            else:
                lx = -(px * leg + py * radius) / dd
                ly = -(-px * radius + py * leg) / dd
            along = ux * lx + uy * ly
            dx, dy = along * lx - ux, along * ly - uy
    else:
        cx, cy = ux - px / dt, uy - py / dt
        length = hypot(cx, cy) or _EPSILON
        nx, ny = cx / length, cy / length
        lx, ly = ny, -nx
        k = radius / dt - length
        dx, dy = k * nx, k * ny
    return vx + 0.5 * dx, vy + 0.5 * dy, lx, ly


def _on_line(
    lines: Sequence[Line],
    i: int,
    speed: float,
    ox: float,
    oy: float,
    direction: bool,
) -> tuple[float, float] | None:
    """The best velocity on line i within the lines before it and the speed."""
    px, py, dx, dy = lines[i]
    dot = px * dx + py * dy
    discriminant = dot * dot + speed * speed - px * px - py * py
    if discriminant < 0.0:
        return None
    root = sqrt(discriminant)
    low, high = -dot - root, -dot + root
    for qx, qy, ex, ey in lines[:i]:
        denominator = dx * ey - dy * ex
        numerator = ex * (py - qy) - ey * (px - qx)
        if abs(denominator) <= _EPSILON:
            if numerator < 0.0:
                return None
            continue
        t = numerator / denominator
        if denominator >= 0.0:
            high = min(high, t)
        else:
            low = max(low, t)
        if low > high:
            return None
    if direction:
        t = high if ox * dx + oy * dy > 0.0 else low
    else:
        t = min(max(dx * (ox - px) + dy * (oy - py), low), high)
    return px + t * dx, py + t * dy


def _program(
    lines: Sequence[Line], speed: float, ox: float, oy: float, direction: bool
) -> tuple[int, float, float]:
    """The velocity nearest to o (or furthest along it); the first line it fails."""
    if direction:
        vx, vy = ox * speed, oy * speed
    else:
        size = hypot(ox, oy)
        scale = speed / size if size > speed else 1.0
        vx, vy = ox * scale, oy * scale
    for i, (px, py, dx, dy) in enumerate(lines):
        if dx * (py - vy) - dy * (px - vx) > 0.0:
            best = _on_line(lines, i, speed, ox, oy, direction)
            if best is None:
                return i, vx, vy
            vx, vy = best
    return len(lines), vx, vy


def _least_violation(
    lines: Sequence[Line], begin: int, speed: float, vx: float, vy: float
) -> tuple[float, float]:
    """The velocity whose worst violation of the lines is least."""
    distance = 0.0
    for i in range(begin, len(lines)):
        px, py, dx, dy = lines[i]
        if dx * (py - vy) - dy * (px - vx) <= distance:
            continue
        projected: list[Line] = []
        for qx, qy, ex, ey in lines[:i]:
            determinant = dx * ey - dy * ex
            if abs(determinant) <= _EPSILON:
                if dx * ex + dy * ey > 0.0:
                    continue
                ax, ay = 0.5 * (px + qx), 0.5 * (py + qy)
            else:
                t = (ex * (py - qy) - ey * (px - qx)) / determinant
                ax, ay = px + t * dx, py + t * dy
            bx, by = ex - dx, ey - dy
            size = hypot(bx, by)
            projected.append((ax, ay, bx / size, by / size))
        failed, wx, wy = _program(projected, speed, -dy, dx, True)
        if failed == len(projected):
            vx, vy = wx, wy
        distance = dx * (py - vy) - dy * (px - vx)
    return vx, vy


def orca_velocity(
    agent: Obstacle,
    neighbours: Sequence[Obstacle],
    preferred: tuple[float, float],
    speed: float,
    tau: float = 5.0,
    dt: float = 0.25,
) -> tuple[float, float]:
    """The new velocity of an agent among its neighbours [m/s].

    Args:
        agent: The agent that chooses.
        neighbours: The discs it reacts to, nearest first.
        preferred: The velocity it would take if it were alone [m/s].
        speed: Its greatest speed [m/s].
        tau: Time for which pairs must stay apart [s].
        dt: Time step [s].
    """
    lines = [half_plane(agent, other, tau, dt) for other in neighbours]
    failed, vx, vy = _program(lines, speed, *preferred, False)
    if failed < len(lines):
        return _least_violation(lines, failed, speed, vx, vy)
    return vx, vy


def orca_towards(
    agents: Sequence[Obstacle],
    goals: Sequence[tuple[float, float]],
    speed: float,
    tau: float = 5.0,
    dt: float = 0.25,
    margin: float = 0.01,
) -> list[tuple[float, float]]:
    """New velocities of a crowd whose agents walk to their goals [m/s].

    Everyone reacts to the ten nearest within 10 m, with radii enlarged by
    `margin`: the humans of the CrowdNav benchmark (C. Chen et al., ICRA 2019).

    Args:
        agents: All agents.
        goals: Their goals [m].
        speed: Everyone's greatest speed [m/s].
        tau: Time for which pairs must stay apart [s].
        dt: Time step [s].
        margin: Added to each radius [m].
    """
    grown = [Obstacle(x, y, r + margin, vx, vy) for x, y, r, vx, vy in agents]
    chosen = []
    for i, (me, (goal_x, goal_y)) in enumerate(zip(grown, goals, strict=True)):
        ax, ay = me.x, me.y
        near = [
            (squared, j)
            for j, (x, y, _, _, _) in enumerate(grown)
            if j != i and (squared := (x - ax) ** 2 + (y - ay) ** 2) < 100.0
        ]
        near.sort()
        gx, gy = goal_x - ax, goal_y - ay
        distance = hypot(gx, gy)
        if distance > 1.0:
            gx, gy = gx / distance, gy / distance
        neighbours = [grown[j] for _, j in near[:10]]
        chosen.append(orca_velocity(me, neighbours, (gx, gy), speed, tau, dt))
    return chosen
