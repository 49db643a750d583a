"""Whether the endoscope saw both tips in a gauze delivery: figures from true states."""

from typing import Any

import numpy as np

from diagrams.gauze.tools import logged
from plants.organs.distance import Organs
from plants.organs.organs import OrganSet, organ_set
from systems.common.signals import ViewCone
from systems.motion.sight import tip_margin


def margins(run: Any) -> np.ndarray:
    """Of R's and S's true tips over time (n, 2), rad, up to 0.2."""
    scenario = run.scenario
    cone = logged(run, scenario.camera).view_cone
    robot = run.robot.tool
    hands = [scenario.target, *scenario.obstacles]
    tips = [logged(run, tool).shaft.tip for tool in hands]
    known = organ_set(scenario.organs) if scenario.organs else OrganSet.nothing()
    found = np.empty((len(robot.tip), 2))
    for i in range(len(found)):
        rows = [[*robot.fulcrum[i], *robot.tip[i]]]
        rows += [[*t.p_WG, *p[i]] for t, p in zip(hands, tips, strict=True)]
        moved = np.zeros((len(known.names), 6))
        if scenario.organs:
            moved[:, :3] = run.organs.moved.p[i]
        organs = Organs(known.values[0], known.table[0], moved)
        view = ViewCone(tuple(cone.apex[i]), tuple(cone.u[i]), float(cone.half[i]))
        shafts = np.array(rows)
        for k, p in enumerate((robot.tip[i], tips[0][i])):
            found[i, k] = tip_margin(view, tuple(p), shafts, organs, 0.2)
    return found


def sight_figures(run: Any) -> dict[str, Any]:
    """Share of the time that both tips are seen, and the way of the camera's tip."""
    if not run.scenario.judge_sight:
        return {}
    apex = logged(run, run.scenario.camera).view_cone.apex
    path = np.linalg.norm(np.diff(apex, axis=0), axis=1).sum()
    return {
        "tips_in_view": float((margins(run).min(axis=1) > 0.0).mean()),
        "camera_path": float(path),
    }
