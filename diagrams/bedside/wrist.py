"""Figure 2's "passive wrist emulation control", for every diagram that has an arm."""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Any

from pydrake.systems.framework import DiagramBuilder

from diagrams.bedside.bedside import Bedside
from plants.abdomen.wall_motion import WallMotionParams
from plants.instruments.tip_push import TipPushParams
from systems.common.parameter import Rules, parameter, part
from systems.common.signals import (
    Fulcrum,
    MovingPoint,
    Permission,
    Point,
    Shaft,
    ShaftMotion,
    Wrench,
)
from systems.motion.straight_tool import StraightTool
from systems.passive_wrist.fulcrum_estimator import Covariance, FulcrumEstimator
from systems.passive_wrist.fulcrum_filter import FulcrumParams
from systems.passive_wrist.navigation_monitor import (
    Accuracy,
    NavigationMonitor,
    NavigationMonitorParams,
)
from systems.passive_wrist.passive_wrist_emulation import PassiveWristEmulation
from systems.passive_wrist.tip_load import TipForce, TipLoad, TipLoadParams
from systems.passive_wrist.wrist_law import MODES, WristParams
from systems.sensing.shaft_bend import ShaftBend, ShaftBendParams
from systems.sensing.tool_wrench import (
    ToolWrenchParams,
    add_tool_wrench,
    told_instrument,
)
from systems.sensing.wrench_watch import WrenchWatch, WrenchWatchParams

WRIST_WIRES = (
    ("tool_wrench.shaft", "fulcrum_estimator.shaft"),
    ("tool_wrench.shaft", "wrench_watch.shaft"),
    ("tool_wrench.wrench", "wrench_watch.wrench"),
    ("wrench_watch.believed", "fulcrum_estimator.wrench"),
    ("tool_wrench.shaft", "passive_wrist.shaft"),
    ("wrench_watch.believed", "passive_wrist.wrench"),
    ("fulcrum_estimator.estimate", "passive_wrist.estimate"),
    ("wall_force.fulcrum", "passive_wrist.true_fulcrum"),
    ("passive_wrist.tool", "joint_commands.tool"),
    ("passive_wrist.permission", "joint_commands.permission"),
    ("tool_wrench.shaft", "navigation_monitor.shaft"),
    ("wrench_watch.believed", "navigation_monitor.wrench"),
    ("fulcrum_estimator.estimate", "navigation_monitor.estimate"),
    ("passive_wrist.permission", "navigation_monitor.permission"),
)
"""Sensor, estimator, emulation and monitor; the task's tool goes to `tool_wanted`."""

TIP_WIRES = (
    ("tool_wrench.shaft", "tip_load.shaft"),
    ("tool_wrench.wrench", "tip_load.wrench"),
    ("fulcrum_estimator.estimate", "tip_load.estimate"),
    ("tip_load.wall", "wrench_watch.wrench"),
)
"""What takes the place of the wire to the watch where tip and wall are told apart."""


BENT = {
    "tool_wrench.shaft": "shaft_bend.bent_shaft",
    "tool_wrench.wrench": "shaft_bend.bent_wrench",
}
"""What takes the place of the sensor where the shaft's bend is reckoned."""
BEND_WIRES = (
    ("tool_wrench.shaft", "shaft_bend.shaft"),
    ("tool_wrench.wrench", "shaft_bend.wrench"),
    ("shaft_bend.bend", "robot_location.bend"),
    ("shaft_bend.bend", "straight_tool.bend"),
    ("straight_tool.tool", "joint_commands.tool"),
)


def unbent(scenario: Any, wires: Iterable[tuple[str, str]]) -> list[tuple[str, str]]:
    """The wires with the shaft's bend reckoned, if it is."""
    if not scenario.shaft_bend.active:
        return [*wires]
    through = {"joint_commands.tool": "straight_tool.wanted"}
    led = [(BENT.get(a, a), through.get(b, b)) for a, b in wires]
    return [*led, *BEND_WIRES]


def wrist_wires(scenario: Any) -> list[tuple[str, str]]:
    """The wires of sensor, estimator and emulation; `tool_wanted` is left."""
    if not scenario.tip_load.active:
        return [*WRIST_WIRES]
    direct = ("tool_wrench.wrench", "wrench_watch.wrench")
    return [*(wire for wire in WRIST_WIRES if wire != direct), *TIP_WIRES]


def wrist_exports(scenario: Any) -> dict[str, str]:
    """What can be logged of it."""
    exports = WRIST_EXPORTS | (TIP_EXPORTS if scenario.tip_load.active else {})
    bends = scenario.instrument.bending_stiffness
    return exports | (BEND_EXPORTS if bends else {})


def wrist_signals(scenario: Any) -> dict[str, Any]:
    """What is logged of it."""
    signals = WRIST_SIGNALS | (TIP_SIGNALS if scenario.tip_load.active else {})
    bends = scenario.instrument.bending_stiffness
    return signals | (BEND_SIGNALS if bends else {})


WRIST_EXPORTS = {
    "wrist.fulcrum": "fulcrum_estimator.estimate",
    "wrist.covariance": "fulcrum_estimator.covariance",
    "wrist.pivot": "passive_wrist.pivot",
    "wrist.permission": "passive_wrist.permission",
    "wrist.accuracy": "navigation_monitor.accuracy",
    "wrist.wrench": "tool_wrench.wrench",
    "wrist.shaft": "tool_wrench.shaft",
    "wall.fulcrum": "wall_force.fulcrum",
}
"""What can be logged of it."""

