"""The surgeon's tools S and O and the endoscope C: bodies posed by blocks.

They are in the plant's SceneGraph, so that true clearances are Drake's signed
distances, but they are not part of the plant: a person moves them.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
import math
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import (
    Capsule,
    CollisionFilterDeclaration,
    Cylinder,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    GeometrySet,
    ProximityProperties,
    Shape,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.framework import BasicVector, LeafSystem

from plants.common.lathe import lathe
from plants.common.looks import DARK, GREEN, RED, STEEL, TROCAR, VIEW, illustration

NAMES = ("S", "O", "C")


@dataclass
class PosedToolsParams:
    """Shapes of the posed tools, and where their trocars are drawn.

    Attributes:
        tool_diameter: Of S and O, in m.
        tool_length: Of their shafts, from the tip to the hand, in m.
        endoscope_diameter: In m.
        endoscope_length: In m.
        view_half_angle: Half the endoscope's field of view, in rad; drawn only.
        view_length: Length of the drawn cone, in m.
        fulcrums: Positions in W of the trocars of S, O and C, in m (3 x 3). A
            trocar is drawn on the shaft's point nearest to it.
    """

    tool_diameter: float = 0.005
    tool_length: float = 0.33
    endoscope_diameter: float = 0.010
    endoscope_length: float = 0.31
    view_half_angle: float = 0.61
    view_length: float = 0.11
    fulcrums: list[list[float]] = field(
        default_factory=lambda: [
            [0.09, 0.05, 0.0],
            [0.08, -0.06, 0.0],
            [0.0, 0.09, 0.0],
        ]
    )

    def check(self) -> None:
        """Raises ValueError for a dimension that cannot be."""
        bounds = {
            "tool_diameter": (0.002, 0.015),
            "tool_length": (0.1, 0.6),
            "endoscope_diameter": (0.002, 0.015),
            "endoscope_length": (0.1, 0.6),
            "view_half_angle": (0.1, 1.2),
            "view_length": (0.02, 0.3),
        }
        for name, (low, high) in bounds.items():
            value = getattr(self, name)
            if not low <= value <= high:
                nearest = low if not value > low else high
                raise ValueError(
                    f"posed_tools.{name}={value} must be in [{low}, {high}]; "
                    f"nearest {nearest}"
                )
        if len(self.fulcrums) != 3 or any(
            len(p) != 3 or not all(math.isfinite(x) for x in p) for p in self.fulcrums
        ):
            raise ValueError(
                f"posed_tools.fulcrums={self.fulcrums} must be three points (x, y, z)"
            )


class PosedTools(LeafSystem):
    """Poses the bodies of the tools S, O and C in a SceneGraph.

    Each tool's frame has its origin at the tip and its z axis along the shaft,
    towards the tip; the shaft is a capsule whose surface ends at the tip.

    Ports ``S``, ``O`` and ``C`` accept a shaft each: tip p_WP in m and unit vector
    u_W towards the tip, world frame (6).
    Port ``poses`` emits the frames' poses for the SceneGraph (FramePoseVector).

    Attributes:
        shafts: Proximity geometries of the shafts, by "S", "O", "C".
    """

    def __init__(
        self, scene_graph: Any, params: PosedToolsParams | None = None
    ) -> None:
        """Registers the bodies; the SceneGraph must not be built yet.

        Raises:
            ValueError: If a parameter cannot be.
        """
        super().__init__()
        self.params = params or PosedToolsParams()
        self.params.check()
        self.source_id = scene_graph.RegisterSource("posed_tools")
        self.shafts: dict[str, Any] = {}
        self._ports: list[Any] = []
        self._frames: list[Any] = []
        self._trocars: list[Any] = []
        self._fulcrums = np.array(self.params.fulcrums, float)
        for name, fulcrum in zip(NAMES, self.params.fulcrums, strict=True):
            self._frames.append(self._add_tool(scene_graph, name))
            self._trocars.append(self._add_trocar(scene_graph, name))
            # Hanging straight down, some 100 mm inside.
            example = [fulcrum[0], fulcrum[1], fulcrum[2] - 0.1, 0.0, 0.0, -1.0]
            self._ports.append(self.DeclareVectorInputPort(name, BasicVector(example)))
        self.DeclareAbstractOutputPort(
            "poses",
            lambda: Value(FramePoseVector()),
            self._calc_poses,
            {port.ticket() for port in self._ports},
        )

    def _calc_poses(self, context: Any, output: Any) -> None:
        poses = FramePoseVector()
        for port, frame, trocar, fulcrum in zip(
            self._ports, self._frames, self._trocars, self._fulcrums, strict=True
        ):
            # Arrays: Drake takes over a list several times slower.
            shaft = port.Eval(context)
            p, u = shaft[:3], shaft[3:]
            R = RotationMatrix.MakeFromOneVector(u, 2)
            poses.set_value(frame, RigidTransform(R, p))
            nearest = p + u.dot(fulcrum - p) * u
            poses.set_value(trocar, RigidTransform(R, nearest))
        output.set_value(poses)

    def _add_tool(self, scene_graph: Any, name: str) -> Any:
        """Registers a tool's frame, its shaft and its looks."""
        p = self.params
        scope = name == "C"
        radius = 0.5 * (p.endoscope_diameter if scope else p.tool_diameter)
        length = p.endoscope_length if scope else p.tool_length
        frame = scene_graph.RegisterFrame(self.source_id, GeometryFrame(f"tool_{name}"))

        shape = Capsule(radius, length - 2.0 * radius)
        shaft = GeometryInstance(_along(-0.5 * length), shape, f"shaft_{name}")
        shaft.set_proximity_properties(ProximityProperties())
        self.shafts[name] = scene_graph.RegisterGeometry(self.source_id, frame, shaft)

        looks: Sequence[tuple[str, Shape, float, list[float]]]
        if scope:
            wide = p.view_length * math.tan(p.view_half_angle)
            cone = [(0.0, 0.0), (wide, p.view_length)]
            looks = (
                ("tube", Cylinder(radius, length), -0.5 * length, DARK),
                ("lens", Cylinder(0.8 * radius, 0.001), 0.0, STEEL),
                ("coupler", Cylinder(0.014, 0.03), -length - 0.015, STEEL),
                ("head", Cylinder(0.022, 0.06), -length - 0.06, DARK),
                ("view", lathe(cone, "view"), 0.0, VIEW),
            )
        else:
            rgba = GREEN if name == "S" else RED
            tube = length - 0.012
            looks = (
                ("tube", Cylinder(radius, tube), -0.012 - 0.5 * tube, rgba),
                ("jaw", Capsule(0.6 * radius, 0.010), -0.0065, STEEL),
                ("collar", Cylinder(0.008, 0.02), -length, DARK),
                ("grip", Capsule(0.013, 0.07), -length - 0.055, rgba),
                ("knob", Sphere(0.013), -length - 0.095, DARK),
            )
        self._draw(scene_graph, frame, looks)
        return frame

    def _add_trocar(self, scene_graph: Any, name: str) -> Any:
        """Registers the trocar that a tool goes through."""
        wide = 0.5 * self.params.endoscope_diameter if name == "C" else 0.0025
        frame = scene_graph.RegisterFrame(
            self.source_id, GeometryFrame(f"trocar_{name}")
        )
        looks = (
            ("cannula", Cylinder(wide + 0.0017, 0.056), 0.012, TROCAR),
            ("trocar_collar", Cylinder(wide + 0.006, 0.006), -0.010, TROCAR),
            ("trocar_head", Cylinder(wide + 0.009, 0.022), -0.024, TROCAR),
        )
        self._draw(scene_graph, frame, looks)
        return frame

    def _draw(
        self,
        scene_graph: Any,
        frame: Any,
        looks: Sequence[tuple[str, Shape, float, list[float]]],
    ) -> None:
        for name, shape, z, rgba in looks:
            geometry = illustration(shape, _along(z), name, rgba)
            scene_graph.RegisterGeometry(self.source_id, frame, geometry)


