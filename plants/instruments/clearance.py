"""True clearances of the robot's tool, surface to surface.

For metrics, plots and tests; no controller may look at it. All shafts are capsules,
so the distance of two segments says it, exactly and without moving the SceneGraph's
bodies; its signed distance, good to 20 um, is the test's oracle.
"""

from collections.abc import Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform

from systems.common.block import Block
from systems.common.compiled import compiled
from systems.common.geometry import along, closest_points, xyz
from systems.common.signal import Field, Many
from systems.common.signals import Shaft

TOOLS = (("obstacle", "obstacle"), ("target", "target"), ("camera", "camera"))
"""Name and role of the tools, in the order of the port."""


class Gap(NamedTuple):
    """From the robot's tool to another one's surface."""

    distance: Annotated[float, Field("m", "negative for a penetration", 0.03, ("",))]


def column(name: str, role: str, tools: Sequence[tuple[str, str]]) -> str:
    """What the log calls a tool: its role, or its name where others share its role."""
    return role if [other for _, other in tools].count(role) == 1 else name


class Capsule(NamedTuple):
    """A shaft in the frame that it is fixed to."""

    frame: Any
    """Index of a body of the plant, or identifier of a SceneGraph's frame."""
    ends: np.ndarray
    """Of its axis, rows, in m."""
    radius: float


def capsule_of(inspector: Any, geometry: Any, frame: Any) -> Capsule:
    """A capsule that is registered in a SceneGraph."""
    shape, X = inspector.GetShape(geometry), inspector.GetPoseInFrame(geometry)
    half = 0.5 * shape.length()
    ends = [X.multiply(np.array([0.0, 0.0, z])) for z in (-half, half)]
    return Capsule(frame, np.array(ends), shape.radius())


@compiled
def gap(
    ends: np.ndarray, radius: float, shaft: np.ndarray, along_shaft: np.ndarray
) -> float:
    """From the robot's surface to another shaft's, in m.

    Args:
        ends: Of the robot's axis in W, columns, in m.
        radius: Of both together, in m.
        shaft: The other one's tip in m and direction, as `Shaft` has them.
        along_shaft: Where its axis begins and ends from the tip, in m.
    """
    tip, u = xyz(shaft, 0), xyz(shaft, 3)
    a, b = along(tip, along_shaft[0], u), along(tip, along_shaft[1], u)
    return (
        closest_points(xyz(ends[:, 0], 0), xyz(ends[:, 1], 0), a, b).distance - radius
    )


class Clearance(Block):
    """Measures how far the robot's tool is from the others.

    The robot's tool is the whole shaft below the mount, to its tip; the gauze is
    soft and does not count.

    Port ``body_poses`` accepts the plant's `body_poses`.
    Ports ``obstacle``, ``target`` and ``camera``, or of whatever names the tools have,
    accept a `Shaft` each.
    Port ``clearance`` emits the `Gap` of each tool.
    """

    def __init__(
        self,
        robot: Capsule,
        others: dict[str, Capsule],
        tools: Sequence[tuple[str, str]] = TOOLS,
    ) -> None:
        """Keeps the shafts to measure.

        Args:
            robot: The robot's shaft, on a body of the plant.
            others: Shafts by the tools' names, on frames of the SceneGraph.
            tools: Name and role of each.

        Raises:
            ValueError: If one of them is missing.
        """
        super().__init__()
        missing = [name for name, _ in tools if name not in others]
        if missing:
            raise ValueError(f"Clearance: no geometry of {missing}")
        self._robot = robot
        self._radii = [robot.radius + others[name].radius for name, _ in tools]
        # A tool's frame has its origin at the tip, and z along the shaft.
        self._along = [np.ascontiguousarray(others[n].ends[:, 2]) for n, _ in tools]
        self._bodies = self.DeclareAbstractInputPort(
            "body_poses", Value([RigidTransform()])
        )
        self._shafts = [self.signal_in(name, Shaft) for name, _ in tools]
        columns = tuple(column(name, role, tools) for name, role in tools)
        self.signal_out(
            "clearance",
            Many(Gap, columns),
            self._calc_clearance,
            {self._bodies.ticket(), *(port.ticket() for port in self._shafts)},
        )

    def _calc_clearance(self, context: Any) -> list[float]:
        X_WB = self._bodies.Eval(context)[self._robot.frame]
        mine = X_WB.multiply(self._robot.ends.T)
        return [
            gap(mine, radius, port.Eval(context), along_shaft)
            for port, radius, along_shaft in zip(
                self._shafts, self._radii, self._along, strict=True
            )
        ]


def add_clearance(
    builder: Any,
    plant: Any,
    scene_graph: Any,
    robot: Any,
    posed: Any,
    tools: Sequence[tuple[str, str]] = TOOLS,
) -> Clearance:
    """Adds the block as `clearance`, wired to the plant but not to the tools' shafts.

    Args:
        builder: The diagram's builder.
        plant: Which the robot's shaft is of.
        scene_graph: Where the shafts are registered.
        robot: The robot's shaft (`Instrument.shaft_geometry`).
        posed: The posed tools.
        tools: Name and role of each.

    Raises:
        ValueError: If a shaft is missing.
    """
    if robot is None:
        raise ValueError("Clearance: no geometry of the robot")
    inspector = scene_graph.model_inspector()
    body = plant.GetBodyFromFrameId(inspector.GetFrameId(robot))
    others = {
        name: capsule_of(inspector, geometry, inspector.GetFrameId(geometry))
        for name, geometry in posed.shafts.items()
    }
    mine = capsule_of(inspector, robot, int(body.index()))
    block = builder.AddNamedSystem("clearance", Clearance(mine, others, tools))
    builder.Connect(plant.GetOutputPort("body_poses"), block.GetInputPort("body_poses"))
    return block
