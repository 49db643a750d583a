"""The social force: people who are drawn to where they go, and pushed by each other.

D. Helbing, P. Molnar, "Social force model for pedestrian dynamics", Physical Review E
51, 1995, in its circular form: a force of relaxation to the wanted velocity, and an
exponential one from each neighbour, weaker from behind.
"""

from collections.abc import Sequence
from math import exp, hypot

from plants.crowd.signals import Obstacle

RELAXATION = 0.5
"""Time in which a wanted velocity is taken [s]."""
STRENGTH, RANGE, BEHIND = 2.1, 0.3, 0.3
"""Push at contact [m/s^2], length of its fall [m], its share from behind."""


def social_force_towards(
    agents: Sequence[Obstacle],
    goals: Sequence[tuple[float, float]],
    speed: float,
    dt: float,
) -> list[tuple[float, float]]:
    """New velocities of those who have a goal [m/s].

    Args:
        agents: Everyone; those beyond the goals' number only push.
        goals: Of the first of them [m].
        speed: That everyone wants, and exceeds by no more than 0.3 of it [m/s].
        dt: Time step [s].
    """
    chosen = []
    for i, (gx, gy) in enumerate(goals):
        x, y, radius, v_x, v_y = agents[i]
        away = hypot(gx - x, gy - y)
        pace = min(speed, away / RELAXATION) / max(away, 1e-9)
        ax = (pace * (gx - x) - v_x) / RELAXATION
        ay = (pace * (gy - y) - v_y) / RELAXATION
        for j, other in enumerate(agents):
            d = hypot(x - other.x, y - other.y)
            if j == i or d > 4.0 or d == 0.0:
                continue
            nx, ny = (x - other.x) / d, (y - other.y) / d
            push = STRENGTH * exp((radius + other.radius - d) / RANGE)
            ahead = -(nx * v_x + ny * v_y) / max(hypot(v_x, v_y), 1e-9)
            push *= BEHIND + (1.0 - BEHIND) * 0.5 * (1.0 + ahead)
            # A little to the right, as people do: two who meet do not stand.
            ax += push * (nx + 0.2 * ny)
            ay += push * (ny - 0.2 * nx)
        v_x, v_y = v_x + dt * ax, v_y + dt * ay
        scale = min(1.0, 1.3 * speed / max(hypot(v_x, v_y), 1e-9))
        chosen.append((scale * v_x, scale * v_y))
    return chosen
