"""True clearances of the robot's tool, surface to surface.

For metrics, plots and tests; no controller may look at it.
"""

from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

from pydrake.common.value import Value
from pydrake.geometry import QueryObject

from systems.common.block import Block
from systems.common.signal import Field, Many

TOOLS = (("obstacle", "obstacle"), ("target", "target"), ("camera", "camera"))
"""Name and role of the tools, in the order of the port."""


class Gap(NamedTuple):
    """From the robot's tool to another one's surface."""

    distance: Annotated[float, Field("m", "negative for a penetration", 0.03, ("",))]


def column(name: str, role: str, tools: Sequence[tuple[str, str]]) -> str:
    """What the log calls a tool: its role, or its name where others share its role."""
    return role if [other for _, other in tools].count(role) == 1 else name


class Clearance(Block):
    """Measures how far the robot's tool is from the others.

    The robot's tool is the whole shaft below the mount, to its tip; the gauze is
    soft and does not count.

    Port ``query_object`` accepts the SceneGraph's query.
    Port ``clearance`` emits the `Gap` of each tool.
    """

    def __init__(
        self,
        robot: Any,
        others: dict[str, Any],
        tools: Sequence[tuple[str, str]] = TOOLS,
    ) -> None:
        """Keeps the geometries to measure.

        Args:
            robot: The robot's shaft (`Instrument.shaft_geometry`).
            others: Shafts by the tools' names (`PosedTools.shafts`).
            tools: Name and role of each.

        Raises:
            ValueError: If one of them is missing.
        """
        super().__init__()
        missing = [name for name, _ in tools if name not in others]
        if robot is None or missing:
            raise ValueError(f"Clearance: no geometry of {missing or 'the robot'}")
        self._robot = robot
        self._others = [others[name] for name, _ in tools]
        self._query = self.DeclareAbstractInputPort(
            "query_object", Value(QueryObject())
        )
        columns = tuple(column(name, role, tools) for name, role in tools)
        self.signal_out(
            "clearance",
            Many(Gap, columns),
            self._calc_clearance,
            {self._query.ticket()},
        )

    def _calc_clearance(self, context: Any) -> list[float]:
        measure = self._query.Eval(context).ComputeSignedDistancePairClosestPoints
        return [measure(self._robot, other).distance for other in self._others]


def add_clearance(
    builder: Any,
    scene_graph: Any,
    robot: Any,
    others: dict[str, Any],
    tools: Sequence[tuple[str, str]] = TOOLS,
) -> Clearance:
    """Adds the block as `clearance` and wires it to the SceneGraph."""
    block = builder.AddNamedSystem("clearance", Clearance(robot, others, tools))
    builder.Connect(
        scene_graph.get_query_output_port(), block.GetInputPort("query_object")
    )
    return block
