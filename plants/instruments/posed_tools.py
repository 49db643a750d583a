"""The surgeon's tools and the endoscope: bodies posed by blocks.

They are in the plant's SceneGraph, so that true clearances are Drake's signed
distances, but they are not part of the plant: a person moves them.
"""

from collections.abc import Sequence
from dataclasses import dataclass
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

from plants.common.lathe import lathe
from plants.common.looks import DARK, GREEN, RED, STEEL, TROCAR, VIEW, illustration
from systems.common.block import Block
from systems.common.parameter import ParameterError, check, parameter
from systems.common.signal import view
from systems.common.signals import Shaft

TOOLS = (("target", "target"), ("obstacle", "obstacle"), ("camera", "camera"))
"""Name and role of each tool."""


@dataclass
class PosedToolsParams:
    """Shapes of the posed tools, and where their trocars are drawn."""

    tool_diameter: float = parameter(
        0.005, "of all but the camera", "m", least=0.002, most=0.015
    )
    tool_length: float = parameter(
        0.33, "of a shaft from the tip to the hand", "m", least=0.1, most=0.6
    )
    endoscope_diameter: float = parameter(
        0.010, "of the camera", "m", least=0.002, most=0.015
    )
    endoscope_length: float = parameter(
        0.31, "of the camera's shaft", "m", least=0.1, most=0.6
    )
    view_half_angle: float = parameter(
        0.61, "half the drawn field of view", "rad", least=0.1, most=1.5
    )
    view_length: float = parameter(0.11, "of the drawn cone", "m", least=0.02, most=0.3)
    # A trocar is drawn on the shaft's point nearest to it.
    fulcrums: list[list[float]] = parameter(
        [[0.09, 0.05, 0.0], [0.08, -0.06, 0.0], [0.0, 0.09, 0.0]],
        "of the tools in their order, in W",
        "m",
        least=-1,
        most=1,
        shape=(-1, 3),
    )


class PosedTools(Block):
    """Poses the bodies of the surgeon's tools and of the camera in a SceneGraph.

    Each tool's frame has its origin at the tip and its z axis along the shaft,
    towards the tip; the shaft is a capsule whose surface ends at the tip.

    Ports ``target``, ``obstacle`` and ``camera``, or of whatever names the tools have,
    accept a `Shaft` each.
    Port ``poses`` emits the frames' poses for the SceneGraph (FramePoseVector).

    Attributes:
        shafts: Proximity geometries of the shafts, by the tools' names.
    """

    def __init__(
        self,
        scene_graph: Any,
        params: PosedToolsParams | None = None,
        tools: Sequence[tuple[str, str]] = TOOLS,
    ) -> None:
        """Registers the bodies; the SceneGraph must not be built yet.

        Args:
            scene_graph: Owner of the bodies.
            params: Shapes.
            tools: Name and role of each: target, obstacle, or camera.

        Raises:
            ParameterError: If a parameter cannot be.
        """
        super().__init__()
        self.params = params or PosedToolsParams()
        check(self.params)
        if len(self.params.fulcrums) != len(tools):
            raise ParameterError(
                f"posed_tools.fulcrums={self.params.fulcrums} m: expected {len(tools)} "
                f"x 3 numbers, one fulcrum for each of "
                f"{', '.join(name for name, _ in tools)}"
            )
        self.source_id = scene_graph.RegisterSource("posed_tools")
        self.shafts: dict[str, Any] = {}
        self._ports: list[Any] = []
        self._frames: list[Any] = []
        self._trocars: list[Any] = []
        self._fulcrums = np.array(self.params.fulcrums, float)
        for name, role in tools:
            self._frames.append(self._add_tool(scene_graph, name, role))
            self._trocars.append(self._add_trocar(scene_graph, name, role))
            self._ports.append(self.signal_in(name, Shaft))
        self.value_out(
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
            p, u = view(Shaft, port.Eval(context))
            R = RotationMatrix.MakeFromOneVector(u, 2)
            poses.set_value(frame, RigidTransform(R, p))
            nearest = p + u.dot(fulcrum - p) * u
            poses.set_value(trocar, RigidTransform(R, nearest))
        output.set_value(poses)

    def _add_tool(self, scene_graph: Any, name: str, role: str) -> Any:
        """Registers a tool's frame, its shaft and its looks."""
        p = self.params
        scope = role == "camera"
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
            rgba = GREEN if role == "target" else RED
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

    def _add_trocar(self, scene_graph: Any, name: str, role: str) -> Any:
        """Registers the trocar that a tool goes through."""
        scope = role == "camera"
        wide = 0.5 * self.params.endoscope_diameter if scope else 0.0025
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
    builder: Any,
    scene_graph: Any,
    plant: Any,
    params: PosedToolsParams | None = None,
    tools: Sequence[tuple[str, str]] = TOOLS,
) -> PosedTools:
    """Adds the tools as `posed_tools`, wired to the SceneGraph, out of contact.

    Args:
        builder: The diagram's builder.
        scene_graph: The plant's SceneGraph, owned by the builder.
        plant: The finalized plant.
        params: Shapes.
        tools: Name and role of each.
    """
    posed = builder.AddNamedSystem(
        "posed_tools", PosedTools(scene_graph, params, tools)
    )
    builder.Connect(
        posed.GetOutputPort("poses"),
        scene_graph.get_source_pose_port(posed.source_id),
    )
    exclude_from_plant(scene_graph, plant, posed)
    return posed


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
