"""When a delivery is over: the gauze was brought, and nothing else is to happen."""

from collections.abc import Callable
import math
from typing import Any

from diagrams.common.case import Case
from diagrams.gauze.metrics import REACHED_DISTANCE
from diagrams.gauze.scenario import GauzeScenario
from systems.common.geometry import norm, sub
from systems.common.signal import reader
from systems.common.signals import RobotTool, Shaft

read_robot, read_shaft = reader(RobotTool), reader(Shaft)


def last_event(scenario: GauzeScenario) -> float:
    """When the last hand comes to rest, the last loss of sight and push is over [s].

    Infinite where that is not known beforehand. Breathing and tremor are no events.
    """
    held = [scenario.target, *scenario.obstacles]
    wall = scenario.wall_motion
    goes_on = any(t.recording or t.hunt.speed or t.hand.seed or t.pushes for t in held)
    goes_on |= any(t.guided is not None or t.tracked is not None for t in held)
    if goes_on or any(wall.rise) or wall.irregular.coughs or scenario.faults:
        return math.inf
    steps = [wall.step_time + wall.step_duration] if any(wall.step) else []
    losses = [loss.end for loss in scenario.tracker.losses]
    return max(*(tool.times[-1] for tool in held), *losses, *steps)


def ending(case: Case, station: Any) -> Callable[[Any], bool]:
    """What says after every frame, from the root context, whether the run is over.

    It is when the tip was within 2 mm of S's for `linger`, after the last event.
    """
    linger, quiet = case.scenario.linger, last_event(case.scenario)
    if linger == 0.0 or math.isinf(quiet):
        return lambda context: False
    robot = station.GetOutputPort("robot.tool")
    target = station.GetOutputPort(f"{case.scenario.target.name}.shaft")
    since = math.inf

    def is_over(root: Any) -> bool:
        nonlocal since
        time = root.get_time()
        if time < quiet:
            return False
        context = station.GetMyContextFromRoot(root)
        tips = read_robot(robot.Eval(context)).tip, read_shaft(target.Eval(context)).tip
        away = norm(sub(*tips)) > REACHED_DISTANCE
        since = math.inf if away else min(since, time)
        return time - since >= linger - 1e-9

    return is_over