WRIST_SIGNALS = {
    "wrist.fulcrum": Fulcrum,
    "wrist.covariance": Covariance,
    "wrist.pivot": Point,
    "wrist.permission": Permission,
    "wrist.accuracy": Accuracy,
    "wrist.wrench": Wrench,
    "wrist.shaft": ShaftMotion,
    "wall.fulcrum": MovingPoint,
}
"""What is logged of it."""


TIP_EXPORTS = {"wrist.tip_force": "tip_load.tip_force"}
TIP_SIGNALS = {"wrist.tip_force": TipForce}
"""The same where tip and wall are told apart."""
BEND_EXPORTS = {"robot.shaft": "tool_shaft.shaft"}
BEND_SIGNALS = {"robot.shaft": Shaft}
"""The same where the shaft bends: the true one."""


@dataclass
class TipSettings:
    """What a scenario says of the tip's load, and of the shaft's bend."""

    tip_load: TipLoadParams = part(TipLoadParams)
    tip_push: TipPushParams = part(TipPushParams)
    shaft_bend: ShaftBendParams = part(ShaftBendParams)


@dataclass
class WristSettings:
    """What a scenario says of the wrist and the wall."""

    wrist: str = parameter("known", "whose fulcrum the wrist believes", choices=MODES)
    first_guess: list[float] = parameter(
        [0.0, 0.0, 0.0],
        "error of the first guess of the fulcrum, in W",
        "m",
        least=-0.05,
        most=0.05,
        shape=(3,),
    )
    wall_motion: WallMotionParams = part(WallMotionParams)
    tool_wrench: ToolWrenchParams = part(ToolWrenchParams)
    wrench_watch: WrenchWatchParams = part(WrenchWatchParams)
    fulcrum_estimator: FulcrumParams = part(FulcrumParams)
    passive_wrist: WristParams = part(WristParams)
    navigation_monitor: NavigationMonitorParams = part(NavigationMonitorParams)

    def rules(self) -> Rules:
        """What must hold across fields."""
        yield from share_instants(self, WRIST_BLOCKS)


WRIST_BLOCKS = (
    *("tool_wrench", "wrench_watch", "fulcrum_estimator", "passive_wrist"),
    "navigation_monitor",
)
"""They share the joints' instants."""


def share_instants(scenario: Any, names: Iterable[str]) -> Rules:
    """Blocks that share the joints' instants have their period."""
    period = scenario.joints.period
    for name in names:
        shared = abs(getattr(scenario, name).period - period) <= 1e-9
        yield shared, f"{name}.period", f"joints.period={period} s, shared by both"


def add_wrist(
    builder: DiagramBuilder, bedside: Bedside, scenario: Any
) -> dict[str, Any]:
    """Adds sensor, estimator and emulation; wire them with `WRIST_WIRES`.

    Args:
        builder: The diagram's builder.
        bedside: The plant's parts.
        scenario: Has the fields of `WristSettings`, `robot` and `instrument`.

    Returns:
        The systems by name.

    Raises:
        ValueError: If a parameter makes no sense or the sensor's frame is not there.
    """
    guess = [
        p + e for p, e in zip(scenario.robot.p_WG, scenario.first_guess, strict=True)
    ]
    sensor = replace(scenario.tool_wrench, seed=scenario.seed)
    bend = getattr(scenario, "shaft_bend", ShaftBendParams())
    late = sensor.delay * sensor.period if sensor.aligned else 0.0
    estimator = replace(
        scenario.fulcrum_estimator,
        guess=guess,
        length=scenario.instrument.length,
        latency=late + (bend.smooth if bend.active else 0.0),
    )
    wrist = replace(scenario.passive_wrist, mode=scenario.wrist, guess=guess)
    systems = {
        "tool_wrench": add_tool_wrench(
            builder,
            bedside.systems["plant"],
            sensor,
            told_instrument(sensor, scenario.instrument),
            bedside.abdomen,
            bedside.below,
            scenario.wall_motion.stiffness_factor,
        ),
        "wrench_watch": WrenchWatch(scenario.wrench_watch, guess),
        "fulcrum_estimator": FulcrumEstimator(estimator),
        "passive_wrist": PassiveWristEmulation(wrist),
        "navigation_monitor": NavigationMonitor(scenario.navigation_monitor),
    }
    systems["wrist_sensor"] = builder.GetSubsystemByName("wrist_sensor")
    if push := bedside.systems.get("tip_push"):
        builder.Connect(
            push.get_output_port(),
            systems["wrist_sensor"].GetInputPort("applied_spatial_force"),
        )
    new = [name for name in WRIST_BLOCKS if name != "tool_wrench"]
    tip = getattr(scenario, "tip_load", TipLoadParams())
    if tip.active:
        told = replace(tip, length=scenario.instrument.length, period=sensor.period)
        systems["tip_load"] = TipLoad(told, guess)
        new.append("tip_load")
    if bend.active:
        told_tool = told_instrument(sensor, scenario.instrument)
        reckoned = replace(bend, period=sensor.period)
        systems["shaft_bend"] = ShaftBend(reckoned, told_tool)
        systems["straight_tool"] = StraightTool(sensor.period)
        new += ["shaft_bend", "straight_tool"]
    for name in new:
        builder.AddNamedSystem(name, systems[name])
    return systems
