"""True clearances of the robot's tool, surface to surface.

For metrics, plots and tests; no controller may look at it.
"""

from typing import Any

from pydrake.common.value import Value
from pydrake.geometry import QueryObject
from pydrake.systems.framework import LeafSystem


class Clearance(LeafSystem):
    """Measures how far the robot's tool is from the other three.

    The robot's tool is the whole shaft below the mount, to its tip; the gauze is
    soft and does not count. Negative values are penetrations.

    Port ``query_object`` accepts the SceneGraph's query.
    Port ``clearance`` emits the distances R to O, R to S and R to C in m (3).
    """

    def __init__(self, robot: Any, others: dict[str, Any]) -> None:
        """Keeps the geometries to measure.

        Args:
            robot: The robot's shaft (`Instrument.shaft_geometry`).
            others: Shafts of "S", "O" and "C" (`PosedTools.shafts`).

        Raises:
            ValueError: If one of them is missing.
        """
        super().__init__()
        missing = [name for name in ("O", "S", "C") if name not in others]
        if robot is None or missing:
            raise ValueError(f"Clearance: no geometry of {missing or 'the robot'}")
        self._robot = robot
        self._others = [others[name] for name in ("O", "S", "C")]
        self._query = self.DeclareAbstractInputPort(
            "query_object", Value(QueryObject())
        )
        self.DeclareVectorOutputPort(
            "clearance", 3, self._calc_clearance, {self._query.ticket()}
        )

    def _calc_clearance(self, context: Any, output: Any) -> None:
        query = self._query.Eval(context)
        output.SetFromVector(
            [
                query.ComputeSignedDistancePairClosestPoints(
                    self._robot, other
                ).distance
                for other in self._others
            ]
        )


def add_clearance(
    builder: Any, scene_graph: Any, robot: Any, others: dict[str, Any]
) -> Clearance:
    """Adds the block as `clearance` and wires it to the SceneGraph."""
    block = builder.AddNamedSystem("clearance", Clearance(robot, others))
    builder.Connect(
        scene_graph.get_query_output_port(), block.GetInputPort("query_object")
    )
    return block
