"""The passive wrist live: a hand leads the arm's tip, the patient coughs."""

from typing import Any

from diagrams.bedside.live import (
    WALL,
    Cough,
    allowed,
    force_on_wall,
    tool_of_robot,
    wrist_switches,
)
from diagrams.common.live import KEYS, Figure, Guided, Live, Slider
from diagrams.wrist.scenario import WristScenario
from plants.abdomen.wall_force import FulcrumError
from systems.common.signal import vector
from systems.common.signals import Point, RobotTool

AROUND = 50.0
"""Its place at the start the tip can be led [mm]."""


def guided(scenario: WristScenario) -> list[Guided]:
    """The tip."""
    start = scenario.robot.p_WP
    sliders = [
        Slider(f"tip {axis} [mm]", 1e3 * at - AROUND, 1e3 * at + AROUND, keys=keys)
        for axis, at, keys in zip("xyz", start, KEYS[0], strict=True)
    ]
    owner = lambda scenario: scenario  # noqa: E731
    return [Guided("tip", Point, Point(vector(start)), owner, "guided", tuple(sliders))]


def held(scenario: WristScenario, names: list[str]) -> WristScenario:
    """Other modes would have to be led as well."""
    scenario.compare = []
    return scenario


def error(session: Any) -> float:
    """How far the shaft passes the true fulcrum [m]."""
    return float(session.read("wall.fulcrum_error", FulcrumError).distance)


LIVE = Live(
    guided=guided,
    held=held,
    switches=wrist_switches,
    acts=lambda scenario: (
        {} if scenario.wall_motion.still else {"cough": Cough(scenario)}
    ),
    figures=lambda scenario: [
        WALL,
        Figure("off fulcrum [mm]", error, 0.0, 20.0, 0.1),
    ],
    words=allowed,
    moving=lambda session: session.read("robot.tool", RobotTool).tip,
    streamed=lambda session: {
        "RobotTool": tool_of_robot(session),
        "WallForce": f"{force_on_wall(session):.3f} N",
    },
)
