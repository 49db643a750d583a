"""Recording a run in Meshcat, and what is drawn on top of the geometry."""

import itertools
import logging
import math
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

from diagrams.common.study import Study, View

QUERY_PORT = "scene_graph.query"
"""The exported port of a study's diagram that Meshcat draws."""


FAR = "far"
"""Path of what a close-up does not show."""

MOST_FRAMES = 4000
"""Of a replay: a longer one has fewer a second. A frame has about 2.3 kB."""


def start_meshcat(host: str = "localhost") -> Any:
    """Starts a Meshcat server, without its log line.

    Args:
        host: Where it listens: on this machine alone; "*" for all that reach it.
    """
    logging.getLogger("drake").setLevel(logging.WARNING)
    return Meshcat(MeshcatParams(host=host, show_stats_plot=False))


def thinned(count: int) -> int:
    """Of so many frames, every which is drawn."""
    return math.ceil(count / MOST_FRAMES)


class Recorder:
    """Draws frames of a run into a Meshcat recording; without Meshcat, nothing."""

    def __init__(
        self, meshcat: Any, visualizer: Any, study: Study, speed: float = 1.0
    ) -> None:
        self._meshcat = meshcat
        self._visualizer = visualizer
        self._study = study
        self._speed = speed

    def draw(self, context: Any) -> None:
        """Records the frame of a root context."""
        if self._visualizer is None:
            return
        time = context.get_time()
        if self._speed > 1.0:  # the visualizer takes its frame from the time
            context.SetTime(time / self._speed)
        self._visualizer.ForcedPublish(self._visualizer.GetMyContextFromRoot(context))
        if self._speed > 1.0:
            context.SetTime(time)

    def finish(self, run: Any) -> None:
        """Adds the study's decoration and publishes the recording."""
        if self._meshcat is None:
            return
        self._meshcat.StopRecording()
        try:
            if run.metrics:
                animation = self._meshcat.get_mutable_recording()
                self._study.decorate(self._meshcat, animation, run)
        finally:
            self._meshcat.PublishRecording()


def add_recorder(
    builder: Any, station: Any, meshcat: Any, study: Study, speed: float = 1.0
) -> Recorder:
    """Adds the visualizer to a root diagram and starts the recording.

    At a speed above one the replay shows the run so much faster.

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
    dress(meshcat, study.view)
    # Slightly above the frame rate: frames are floor(time * rate), and a time
    # just below its exact value must not fall into the frame before.
    rate = study.frame_rate * (1.0 + 1e-9)
    meshcat.StartRecording(rate, set_visualizations_while_recording=False)
    return Recorder(meshcat, visualizer, study, speed)


def dress(meshcat: Any, view: View) -> None:
    """Background and camera of all that is shown."""
    for path in ("/Grid", "/Axes"):
        meshcat.SetProperty(path, "visible", False)
    meshcat.SetProperty("/Background", "top_color", [0.93, 0.95, 0.97])
    meshcat.SetProperty("/Background", "bottom_color", [0.78, 0.82, 0.86])
    meshcat.SetCameraPose(view.camera, view.target)


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
    for index in range(0, len(times), step * thinned(len(times) // step)):
        length = float(np.linalg.norm(vectors[index]))
        if length > 1e-9:
            R_WA = RotationMatrix.MakeFromOneVector(vectors[index], 2)
        else:
            R_WA = RotationMatrix()
        frame = animation.frame(times[index])
        animation.SetTransform(frame, path, RigidTransform(R_WA, origins[index]))
        scale = [1.0, 1.0, max(length, 1e-6)]
        animation.SetProperty(frame, f"{path}/size", "scale", scale)
