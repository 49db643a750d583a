"""Moving scenes in the full loop: arm, breathing, estimated fulcrum, tracker.

Scenes of the moving set are laid under a flat wall: turned so that both fulcrums lie in
it and the robot's way hangs below. Of the set the first ones are taken whose start and
target the arm can reach (tilt at most 0.6 rad). The target tool stands still and is no
obstacle, and there is no camera in the way, as in the kinematic set; O waits until the
wrist has probed the wall.
"""

from collections.abc import Iterator
from pathlib import Path
import tempfile

import numpy as np

from diagrams.common.run import simulate
from diagrams.gauze.scenes import Scene, scene
from diagrams.studies import load_scenario
from plants.surgeon.recording import save_recording

MAX_TILT = 0.6
PROBING = 1.6
"""The scene begins then, s."""
LIMIT = 15.0
SPEED = 0.1
_STEP = 0.01


def laid(given: Scene) -> tuple[np.ndarray, np.ndarray]:
    """Rotation R and origin o of a scene's own frame: p_W = R (p - o)."""
    g_r, g_o = np.array(given.p_WGr), np.array(given.p_WGo)
    x = (g_o - g_r) / np.linalg.norm(g_o - g_r)
    way = np.array(given.p_WPr) + np.array(given.p_WPs) - 2.0 * g_r
    down = way - (way @ x) * x
    z = -down / np.linalg.norm(down)
    return np.stack([x, np.cross(z, x), z]), g_r


def fits(given: Scene) -> bool:
    """Whether the arm can hang its tool where the scene wants it."""
    turn, origin = laid(given)
    for p in (given.p_WPr, given.p_WPs):
        u = turn @ (np.array(p) - origin)
        if np.arccos(-u[2] / np.linalg.norm(u)) > MAX_TILT:
            return False
    heights = [
        (turn @ (np.array(given.obstacle_tip(t)[0]) - origin))[2]
        for t in np.arange(0.0, 8.0, 0.1)
    ]
    return max(heights) < -0.01


def scenes(seed: int) -> Iterator[tuple[int, Scene]]:
    """Number and scene, for all that fit."""
    number = 0
    while True:
        given = scene("moving", seed, number)
        if fits(given):
            yield number, given
        number += 1


def full_loop(given: Scene, seed: int, folder: Path, settings: list[str]) -> dict:
    """The figures of a scene in the Drake loop."""
    turn, origin = laid(given)

    def placed(p: object) -> list[float]:
        return [round(float(x), 7) for x in turn @ (np.array(p) - origin)]

    times = np.arange(0.0, LIMIT + _STEP, _STEP)
    tips = [placed(given.obstacle_tip(max(0.0, t - PROBING))[0]) for t in times]
    path = folder / "obstacle.csv"
    save_recording(path, times, np.array(tips))
    goal, g_o = placed(given.p_WPs), placed(given.p_WGo)
    g_s = [-0.12, 0.04, 0.0]  # anywhere that is not another's trocar
    aim = [goal[0], goal[1] + 0.01, goal[2]]
    overrides = [
        f"robot.p_WP={placed(given.p_WPr)}",
        f"target={{p_WG: {g_s}, points: [{goal}]}}",
        f"obstacle={{p_WG: {g_o}}}",
        f"recording={path}",
        # An eye high above that sees everything.
        f"camera={{p_WG: [0.0, -0.06, 0.3], p_WS: {aim}, standoff: 0.35, "
        f"half_angle: 1.19}}",
        *(f"{block}.max_speed={SPEED}" for block in ("tool_bypass", "fuzzy_arbiter")),
        "margins.avoid_target=false",
        "margins.avoid_camera=false",
        "clearance_constraint.obstacle_speed=0.06",
        *settings,
    ]
    run = simulate(load_scenario("gauze_breathing", overrides, seed, LIMIT))
    return run.metrics | ({"error": run.error} if run.error else {})


def rows(seed: int, count: int, settings: list[str]) -> Iterator[str]:
    """A line for each scene that went wrong, and the sums at the end."""
    figures = []
    with tempfile.TemporaryDirectory() as folder:
        for number, given in scenes(seed):
            result = full_loop(given, seed, Path(folder), settings)
            figures.append(result)
            if not result["reached"]:
                yield (
                    f"scene {number}: contact {result['contact']}, clearance "
                    f"{1e3 * result['min_tool_clearance']:.2f} mm, final error "
                    f"{1e3 * result['final_tip_error']:.1f} mm, evasion condition held "
                    f"{result['evasion_condition_held']:.3f}, stops "
                    f"{[stop['reason'] for stop in result['stops']][1:]}"
                    f"{' ' + result['error'] if 'error' in result else ''}"
                )
            if len(figures) == count:
                break
    clearance = np.sort([1e3 * f["min_tool_clearance"] for f in figures])
    times = [f["time_to_target"] for f in figures if f["time_to_target"]]
    yield (
        f"{count} scenes: reached {sum(f['reached'] for f in figures)}, contact "
        f"{sum(f['contact'] for f in figures)}; clearance min {clearance[0]:.2f}, "
        f"median {np.median(clearance):.2f} mm; time to target median "
        f"{np.median(times) - PROBING:.2f} s; evasion condition failed in "
        f"{sum(f['evasion_condition_held'] < 1.0 for f in figures)}; greatest force "
        f"after probing {max(f['max_lateral_force'] for f in figures):.2f} N; "
        f"real-time factor median "
        f"{np.median([f['real_time_factor'] for f in figures]):.1f}"
    )


def report(seed: int, scenes: int) -> str:
    """A tenth of the number of scenes, as text: each takes seconds."""
    return "\n".join(rows(seed, max(1, scenes // 10), []))
