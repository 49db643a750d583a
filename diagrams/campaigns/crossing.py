"""The open benchmark of tool crossing: frozen scenes, an interface for planners.

    class Mine:
        def step(self, dt, robot, obstacle, target, others=()):
            return 0.0, 0.0, 0.0  # velocity of the robot's tip, m/s

    trocar campaign crossing --planner my_module:Mine

Scenes are those of version 1: a hundred of each kind, drawn once by
`diagrams.gauze.scenes` and kept with a digest, so that a later change of the drawing
changes no result.
"""

from collections.abc import Callable
from dataclasses import asdict
from functools import cache
import gzip
import hashlib
from importlib import import_module
import json
from pathlib import Path
import sys
from typing import Any

from diagrams.common.scenario import ScenarioError, nearest
from diagrams.gauze.kinematic_loop import Planner, run
from diagrams.gauze.kinematic_planners import PLANNERS, ROBOT
from diagrams.gauze.scenes import KINDS, Leg, Scene, scene
from systems.common.geometry import norm, sub

SCENES = Path(__file__).with_name("crossing_scenes_1.json.gz")
DIGEST = "fc03b633ff810a42c62a767076c345f5c40dd418b3737fc5ea6e3ab71896bab7"
"""SHA-256 of what is in it."""
COUNT = 100
"""Scenes of each kind."""
SEED = 20261


def figures(settings: dict[str, Any]) -> dict[str, Any]:
    """Runs a planner through a scene.

    Args:
        settings: `planner`, and `scene`, its number, or what `as_data` gives.

    Raises:
        ScenarioError: If there is no such planner.
    """
    told = settings["scene"]
    given = frozen()[told] if isinstance(told, int) else {"kind": "", "scene": told}
    here, planner = of_data(given["scene"]), make_planner(settings["planner"])()
    way = norm(sub(here.p_WPs, here.p_WPr))
    outcome = run(here, planner)
    time = outcome.time if outcome.reached else None
    return {
        "kind": given["kind"],
        "reached": outcome.reached,
        "contact": outcome.contact,
        "stuck": not (outcome.reached or outcome.contact),
        "clearance": outcome.clearance,
        "time": time,
        "time_ratio": None if time is None else time * ROBOT.max_speed / way,
        "evasion_held": getattr(planner, "holds", True),
        "speed": max(leg.speed for leg in here.legs),
    }


def make_planner(name: str) -> Callable[[], Planner]:
    """What makes a fresh planner: one of the project's, or `module:class`.

    Raises:
        ScenarioError: If there is none.
    """
    if name in PLANNERS:
        return PLANNERS[name]
    module, _, made = name.partition(":")
    if not made:
        raise ScenarioError(f"planner={name!r}: {nearest(name, PLANNERS)}")
    if "" not in sys.path:
        sys.path.insert(0, "")  # one's own lies in the folder where one is
    try:
        maker: Callable[[], Planner] = getattr(import_module(module), made)
    except (ImportError, AttributeError) as error:
        raise ScenarioError(f"planner={name!r}: {error}") from error
    return maker


def as_data(given: Scene) -> dict[str, Any]:
    """A scene as plain data."""
    return json.loads(json.dumps(asdict(given)))


def of_data(data: dict[str, Any]) -> Scene:
    """The scene of plain data."""

    def vector(x: Any) -> Any:
        return tuple(map(float, x))

    legs = [
        Leg(leg["start"], vector(leg["p0"]), vector(leg["p1"]), leg["speed"])
        for leg in data["legs"]
    ]
    points = {name: vector(data[name]) for name in ("p_WGr", "p_WPr", "p_WPs", "p_WGo")}
    others = tuple((vector(p), vector(g)) for p, g in data["others"])
    return Scene(**points, legs=legs, others=others)


@cache
def frozen() -> list[dict[str, Any]]:
    """The benchmark's scenes, each with its kind.

    Raises:
        ScenarioError: If the file is not what was frozen.
    """
    content = gzip.decompress(SCENES.read_bytes())
    if hashlib.sha256(content).hexdigest() != DIGEST:
        raise ScenarioError(f"{SCENES.name}: not the scenes that were frozen")
    scenes: list[dict[str, Any]] = json.loads(content)
    return scenes


def freeze(path: Path) -> str:
    """Draws and writes a new version of the scenes; returns its digest."""
    drawn = [
        {"kind": kind, "scene": as_data(scene(kind, SEED, number))}
        for kind in KINDS
        for number in range(COUNT)
    ]
    content = json.dumps(drawn, separators=(",", ":")).encode()
    path.write_bytes(gzip.compress(content, mtime=0))
    return hashlib.sha256(content).hexdigest()
