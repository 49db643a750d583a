"""Contact of the surgeon's obstacle tools with the robot's: systems, wires, figures."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

from diagrams.bedside.bedside import Bedside
from plants.surgeon.held_tools import HandForce, HeldTools, add_held_tools, joints_of
from systems.common.signal import Many, reader, vector
from systems.common.signals import Shaft
from systems.motion.touch_yield import TouchYield
from systems.sensing.touch_watch import Touched, TouchWatch

read_shaft = reader(Shaft)


def held_names(scenario: Any) -> list[str]:
    """The tools that have contact; none if it is switched off."""
    held = scenario.held_tools.active
    return [tool.name for tool in scenario.obstacles] if held else []


def shaft_port(scenario: Any, name: str) -> str:
    """Where a tool's true shaft comes from: its hand, or what the hand holds."""
    if name in held_names(scenario):
        return f"held_tools.{name}_shaft"
    return f"{name}_tool.shaft"


def hold(scenario: Any) -> Callable[[Any, Any], dict[str, Any]]:
    """What adds the tools that have contact to a plant and its SceneGraph."""
    if not scenario.held_tools.active:
        return lambda plant, scene_graph: {}
    fulcrums = {tool.name: tool.p_WG for tool in scenario.obstacles}
    return lambda plant, scene_graph: add_held_tools(
        plant, scene_graph, fulcrums, scenario.held_tools
    )


def add_contact(
    builder: Any, scenario: Any, theatre: Bedside, blocks: Mapping[str, Any]
) -> dict[str, Any]:
    """Adds what leads the held tools, each where its hand is at the start.

    Args:
        builder: The diagram's builder.
        scenario: A gauze scenario.
        theatre: Whose plant has the tools.
        blocks: Of which the hands are `NAME_tool`.

    Returns:
        The systems by name.
    """
    if not theatre.held:
        return {}
    plant = theatre.systems["plant"]
    starts = {}
    for name, tool in theatre.held.items():
        hand = blocks[f"{name}_tool"]
        at = hand.GetOutputPort("shaft").Eval(hand.CreateDefaultContext())
        starts[name] = joints_of(vector(tool.p_WG), read_shaft(at))
        plant.SetDefaultPositions(tool.instance, starts[name])
    block = HeldTools(theatre.held, starts, scenario.held_tools)
    builder.AddNamedSystem("held_tools", block)
    results = plant.get_contact_results_output_port()
    builder.Connect(results, block.GetInputPort("contact_results"))
    for name, tool in theatre.held.items():
        state = plant.get_state_output_port(tool.instance)
        builder.Connect(state, block.GetInputPort(f"{name}_state"))
        desired = block.GetOutputPort(f"{name}_desired")
        builder.Connect(desired, plant.get_desired_state_input_port(tool.instance))
    return {"held_tools": block}


def wires(scenario: Any) -> list[tuple[str, str]]:
    """From the hands to what they hold, and to the wrist what it does to the robot."""
    names = held_names(scenario)
    if not names:
        return []
    hands = [(f"{name}_tool.shaft", f"held_tools.{name}") for name in names]
    return [*hands, ("held_tools.on_robot", "wrist_sensor.touching")]


YIELD_WIRES = (
    ("tool_wrench.shaft", "touch_watch.shaft"),
    ("fulcrum_estimator.estimate", "touch_watch.estimate"),
    ("passive_wrist.permission", "touch_watch.permission"),
    ("go_to_target.guide", "touch_watch.guide"),
    ("wrench_watch.believed", "touch_watch.believed"),
    ("touch_watch.told", "fulcrum_estimator.wrench"),
    ("clearance_constraint.v_safe", "touch_yield.v_safe"),
    ("go_to_target.guide", "touch_yield.guide"),
    ("robot_location.robot_tool", "touch_yield.robot_tool"),
    ("passive_wrist.permission", "touch_yield.wrist"),
    ("touch_watch.touch", "touch_yield.touch"),
    ("touch_yield.v_R", "tool_navigation.v_R"),
    ("touch_yield.permission", "tool_navigation.permission"),
)
"""A push is told from the wall's force, and the navigation gives way to it."""


def add_yield(builder: Any, scenario: Any) -> dict[str, Any]:
    """Adds what gives way; returns the systems by name."""
    if not scenario.touch_yield.active:
        return {}
    navigation = scenario.navigation
    how = replace(
        scenario.touch_yield,
        period=navigation.period,
        least_guide=navigation.min_proportion,
    )
    watch = replace(
        scenario.touch_watch,
        period=scenario.tool_wrench.period,
        length=scenario.instrument.length,
    )
    systems = {"touch_watch": TouchWatch(watch), "touch_yield": TouchYield(how)}
    return {n: builder.AddNamedSystem(n, block) for n, block in systems.items()}


def yielding(scenario: Any, wires: list[tuple[str, str]]) -> list[tuple[str, str]]:
    """A diagram's wires with those of a robot that gives way, in place of some."""
    if not scenario.touch_yield.active:
        return wires
    taken = {sink for _, sink in YIELD_WIRES}
    sensed, wall = "tool_wrench.wrench", "touch_watch.wall"
    kept = [(wall if s == sensed else s, t) for s, t in wires if t not in taken]
    return [*kept, *YIELD_WIRES, (sensed, "touch_watch.wrench")]


def exports(scenario: Any) -> dict[str, str]:
    """What can be logged of it."""
    found = {"hand_force": "held_tools.hand_force"} if held_names(scenario) else {}
    felt = scenario.touch_yield.active
    return found | ({"wrist.touch": "touch_watch.touch"} if felt else {})


def contact_signals(scenario: Any) -> dict[str, Any]:
    """What is logged of it."""
    names = held_names(scenario)
    found: dict[str, Any] = {}
    if names:
        found["hand_force"] = Many(HandForce, tuple(names))
    return found | ({"wrist.touch": Touched} if scenario.touch_yield.active else {})


def contact_figures(run: Any) -> dict[str, Any]:
    """The figures of a run whose tools have contact."""
    if not held_names(run.scenario):
        return {}
    force = run.hand_force
    return {
        "max_hand_force": float(force.peak[-1].max()),
        "max_grip_force": float(force.grip.max()),
    }
