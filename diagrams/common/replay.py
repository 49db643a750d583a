"""Recording a run in Meshcat, and what is drawn on top of the geometry."""

import itertools
import logging
from typing import Any

import numpy as np
from pydrake.geometry import (
    Cylinder,
    Meshcat,
    MeshcatCone,
    MeshcatParams,
    MeshcatVisualizer,
    MeshcatVisualizerParams,
    Rgba,
    Role,
)
from pydrake.math import RigidTransform, RotationMatrix

from diagrams.common.study import Study

QUERY_PORT = "scene_graph.query"
"""The exported port of a study's diagram that Meshcat draws."""


def start_meshcat() -> Any:
    """Starts a Meshcat server, without its log line."""
    logging.getLogger("drake").setLevel(logging.WARNING)
    return Meshcat(MeshcatParams(show_stats_plot=False))


class Recorder:
    """Draws frames of a run into a Meshcat recording; without Meshcat, nothing."""

    def __init__(self, meshcat: Any, visualizer: Any, study: Study) -> None:
        self._meshcat = meshcat
        self._visualizer = visualizer
        self._study = study

    def draw(self, context: Any) -> None:
        """Records the frame of a root context."""
        if self._visualizer is not None:
            self._visualizer.ForcedPublish(
                self._visualizer.GetMyContextFromRoot(context)
            )

    def finish(self, run: Any) -> None:
        """Adds the study's decoration and publishes the recording."""
        if self._meshcat is None:
            return
        self._meshcat.StopRecording()
        if run.metrics:
            animation = self._meshcat.get_mutable_recording()
            self._study.decorate(self._meshcat, animation, run)
        self._meshcat.PublishRecording()


def add_recorder(builder: Any, station: Any, meshcat: Any, study: Study) -> Recorder:
    """Adds the visualizer to a root diagram and starts the recording.

    The visualizer never publishes by itself: the run draws its frames between
    the timed advances.
    """
    if meshcat is None or not station.HasOutputPort(QUERY_PORT):
        return Recorder(meshcat, None, study)
    meshcat.Delete()
    meshcat.DeleteRecording()
    params = MeshcatVisualizerParams(
        role=Role.kIllustration, prefix="scene", publish_period=1e6
    )
    visualizer = MeshcatVisualizer.AddToBuilder(
        builder, station.GetOutputPort(QUERY_PORT), meshcat, params
    )
    visualizer.set_name("replay")
    for path in ("/Grid", "/Axes"):
        meshcat.SetProperty(path, "visible", False)
    meshcat.SetProperty("/Background", "top_color", [0.93, 0.95, 0.97])
    meshcat.SetProperty("/Background", "bottom_color", [0.78, 0.82, 0.86])
    meshcat.SetCameraPose(study.view.camera, study.view.target)
    # Slightly above the frame rate: frames are floor(time * rate), and a time
    # just below its exact value must not fall into the frame before.
    rate = study.frame_rate * (1.0 + 1e-9)
    meshcat.StartRecording(rate, set_visualizations_while_recording=False)
    return Recorder(meshcat, visualizer, study)


def draw_trail(
    meshcat: Any,
    animation: Any,
    path: str,
    times: np.ndarray,
    points: np.ndarray,
    rgba: tuple[float, float, float, float],
    chunks: int = 40,
) -> None:
    """Draws a path that grows with time.

    Recordings hold no new geometry, so the path is laid down in chunks whose
    visibility is animated.

    Args:
        meshcat: The Meshcat that records.
        animation: Its recording.
        path: Meshcat path.
        times: Sample times [s], shape (n,).
        points: Positions in the world frame [m], shape (n, 3).
        rgba: Colour.
        chunks: Number of pieces.
    """
    edges = np.linspace(0, len(times) - 1, min(chunks, len(times) - 1) + 1).astype(int)
    for index, (first, last) in enumerate(itertools.pairwise(edges)):
        piece = f"{path}/{index}"
        step = max(1, (last - first) // 12)
        line = points[first : last + 1 : step]
        if (last - first) % step:
            line = np.vstack([line, points[last]])
        meshcat.SetLine(piece, line.T, 3.0, Rgba(*rgba))
        animation.SetProperty(0, piece, "visible", False)
        animation.SetProperty(animation.frame(times[last]), piece, "visible", True)


def draw_arrow(
    meshcat: Any,
    animation: Any,
    path: str,
    times: np.ndarray,
    origins: np.ndarray,
    vectors: np.ndarray,
    rgba: tuple[float, float, float, float],
    radius: float = 0.0012,
    step: int = 2,
) -> None:
    """Draws a vector that turns and stretches with time.

    Args:
        meshcat: The Meshcat that records.
        animation: Its recording.
        path: Meshcat path.
        times: Sample times [s], shape (n,).
        origins: Foot of the arrow in the world frame [m], shape (n, 3).
        vectors: The arrow itself in the world frame [m], shape (n, 3).
        rgba: Colour.
        radius: Of the shaft [m].
        step: Every how many samples a key frame is set.
    """
    color = Rgba(*rgba)
    # Unit geometry along z from the foot; its z scale is the arrow's length.
    shaft = f"{path}/size/shaft"
    head = f"{path}/size/head"
    meshcat.SetObject(shaft, Cylinder(radius, 0.8), color)
    meshcat.SetTransform(shaft, RigidTransform([0.0, 0.0, 0.4]))
    meshcat.SetObject(head, MeshcatCone(0.25, 2.6 * radius, 2.6 * radius), color)
    tip = RigidTransform(RotationMatrix.MakeXRotation(np.pi), [0.0, 0.0, 1.0])
    meshcat.SetTransform(head, tip)
    for index in range(0, len(times), step):
        length = float(np.linalg.norm(vectors[index]))
        if length > 1e-9:
            R_WA = RotationMatrix.MakeFromOneVector(vectors[index], 2)
        else:
            R_WA = RotationMatrix()
        frame = animation.frame(times[index])
        animation.SetTransform(frame, path, RigidTransform(R_WA, origins[index]))
        scale = [1.0, 1.0, max(length, 1e-6)]
        animation.SetProperty(frame, f"{path}/size", "scale", scale)
