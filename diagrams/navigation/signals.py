"""What is logged of a navigation, and its named view."""

from typing import Any

from plants.crowd.signals import OBSTACLES
from plants.turtlebot.turtlebot import Command, RobotState
from systems.common.signal import view
from systems.switching.signals import Mode, PlanarVelocity

SIGNALS = {
    "robot.state": RobotState,
    "obstacles.rows": OBSTACLES,
    "planner.v_R": PlanarVelocity,
    "planner.mode": Mode,
    "control.command": Command,
}
"""Signals by exported port."""


def logged(run: Any, name: str) -> Any:
    """A logged signal of a run; its fields are arrays over the samples."""
    return view(SIGNALS[name], run.matrix(name))
