"""What every arm in a patient has when it is run live: figures, faults, a cough."""

from typing import Any

import numpy as np

from diagrams.common.live import Figure, Switch
from plants.abdomen.breath import COUGH
from plants.abdomen.wall_motion import Course
from systems.common.signals import Force, Permission, RobotTool
from systems.common.stops import Stop

THROWN = (0.0, 0.0, 0.006)
"""By a cough, if the scenario does not say how far [m]."""
SOON = 0.05
"""After its button a cough begins [s]: later than the knots of what is under way."""


def force_on_wall(session: Any) -> float:
    """What the shaft does to the wall [N]."""
    return float(np.linalg.norm(session.read("wall.force", Force).f))


WALL = Figure("wall force [N]", force_on_wall, 0.0, 50.0, 0.01, 1.0)


def wrist_switches(scenario: Any) -> list[Switch]:
    """What can fail where the fulcrum is found by force."""
    return [
        Switch("wrong fulcrum", "fulcrum_aside", 3.0, 0.008),
        Switch("force sensor silent", "force_silent", 1.0),
    ]


class Cough:
    """A button: the patient coughs, soon."""

    def __init__(self, scenario: Any) -> None:
        """Prepares it; the wall must move by itself already."""
        motion = scenario.wall_motion
        motion.cough = motion.cough if any(motion.cough) else [*THROWN]
        self._course = Course(motion, scenario.abdomen, scenario.duration)

    def __call__(self, session: Any) -> None:
        """Presses it."""
        motion, start = session.scenario.wall_motion, session.time + SOON
        motion.irregular.coughs = [*motion.irregular.coughs, start]
        self.throw(session, start, start + COUGH + 0.1)

    def throw(self, session: Any, start: float, end: float) -> None:
        """Changes what moves, from a time to another in s."""
        self._course.change(session.scenario.wall_motion, start, end)
        source = session.station.GetSubsystemByName("wall_motion")
        source.UpdateTrajectory(self._course.trajectory)


def tool_of_robot(session: Any) -> tuple[np.ndarray, np.ndarray]:
    """Tip and direction of the robot's tool."""
    tool = session.read("robot.tool", RobotTool)
    along = tool.tip - tool.fulcrum
    return tool.tip, along / np.linalg.norm(along)


def stop_of(code: float) -> str:
    """Why the robot stands."""
    return next(stop for stop in Stop if stop == round(float(code))).text


def allowed(session: Any) -> str:
    """What the passive wrist says, if the robot stands for it."""
    told = session.read("wrist.permission", Permission)
    return stop_of(told.code)
