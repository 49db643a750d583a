"""A gauze delivery live: the surgeon's hands are guided, the tracker fails."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from diagrams.bedside.live import (
    WALL,
    Cough,
    force_on_wall,
    stop_of,
    tool_of_robot,
    wrist_switches,
)
from diagrams.common.live import KEYS, Figure, Guided, Live, Slider, Switch
from diagrams.gauze.tools import TARGET, HandTool, hands
from plants.surgeon.hunting_tool import Hunt
from plants.surgeon.synthetic_hand import SyntheticHand
from plants.surgeon.tracked_tool import Sighting, unsighted
from systems.common.signal import vector
from systems.common.signals import Point, RobotTool, Shaft
from systems.motion.tool_navigation import StopCode

AROUND = 160.0
"""A tool's trocar, its sliders go [mm]."""
DEEP = 20.0
"""Below its trocar they begin [mm]."""


def tool_named(name: str) -> Callable[[Any], Any]:
    """What finds a tool in a scenario."""
    return lambda scenario: next(t for t in scenario.tools if t.name == name)


def in_hand(scenario: Any) -> list[HandTool]:
    """The surgeon's tools, obstacles first: they have the keys in the left hand."""
    found = hands(scenario.tools, scenario.seed).values()
    return sorted(found, key=lambda tool: tool.role == TARGET)


def guided(scenario: Any) -> list[Guided]:
    """All hands, by their tips."""
    found = []
    for number, tool in enumerate(in_hand(scenario)):
        sliders = []
        for axis, middle in enumerate(tool.p_WG):
            low, high = 1e3 * middle - AROUND, 1e3 * middle + AROUND
            high = 1e3 * middle - DEEP if axis == 2 else high
            keys = KEYS[number % len(KEYS)][axis]
            label = f"{tool.name} {'xyz'[axis]} [mm]"
            sliders.append(Slider(label, low, high, keys=keys))
        rest = Point(vector(tool.points[0]))
        owner = tool_named(tool.name)
        found.append(Guided(tool.name, Point, rest, owner, "guided", tuple(sliders)))
    return found


def tracked(scenario: Any) -> list[Guided]:
    """All hands, by a tracker."""
    return [
        Guided(tool.name, Sighting, unsighted(tool), tool_named(tool.name), "tracked")
        for tool in in_hand(scenario)
    ]


def held(scenario: Any, names: list[str]) -> Any:
    """Tools at their first places, with nothing that moves them."""
    still = {
        "times": [0.0],
        "recording": None,
        "pushes": [],
        "hunt": Hunt(),
        "tremor_rms": 0.0,
        "hand": SyntheticHand(),
        "breathing": [0.0] * 3,
        "carried": [0.0] * 3,
    }
    tools = [
        replace(tool, points=tool.points[:1], **still) if tool.name in names else tool
        for tool in scenario.tools
    ]
    return replace(scenario, tools=tools, linger=0.0, compare=False, time_ratio=False)


def switches(scenario: Any) -> list[Switch]:
    """The tracker loses sight; the wrist's sensor and estimate fail."""
    seen = [Switch("lose sight", "frame_lost", 1.5)]
    return seen + (wrist_switches(scenario) if scenario.emulated else [])


def push(session: Any) -> None:
    """The first obstacle goes for the robot's tip."""
    tip = session.read("robot.tool", RobotTool).tip
    session.put(session.scenario.obstacles[0].name, tip)


def acts(scenario: Any) -> Mapping[str, Callable[[Any], None]]:
    """A push, and a cough of a patient who breathes."""
    found: dict[str, Callable[[Any], None]] = {"push": push}
    if not scenario.wall_motion.still:
        found["cough"] = Cough(scenario)
    return found


def clearance(session: Any) -> float:
    """The least to any tool [m]."""
    return float(session.values("clearance").min())


CLEARANCE = Figure("clearance [mm]", clearance, -5.0, 300.0)


def streamed(session: Any) -> dict[str, Any]:
    """The robot's tool, the surgeon's, the wall's force, and why the robot stands."""
    told: dict[str, Any] = {"RobotTool": tool_of_robot(session)}
    for name in hands(session.scenario.tools, 0):
        told[name.capitalize()] = tuple(session.read(f"{name}.shaft", Shaft))
    return told | {"WallForce": f"{force_on_wall(session):.3f} N"}


LIVE = Live(
    guided=guided,
    held=held,
    switches=switches,
    acts=acts,
    figures=lambda scenario: [CLEARANCE, WALL],
    words=lambda session: stop_of(session.read("navigation.stop", StopCode).code),
    moving=lambda session: session.read("robot.tool", RobotTool).tip,
    tracked=tracked,
    streamed=streamed,
)