def _along(z: float) -> RigidTransform:
    return RigidTransform([0.0, 0.0, z])


def add_posed_tools(
    builder: Any, scene_graph: Any, plant: Any, params: PosedToolsParams | None = None
) -> PosedTools:
    """Adds the tools as `posed_tools`, wired to the SceneGraph, out of contact.

    Args:
        builder: The diagram's builder.
        scene_graph: The plant's SceneGraph, owned by the builder.
        plant: The finalized plant.
        params: Shapes.
    """
    tools = builder.AddNamedSystem("posed_tools", PosedTools(scene_graph, params))
    builder.Connect(
        tools.GetOutputPort("poses"),
        scene_graph.get_source_pose_port(tools.source_id),
    )
    exclude_from_plant(scene_graph, plant, tools)
    return tools


def exclude_from_plant(scene_graph: Any, plant: Any, tools: PosedTools) -> None:
    """Takes the posed tools out of the plant's contacts, and out of each other's.

    CENIC (Drake 1.58) ends the process when the plant's geometry touches geometry
    that the plant does not own. Signed distances of single pairs ignore the filter
    and still measure.

    Args:
        scene_graph: Owner of both, not yet built.
        plant: A finalized plant.
        tools: The posed tools.
    """
    inspector = scene_graph.model_inspector()
    source = plant.get_source_id()
    own = [
        geometry
        for frame in (*inspector.FramesForSource(source), inspector.world_frame_id())
        for geometry in inspector.GetGeometries(frame)
        if inspector.BelongsToSource(geometry, source)
    ]
    posed = GeometrySet(list(tools.shafts.values()))
    scene_graph.collision_filter_manager().Apply(
        CollisionFilterDeclaration()
        .ExcludeBetween(GeometrySet(own), posed)
        .ExcludeWithin(posed)
    )
