"""What the endoscope saw: a film of a run, rendered after it without a display.

Light comes from the lens; tissue looks wet; the camera stands upright. Drake's VTK
engine needs EGL; where there is none it ends the process, so it is tried in another one
first.
"""

from functools import cache
from importlib.util import find_spec
from pathlib import Path
import subprocess
import sys
from typing import Any

import matplotlib
import numpy as np
from pydrake.geometry import (
    Capsule,
    ClippingRange,
    ColorRenderCamera,
    DepthRange,
    DepthRenderCamera,
    Ellipsoid,
    FramePoseVector,
    GeometryFrame,
    GeometryInstance,
    LightParameter,
    MakeRenderEngineVtk,
    PerceptionProperties,
    RenderCameraCore,
    RenderEngineVtkParams,
    Rgba,
    SceneGraph,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.systems.sensors import CameraInfo

from diagrams.common.scenario import ScenarioError
from diagrams.gauze.gltf import gltf
from diagrams.gauze.tools import TARGET, logged
from plants.common.looks import DARK, GAUZE, GREEN, RED, STEEL, TISSUE
from plants.instruments.instrument import GAUZE_RADIUS
from plants.organs.organs import surface_of
from plants.organs.posed_organs import COLORS
from plants.organs.shapes import shape
from plants.organs.surface import Surface
from systems.common.signal import vector

RATE = 10.0
"""Frames of the film a second."""
STILLS = 6
"""Pictures of the film strip."""
_LENGTH = 0.3
_TRY = "from diagrams.gauze.film import attempt; attempt()"


def engine() -> Any:
    """The renderer, with a lamp at the lens."""
    lamp = LightParameter(
        type="spot",
        frame="camera",
        attenuation_values=np.array([0.4, 0.0, 120.0]),
        intensity=6.0,
        cone_angle=60.0,
        position=np.zeros(3),
        direction=np.array([0.0, 0.0, 1.0]),
    )
    black = np.array([0.05, 0.02, 0.02])
    params = RenderEngineVtkParams(default_clear_color=black, lights=[lamp])
    return MakeRenderEngineVtk(params)


def intrinsics(half_angle: float, width: int, height: int) -> CameraInfo:
    """Of a picture whose height is the whole field of view."""
    return CameraInfo(width=width, height=height, fov_y=2.0 * half_angle)


def attempt() -> None:
    """Renders a picture of nothing: a process without EGL does not survive it."""
    scene_graph = SceneGraph()
    scene_graph.AddRenderer("vtk", engine())
    core = RenderCameraCore(
        "vtk", intrinsics(0.6, 8, 8), ClippingRange(0.01, 1.0), RigidTransform()
    )
    query = scene_graph.get_query_output_port().Eval(scene_graph.CreateDefaultContext())
    world = scene_graph.world_frame_id()
    query.RenderColorImage(ColorRenderCamera(core, False), world, RigidTransform())


@cache
def can_render() -> bool:
    """Whether pictures can be rendered on this machine."""
    tried = subprocess.run(
        [sys.executable, "-c", _TRY],
        capture_output=True,
        check=False,
        timeout=120,
        cwd=Path(__file__).parents[2],
    )
    return tried.returncode == 0


def refuse_without_egl() -> None:
    """Raises ScenarioError where no picture can be rendered, or no film written."""
    if not find_spec("imageio_ffmpeg"):
        raise ScenarioError(
            "no module 'imageio_ffmpeg': --endoscope needs the extra endoscope, "
            "pip install 'trocar[endoscope]'"
        )
    if not can_render():
        raise ScenarioError(
            "--endoscope: this machine has no EGL to render with; on Debian: apt "
            "install libegl1 libegl-mesa0 libgl1-mesa-dri"
        )


def upright(apex: np.ndarray, u: np.ndarray) -> RigidTransform:
    """The camera's pose in W: z along u, and y, down in the picture, as W's is."""
    x = np.cross(-np.array([0.0, 0.0, 1.0]), u)
    if np.linalg.norm(x) < 1e-3:  # straight down: up in the picture is the head
        x = np.array([1.0, 0.0, 0.0])
    x /= np.linalg.norm(x)
    R = RotationMatrix(np.column_stack([x, np.cross(u, x), u]))
    return RigidTransform(R, apex)


class Film:
    """The scene of a run, to take pictures and depths of at any sample of its log."""

    def __init__(self, run: Any, width: int = 480, height: int = 360) -> None:
        """Builds the scene; see `refuse_without_egl` first."""
        self._run = run
        scene = self._scene = SceneGraph()
        scene.AddRenderer("vtk", engine())
        self._source = scene.RegisterSource("film")
        scenario = run.scenario
        self._organs = [
            self._add(
                f"organ_{organ.name}",
                gltf(
                    surface_of(organ, 48),
                    organ.name,
                    vector(COLORS[organ.shape][:3]),
                    seed=organ.seed,
                ),
            )
            for organ in scenario.organs
        ]
        self._add_cavity()
        self._tools = [
            (tool, self._add_tool(tool.name, GREEN if tool.role == TARGET else RED))
            for tool in [scenario.target, *scenario.obstacles]
        ]
        self._robot = self._add_tool("robot", STEEL)
        self._gauze = self._add(
            "gauze", Ellipsoid(GAUZE_RADIUS, GAUZE_RADIUS, GAUZE_RADIUS), GAUZE
        )
        camera = intrinsics(scenario.camera.half_angle, width, height)
        core = RenderCameraCore(
            "vtk", camera, ClippingRange(0.004, 1.0), RigidTransform()
        )
        self._color = ColorRenderCamera(core, False)
        self._depth = DepthRenderCamera(core, DepthRange(0.005, 0.9))
        self._context = scene.CreateDefaultContext()

    def _add(self, name: str, shape_: Any, rgba: Any = None, z: float = 0.0) -> Any:
        frame = self._scene.RegisterFrame(self._source, GeometryFrame(name))
        look = GeometryInstance(RigidTransform([0.0, 0.0, z]), shape_, name)
        properties = PerceptionProperties()
        if rgba is not None:
            properties.AddProperty("phong", "diffuse", Rgba(*rgba))
        look.set_perception_properties(properties)
        self._scene.RegisterGeometry(self._source, frame, look)
        return frame

    def _add_tool(self, name: str, rgba: list[float]) -> list[Any]:
        """A shaft that ends at the tip, and its jaw."""
        tube = Capsule(0.0025, _LENGTH - 0.02)
        jaw = Capsule(0.0016, 0.016)
        return [
            self._add(f"{name}_tube", tube, DARK if name == "robot" else rgba, -0.16),
            self._add(f"{name}_jaw", jaw, STEEL, -0.009),
        ]

    def _add_cavity(self) -> None:
        """The inside of the inflated belly."""
        ball = shape("gallbladder", 0, 24)
        t = ball.points / np.abs(ball.points).max(axis=0)
        inside = Surface(
            t / np.linalg.norm(t, axis=1)[:, None] * [0.19, 0.24, 0.13] - [0, 0, 0.13],
            ball.triangles[:, ::-1].copy(),
        )
        self._cavity = self._add(
            "cavity", gltf(inside, "cavity", vector(TISSUE[:3]), 0.5)
        )

    def _query(self, i: int) -> Any:
        run, poses = self._run, FramePoseVector()
        poses.set_value(self._cavity, RigidTransform())
        for k, frame in enumerate(self._organs):
            moved = run.organs.moved.p[i, k]
            poses.set_value(frame, RigidTransform(moved))
        shafts = [(frames, logged(run, tool).shaft) for tool, frames in self._tools]
        placed = [(frames, shaft.tip[i], shaft.u[i]) for frames, shaft in shafts]
        robot = run.robot.tool
        along = robot.tip[i] - robot.fulcrum[i]
        placed.append((self._robot, robot.tip[i], along / np.linalg.norm(along)))
        for frames, tip, u in placed:
            X = RigidTransform(RotationMatrix.MakeFromOneVector(u, 2), tip)
            for frame in frames:
                poses.set_value(frame, X)
        poses.set_value(self._gauze, RigidTransform(robot.tip[i]))
        self._scene.get_source_pose_port(self._source).FixValue(self._context, poses)
        return self._scene.get_query_output_port().Eval(self._context)

    def _pose(self, i: int) -> RigidTransform:
        cone = logged(self._run, self._run.scenario.camera).view_cone
        return upright(cone.apex[i], cone.u[i])

    def picture(self, i: int) -> np.ndarray:
        """The picture at the i-th sample of the log (height, width, 3), bytes."""
        world = self._scene.world_frame_id()
        image = self._query(i).RenderColorImage(self._color, world, self._pose(i))
        return np.ascontiguousarray(image.data[..., :3])

    def depth(self, i: int) -> np.ndarray:
        """The same in depths along the axis (height, width), m."""
        world = self._scene.world_frame_id()
        image = self._query(i).RenderDepthImage(self._depth, world, self._pose(i))
        return np.array(image.data[..., 0])


def strip(pictures: list[np.ndarray]) -> np.ndarray:
    """Pictures side by side, in two rows."""
    half = (len(pictures) + 1) // 2
    rows = [np.hstack(pictures[:half]), np.hstack(pictures[half:])]
    return np.vstack(rows)


def save_film(run: Any, into: Any) -> None:
    """Writes `endoscope.mp4` and the film strip `endoscope.png` of a run."""
    import imageio_ffmpeg

    film, time = Film(run), run.signals["time"]
    step = max(1, round(1.0 / RATE / (time[1] - time[0])))
    frames = list(range(0, len(time), step))
    stills = np.linspace(0, len(frames) - 1, STILLS).astype(int)
    kept = []
    with into.file("endoscope.mp4") as draft:
        writer = imageio_ffmpeg.write_frames(
            str(draft),
            (480, 360),
            fps=RATE,
            quality=7,
            output_params=["-f", "mp4"],
            macro_block_size=8,
        )
        writer.send(None)
        for number, i in enumerate(frames):
            picture = film.picture(i)
            writer.send(picture)
            if number in stills:
                kept.append(picture)
        writer.close()
    with into.file("endoscope.png") as draft:
        matplotlib.image.imsave(draft, strip(kept), format="png")
