"""The snake in any diagram: its blocks from a tool's pose to where it is, and wires.

Its wires are as stiff as their drums, the paper's ideal, or statics: each ball turns as
wires, core, friction and load have it.
"""

from dataclasses import dataclass, replace
from typing import Any

from pydrake.common import RandomDistribution
from pydrake.systems.primitives import RandomSource

from plants.snake.core import SnakeCoreParams
from plants.snake.friction import SnakeFrictionParams
from plants.snake.parameters import SnakeParams
from plants.snake.signals import Stability, ToolForce
from systems.common.parameter import Rules, parameter, part
from systems.common.signal import size
from systems.resection.wires.ball_location import BallAngles, BallLocation, Gaps
from systems.resection.wires.hysteresis_compensation import (
    HysteresisCompensation,
    HysteresisCompensationParams,
)
from systems.resection.wires.resection_ik import ResectionIk
from systems.resection.wires.snake_location import SnakeLocation
from systems.resection.wires.tool_load import ToolLoad, ToolLoadParams
from systems.resection.wires.tool_tracker import (
    PoseNoise,
    ToolTracker,
    ToolTrackerParams,
)
from systems.resection.wires.wire_drums import WireDrums
from systems.resection.wires.wire_forward_actuation import WireForwardActuation
from systems.resection.wires.wire_inverse_actuation import (
    PAPERS,
    WireInverseActuation,
    wound_lengths,
)
from systems.resection.wires.wire_statics import WireStatics
from systems.resection.wires.wire_tension import WireTension
from systems.resection.wires.wire_watch import WireWatch

COMPENSATIONS = ("none", "model", "tracked")

WIRES = (
    # What is asked for becomes a posture, and the posture lengths of wires.
    ("resection_ik.posture", "wire_inverse_actuation.posture"),
    ("wire_inverse_actuation.drums", "wire_drums.command"),
    # Where the snake is, and whether a wire is slack.
    ("plant.snake_state", "snake_location.state"),
    ("wire_watch.stop", "wire_drums.stop"),
)
"""Signals of all wire models."""

DRUM_WIRES = (
    # The lengths impose a posture.
    ("wire_drums.rates", "wire_forward_actuation.rates"),
    ("wire_drums.lengths", "wire_forward_actuation.lengths"),
    ("wire_forward_actuation.desired_state", "plant.snake_desired_state"),
    ("plant.snake_state", "wire_tension.state"),
    ("plant.snake_net_actuation", "wire_tension.net_actuation"),
    ("wire_tension.tension", "wire_watch.tension"),
)

STATICS_WIRES = (
    ("wire_drums.lengths", "wire_statics.lengths"),
    ("wire_drums.rates", "wire_statics.rates"),
    ("snake_location.tool", "tool_load.tool"),
    ("tool_load.force", "wire_statics.force"),
    ("wire_statics.desired_state", "plant.snake_desired_state"),
    ("wire_statics.tension", "wire_watch.tension"),
    ("wire_statics.stability", "wire_watch.stability"),
)

TRACKER_WIRES = (
    ("snake_location.tool", "tool_tracker.tool"),
    ("tracker_noise.output", "tool_tracker.noise"),
    ("tool_tracker.measured", "wire_inverse_actuation.measured"),
)

DRUM_EXPORTS = {"wires.tension": "wire_tension.tension"}
STATICS_EXPORTS = {
    "snake.balls": "snake_location.balls",
    "snake.gaps": "snake_location.gaps",
    "wires.tension": "wire_statics.tension",
    "wires.stability": "wire_statics.stability",
    "tool.force": "tool_load.force",
}

STATICS_SIGNALS = {
    "snake.balls": BallAngles,
    "snake.gaps": Gaps,
    "wires.stability": Stability,
    "tool.force": ToolForce,
}


@dataclass
class FreeBallsParams:
    """What a scenario has whose snake may be one of free balls, by `wires=statics`."""

    core: SnakeCoreParams = part(SnakeCoreParams)
    friction: SnakeFrictionParams = part(SnakeFrictionParams)
    compensation: str = parameter(
        "none",
        "of friction and load: none, by a model, or by a model and a tracked tool",
        choices=COMPENSATIONS,
    )
    hysteresis: HysteresisCompensationParams = part(HysteresisCompensationParams)
    tracker: ToolTrackerParams = part(ToolTrackerParams)
    load: ToolLoadParams = part(ToolLoadParams)

    def rules(self) -> Rules:
        """Wires know what is asked of them."""
        free, told = is_free(self), "without wires='statics'"
        yield free or not any(self.load.force), "load.force", f"zero {told}"
        yield free or not self.load.cutting, "load.cutting", f"zero {told}"
        smooth = not (self.friction.wire or self.friction.socket)
        yield free or smooth, "friction", f"none {told}, that know it"
        plain = self.compensation == "none"
        yield free or plain, "compensation", f"none {told}, that know friction"


