"""A tool gets between lens and tips in random scenes: what the camera loses.

Kinematic: `CameraPlanner`'s own step, R and S at one place, O's estimate late and
noisy as the tracker's is. O goes to and from S in one to three strokes, and would hide
the tips from a camera that stands. There are no organs.
"""

from typing import Any, NamedTuple

import numpy as np

from plants.organs.distance import Organs
from plants.organs.organs import OrganSet
from plants.surgeon.tool_motion import waypoint_motion
from systems.common.geometry import closest_points
from systems.common.signal import flat
from systems.common.signals import Estimate, RobotTool, ViewCone
from systems.motion.camera_planner import CameraPlanner, CameraPlannerParams
from systems.motion.endoscope import EndoscopeParams, constants, wanted_tip
from systems.motion.sight import tip_margin

PERIOD = 1.0 / 60.0
SETTLED = 3.0
"""O sets out, and it counts what is seen from then on, s."""
NOTHING = OrganSet.nothing()
ORGANS = Organs(NOTHING.values[0], NOTHING.table[0], np.zeros((1, 6)))


class Scene(NamedTuple):
    """Fulcrums of S, R, O and the camera (4, 3), S's tip (3), O's motion (n, 6)."""

    fulcrums: np.ndarray
    tip: np.ndarray
    motion: np.ndarray


def strokes(rng: Any, tip: np.ndarray) -> tuple[list[float], np.ndarray]:
    """When O is where: it comes near S and leaves, and rests between."""

    def place(low: float, high: float) -> np.ndarray:
        d = rng.normal(size=3)
        d /= np.linalg.norm(d)
        return tip + d * [1.0, 1.0, 0.5] * rng.uniform(low, high)

    times, points = [SETTLED], [place(0.06, 0.12)]
    for k in range(rng.integers(1, 4)):
        if k:
            times.append(times[-1] + rng.uniform(0.3, 3.0))
            points.append(points[-1])
        end = place(0.012, 0.04) if k % 2 == 0 else place(0.06, 0.12)
        way = np.linalg.norm(end - points[-1])
        times.append(times[-1] + max(rng.uniform(1.0, 3.0), 1.875 * way / 0.12))
        points.append(end)
    return times, np.array(points)


def scope_of(scene: Scene) -> EndoscopeParams:
    """The endoscope, which looks at S at first; as in `camera_blocked`."""
    return EndoscopeParams(
        p_WG=scene.fulcrums[3].tolist(),
        p_WS=scene.tip.tolist(),
        standoff=0.11,
        rate=3.0,
        max_speed=0.05,
        max_acceleration=0.2,
    )


def margin(scene: Scene, view: ViewCone, o: np.ndarray) -> float:
    """Of the tips, with O's tip at o, rad."""
    s, r, g, _ = scene.fulcrums
    rows = np.array([[*r, *scene.tip], [*s, *scene.tip], [*g, *o]])
    return tip_margin(view, tuple(scene.tip), rows, ORGANS, 0.2)


def first_view(scene: Scene) -> ViewCone:
    """What the camera sees at first."""
    scope = scope_of(scene)
    p = np.array(wanted_tip(constants(scope)[0], scene.tip))
    u = p - scene.fulcrums[3]
    return ViewCone(tuple(p), tuple(u / np.linalg.norm(u)), scope.half_angle)


