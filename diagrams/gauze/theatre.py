"""The operating theatre: one continuous plant, and the bodies that people hold."""

from typing import Any

from diagrams.bedside.bedside import Bedside, add_bedside
from diagrams.gauze import contact
from diagrams.gauze.tools import in_the_way
from plants.instruments.clearance import add_clearance
from plants.instruments.posed_tools import PosedToolsParams, add_posed_tools
from plants.instruments.tool_shaft import add_tool_shaft


def add_theatre(builder: Any, scenario: Any, bedside: Bedside | None = None) -> Bedside:
    """Adds arm, instrument, abdomen and the surgeon's tools to a diagram.

    Args:
        builder: The diagram's builder.
        scenario: A gauze scenario.
        bedside: Arm, instrument and abdomen, if they are there already.

    Raises:
        ValueError: If the start cannot be reached.
    """
    bedside = bedside or add_bedside(builder, scenario, hold=contact.hold(scenario))
    plant, scene_graph = bedside.systems["plant"], bedside.systems["scene_graph"]
    if scenario.registration.active:
        bedside.systems["marker_shaft"] = add_tool_shaft(
            builder, plant, bedside.instrument, markers=True
        )
    tools = [(tool.name, tool.role) for tool in scenario.tools]
    looks = PosedToolsParams(
        view_half_angle=scenario.camera.half_angle,
        fulcrums=[tool.p_WG for tool in scenario.tools],
    )
    posed = add_posed_tools(builder, scene_graph, plant, looks, tools)
    bedside.systems["posed_tools"] = posed
    bedside.systems["clearance"] = add_clearance(
        builder,
        plant,
        scene_graph,
        bedside.instrument.shaft_geometry,
        posed,
        in_the_way(scenario.tools),
    )
    return bedside
