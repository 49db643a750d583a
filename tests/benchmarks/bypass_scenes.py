"""More random scenes, by the recipe of `crossed_scenes`, for the bypass.

"blocked": O stands on the target's own line, within D_safe of the final pose, for 6 s;
then it leaves at 40 mm/s for a place that frees it. "crowded": one or two more tools
stand in the cavity besides the one that is across; start and final pose are clear of
all, and all leave 26.5 mm at G_R. "noisy" scenes are the moving ones.
"""

from dataclasses import replace

import numpy as np

from systems.common.geometry import (
    Vector,
    closest_on_segment,
    closest_points,
    norm,
    sub,
)
from tests.benchmarks.crossed_scenes import (
    CONTACT,
    Leg,
    Scene,
    draw_fulcrum,
    draw_tip,
    scene,
)

BLOCKED_TIME = 6.0
_LEAVING_SPEED = 0.04
_FREE = CONTACT + 0.003
_FROM_G_R = 0.0265
_BLOCKED = 0.007
_TRIES = 300


def blocked_scene(seed: int, number: int) -> Scene:
    """O stands on the target's line, then leaves."""
    rng = np.random.default_rng([seed, 11, number])
    while True:
        drawn = _draw_blocked(rng)
        if drawn is not None:
            return drawn


def _draw_blocked(rng: np.random.Generator) -> Scene | None:
    dome = rng.uniform(0.1, 0.12)
    g_r, g_o = draw_fulcrum(rng, dome), draw_fulcrum(rng, dome)
    if norm(sub(g_r, g_o)) < 0.06:
        return None
    start, goal = draw_tip(rng, dome, g_r), draw_tip(rng, dome, g_r)
    if norm(sub(goal, start)) < 0.03:
        return None
    for _ in range(_TRIES):
        tip = draw_tip(rng, dome, g_o)
        rho = closest_points(g_r, goal, g_o, tip)[2]
        if rho < _BLOCKED and _stands_well(g_r, g_o, tip, start):
            break
    else:
        return None
    for _ in range(_TRIES):
        away = draw_tip(rng, dome, g_o)
        leg = Leg(BLOCKED_TIME, tip, away, _LEAVING_SPEED)
        clear = closest_points(g_r, goal, g_o, away)[2] >= _BLOCKED + 0.004
        between = [leg.at(BLOCKED_TIME + 0.1 * k)[0] for k in range(50)]
        if clear and all(_far_from(g_r, g_o, p, 0.03) for p in between):
            stand = Leg(0.0, tip, tip, _LEAVING_SPEED)
            return Scene(g_r, start, goal, g_o, [replace(stand), leg])
    return None


def _far_from(g_r: Vector, g_o: Vector, tip: Vector, distance: float) -> bool:
    return closest_on_segment(g_r, g_o, tip)[1] >= distance


def _stands_well(g_r: Vector, g_o: Vector, tip: Vector, pose: Vector) -> bool:
    """Whether a tool is clear of R's pose and of its fulcrum."""
    clear = closest_points(g_r, pose, g_o, tip)[2] >= CONTACT + 0.005
    return clear and _far_from(g_r, g_o, tip, _FROM_G_R)


def crowded_scene(seed: int, number: int) -> Scene:
    """A standing scene with one or two more tools."""
    rng = np.random.default_rng([seed, 12, number])
    more = 1 + number % 2
    k = number
    while True:
        base = scene("standing", seed + 1000, k)
        k += 100_000
        others: list[tuple[Vector, Vector]] = []
        dome = norm(base.p_WGr)
        for _ in range(_TRIES):
            g = draw_fulcrum(rng, dome)
            tip = draw_tip(rng, dome, g)
            taken = [base.p_WGr, base.p_WGo, *(other[1] for other in others)]
            if any(norm(sub(g, one)) < 0.04 for one in taken):
                continue
            free = closest_points(base.p_WGr, base.p_WPs, g, tip)[2] >= _FREE
            if free and _stands_well(base.p_WGr, g, tip, base.p_WPr):
                others.append((tip, g))
            if len(others) == more:
                return replace(base, others=tuple(others))