def random_scene(rng: Any) -> Scene:
    """A scene in which O touches no shaft, and hides the tips if nothing moves."""
    while True:
        angle, radius = rng.uniform(0.0, 2.0 * np.pi, 4), rng.uniform(0.09, 0.14, 4)
        x, y = 0.03 + radius * np.cos(angle), radius * np.sin(angle)
        fulcrums = np.stack([x, y, np.zeros(4)], 1)
        apart = np.linalg.norm(fulcrums[:, None] - fulcrums[None], axis=2)
        tip = np.array([0.03, 0.0, -0.12]) + rng.uniform(-0.025, 0.025, 3) * [1, 1, 0.6]
        times, points = strokes(rng, tip)
        low, high = points[:, 2].min(), points[:, 2].max()
        if (apart + np.eye(4)).min() < 0.05 or low < -0.16 or high > -0.06:
            continue
        motion = waypoint_motion(times, list(points))
        instants = np.arange(0.0, times[-1] + 3.0, PERIOD)
        scene = Scene(fulcrums, tip, np.array([motion(t) for t in instants]))
        gaps = [
            closest_points(tuple(g), tuple(tip), tuple(fulcrums[2]), tuple(p)).distance
            for p in scene.motion[::6, :3]
            for g in fulcrums[:2]
        ]
        view = first_view(scene)
        seen = [margin(scene, view, p) for p in scene.motion[::6, :3]]
        if min(gaps) > 0.007 and seen[0] > 0.05 and min(seen) < -0.01:
            return scene


def estimates(scene: Scene, rng: Any) -> np.ndarray:
    """What is known of O (n, size of an `Estimate`): 80 ms late in its velocity."""
    v, noise, rows = np.zeros(3), np.zeros(3), []
    for x in scene.motion:
        v = v + (x[3:] - v) * PERIOD / 0.08
        noise = 0.9 * noise + rng.normal(size=3) * 1.4e-3 * np.sqrt(0.19)
        p = x[:3] + rng.normal(size=3) * 2e-4
        told = (3e-4, 3.4e-3, 0.07, 1.0, 0.0)
        zero, g = (0.0, 0.0, 0.0), tuple(scene.fulcrums[2])
        rows.append(flat(Estimate(tuple(p), tuple(v + noise), zero, g, *told)))
    return np.array(rows)


def lost(scene: Scene, rng: Any, plans: bool) -> tuple[float, float, float]:
    """Time that the tips are lost, time that counts, s, and the camera's way, m."""
    none = (0.0, 0.0, 0.0)
    dut = CameraPlanner(CameraPlannerParams(active=True), scope_of(scene))
    context = dut.CreateDefaultContext()
    s, r, _, _ = (tuple(g) for g in scene.fulcrums)
    tip = tuple(scene.tip)
    target = Estimate(tip, none, none, s, 3e-4, 3.4e-3, 0.07, 1.0, 0.0)
    dut.GetInputPort("target").FixValue(context, flat(target))
    dut.GetInputPort("robot_tool").FixValue(context, flat(RobotTool(r, tip)))
    obstacles = dut.GetInputPort("obstacles")
    view, time, apexes = first_view(scene), 0, []
    known = estimates(scene, rng)
    first = round(SETTLED / PERIOD)
    for k, x in enumerate(scene.motion):
        if plans:
            obstacles.FixValue(context, known[k])
            cone = dut.GetOutputPort("view_cone").Eval(context)
            view = ViewCone(tuple(cone[:3]), tuple(cone[3:6]), float(cone[6]))
            context.SetDiscreteState(dut.EvalUniquePeriodicDiscreteUpdate(context))
        if k >= first:
            time += margin(scene, view, x[:3]) <= 0.0
            apexes.append(view.apex)
    way = np.linalg.norm(np.diff(apexes, axis=0), axis=1).sum()
    return time * PERIOD, len(apexes) * PERIOD, float(way)


def report(seed: int, scenes: int) -> str:
    """Time lost, scenes with a loss and the camera's way, beside one that stands."""
    rng = np.random.default_rng(seed)
    known = [random_scene(rng) for _ in range(scenes)]
    lines = ["                 tip lost   scenes with a loss   way, median"]
    for name, plans in (("plans", True), ("stands", False)):
        rows = [lost(x, np.random.default_rng(i), plans) for i, x in enumerate(known)]
        gone, whole, way = np.array(rows).T
        lines.append(
            f"  {name:<14} {100.0 * gone.sum() / whole.sum():6.2f} % "
            f"{(gone > 0.0).sum():10d} of {scenes} {1e3 * np.median(way):12.0f} mm"
        )
    return "\n".join(lines)