def is_free(robot: Any) -> bool:
    """Whether the balls of a scenario's snake turn freely."""
    return bool(robot.wires == "statics")


def joints(robot: Any) -> str:
    """The joints of its plant, as `add_snake` has them."""
    return "spherical" if is_free(robot) else "coupled"


def snake_wires(robot: Any) -> tuple[tuple[str, str], ...]:
    """The wires of a scenario's snake, from `resection_ik.posture` on."""
    if not is_free(robot):
        return WIRES + DRUM_WIRES
    tracked = robot.compensation == "tracked"
    return WIRES + STATICS_WIRES + (TRACKER_WIRES if tracked else ())


def snake_exports(robot: Any) -> dict[str, str]:
    """What is exported of it besides what every snake has."""
    return STATICS_EXPORTS if is_free(robot) else DRUM_EXPORTS


def snake_chain(robot: Any, snake: SnakeParams, posture: list[float]) -> dict[str, Any]:
    """The blocks of `snake_wires`; arguments as of `wire_chain`."""
    return (statics_chain if is_free(robot) else drum_chain)(robot, snake, posture)


def wire_chain(
    robot: Any,
    snake: SnakeParams,
    posture: list[float],
    core: SnakeCoreParams = PAPERS,
    **winding: Any,
) -> dict[str, Any]:
    """The blocks from a tool's pose to the drums, whatever the wires are.

    Args:
        robot: Has the parameters of each, `drive` and `period`.
        snake: The robot's geometry.
        posture: Where it starts, (7,).
        core: What stands between the balls.
        **winding: Parameters of the winding that are not the robot's.
    """
    wound = replace(robot.inverse_actuation, period=robot.period, **winding)
    lengths = wound_lengths(posture, wound, snake, robot.drive, core)
    return {
        "resection_ik": ResectionIk(
            replace(robot.resection_ik, period=robot.period), snake, posture
        ),
        "wire_inverse_actuation": WireInverseActuation(
            wound, snake, robot.drive, posture, core
        ),
        "wire_drums": WireDrums(
            replace(robot.drums, period=robot.period), snake, lengths
        ),
        "snake_location": SnakeLocation(snake),
        "wire_watch": WireWatch(replace(robot.watch, period=robot.period)),
    }


def drum_chain(
    robot: Any, snake: SnakeParams, posture: list[float], **winding: Any
) -> dict[str, Any]:
    """As `wire_chain`, and what stiff wires impose: the blocks of `DRUM_WIRES`."""
    return {
        **wire_chain(robot, snake, posture, **winding),
        "wire_forward_actuation": WireForwardActuation(
            snake, robot.drive, robot.period, posture
        ),
        "wire_tension": WireTension(robot.tension, snake),
    }


def statics_chain(
    robot: Any, snake: SnakeParams, posture: list[float]
) -> dict[str, Any]:
    """As `wire_chain`, for free balls: of `STATICS_WIRES` and `TRACKER_WIRES`."""
    stiffness = robot.drive.wire_stiffness
    blocks = {
        **wire_chain(robot, snake, posture, robot.core, stiffness=stiffness),
        "snake_location": BallLocation(snake),
        "tool_load": ToolLoad(replace(robot.load, period=robot.period)),
        "wire_statics": WireStatics(
            snake, robot.drive, robot.core, robot.period, posture, robot.friction
        ),
    }
    if robot.compensation != "none":
        # In place of the paper's map from a posture to drums.
        blocks["wire_inverse_actuation"] = HysteresisCompensation(
            replace(robot.hysteresis, period=robot.period),
            robot.inverse_actuation,
            snake,
            robot.drive,
            robot.core,
            posture,
        )
    if robot.compensation == "tracked":
        blocks["tool_tracker"] = ToolTracker(robot.tracker)
        blocks["tracker_noise"] = RandomSource(
            RandomDistribution.kGaussian, size(PoseNoise), robot.tracker.period
        )
    return blocks


def ball_figures(run: Any) -> dict[str, Any]:
    """How far the balls of a run's modules part, and whether the snake stayed."""
    alarm, gaps = run.watch.alarm, run.snake.gaps
    time, module = float(alarm.time[-1]), float(alarm.module[-1])
    return {
        "max_split": float(gaps.split.max()),
        "max_torsion": float(abs(gaps.torsion).max()),
        "least_eigenvalue": float(run.wires.stability.least_eigenvalue.min()),
        "buckled_at": time if time >= 0.0 and module == 0.0 else None,
        "stops": int(time >= 0.0),
    }
