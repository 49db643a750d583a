"""An operation live: the patient coughs, the tracker is blind, hands are in the way."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from diagrams.bedside.live import (
    WALL,
    Cough,
    force_on_wall,
    tool_of_robot,
    wrist_switches,
)
from diagrams.common.live import Figure, Guided, Live, Switch
from diagrams.gauze import live as gauze
from diagrams.keyhole.scenario import KeyholeScenario
from diagrams.resection.live import CUT
from plants.abdomen.organ_motion import OrganCourse, with_axis
from plants.snake.signals import ToolPose
from systems.common.signals import MovingPoint, Shaft
from systems.keyhole.phases import Phases, Reason
from systems.keyhole.signals import Phase


def guided(scenario: KeyholeScenario) -> list[Guided]:
    """The hands beside the tube, if there are any; the target is the organ's."""
    if not scenario.others:
        return []
    names = [tool.name for tool in scenario.theatre.obstacles]
    found = [one for one in gauze.guided(scenario.surgeon) if one.name in names]
    return [replace(one, owner=_inside(one.owner)) for one in found]


def _inside(owner: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda scenario: owner(scenario.theatre)


def held(scenario: KeyholeScenario, names: list[str]) -> KeyholeScenario:
    """Hands at their first places."""
    return replace(scenario, theatre=gauze.held(scenario.theatre, names))


class WholeCough(Cough):
    """A cough throws the organ as well."""

    def __init__(self, scenario: KeyholeScenario) -> None:
        """Prepares it."""
        super().__init__(scenario)
        motion = scenario.organ_motion
        motion.cough = motion.cough if any(motion.cough) else [0.0, 0.0, 0.005]
        self._organ = OrganCourse(
            motion, scenario.wall_motion, scenario.entry.p_WE, scenario.duration
        )

    def throw(self, session: Any, start: float, end: float) -> None:
        """Changes what moves."""
        super().throw(session, start, end)
        self._organ.change(session.scenario.wall_motion, start, end)
        motion, find = self._organ.trajectory, session.station.GetSubsystemByName
        find("organ_motion").UpdateTrajectory(motion)
        shaft = with_axis(motion, session.scenario.axis)
        find("organ_shaft").UpdateTrajectory(shaft)


def acts(scenario: KeyholeScenario) -> Mapping[str, Callable[[Any], None]]:
    """A cough, and a push if a hand is there."""
    found: dict[str, Callable[[Any], None]] = {}
    if scenario.others:
        found["push"] = push
    if not scenario.wall_motion.still:
        found["cough"] = WholeCough(scenario)
    return found


def push(session: Any) -> None:
    """The first hand goes for the tube's end."""
    tip, _ = tool_of_robot(session)
    session.put(session.scenario.theatre.obstacles[0].name, tip)


def words(session: Any) -> str:
    """The phase, and why it was entered."""
    told = session.read("operation.phase", Phase)
    phase = next(p for p in Phases if p == round(float(told.code))).name.lower()
    reason = next(r for r in Reason if r == round(float(told.reason))).text
    return f"{phase}: {reason}"


def figures(scenario: KeyholeScenario) -> list[Figure]:
    """The wall's force, what is cut, and what is near."""
    found = [WALL]
    if scenario.task == "resect":
        found.append(CUT)
    if scenario.others:
        found.append(gauze.CLEARANCE)
    return found


def streamed(session: Any) -> dict[str, Any]:
    """Tube, snake, hands, the tumour's organ, the wall's force."""
    told: dict[str, Any] = {"RobotTool": tool_of_robot(session)}
    told["Snake"] = tuple(session.read("snake.tool", ToolPose))
    told["Tumour"] = (session.read("organ.true", MovingPoint).p, session.scenario.axis)
    if session.scenario.others:
        for tool in session.scenario.theatre.obstacles:
            shaft = session.read(f"{tool.name}.shaft", Shaft)
            told[tool.name.capitalize()] = tuple(shaft)
    return told | {"WallForce": f"{force_on_wall(session):.3f} N"}


LIVE = Live(
    guided=guided,
    held=held,
    switches=lambda scenario: [
        Switch("lose sight", "frame_lost", 1.5),
        *wrist_switches(scenario),
        Switch("tension not read", "tension_nan", 0.1),
    ],
    acts=acts,
    figures=figures,
    words=words,
    moving=lambda session: tool_of_robot(session)[0],
    streamed=streamed,
)
