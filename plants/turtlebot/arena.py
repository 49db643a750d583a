"""What is seen of a navigation: floor, goal, robot with its vision circle, discs."""

from collections.abc import Sequence
from math import atan2, cos, hypot, pi, sin
from typing import Any

from pydrake.common.value import Value
from pydrake.geometry import (
    Box,
    Cylinder,
    FramePoseVector,
    GeometryFrame,
    SceneGraph,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix

from plants.common.looks import DARK, GREEN, RED, STEEL, illustration
from plants.crowd.signals import OBSTACLES
from plants.crowd.walls import WallParams, segments
from plants.turtlebot.signals import RobotState
from systems.common.block import Block
from systems.common.signal import view

FLOOR = [0.88, 0.89, 0.87, 1.0]
BODY = [0.12, 0.37, 0.75, 1.0]
WALL = [0.55, 0.52, 0.47, 0.6]
SIGHT = [0.95, 0.75, 0.15, 1.0]
HEIGHT = 0.4
"""Of an obstacle [m]."""


class Arena(Block):
    """Poses a robot and its obstacles in a SceneGraph.

    Port ``robot`` accepts the `RobotState`.
    Port ``obstacles`` accepts rows of `Obstacle`.
    Port ``poses`` emits the frames' poses for the SceneGraph (FramePoseVector).
    """

    def __init__(
        self,
        scene_graph: Any,
        radii: Sequence[float],
        radius: float,
        vision: float,
        goal: Sequence[float],
        floor: Sequence[float],
        walls: Sequence[WallParams] = (),
    ) -> None:
        """Registers the bodies; the SceneGraph must not be built yet.

        Args:
            scene_graph: Where they are drawn.
            radii: Of the obstacles [m].
            radius: Of the robot [m].
            vision: Radius of its sight [m].
            goal: x, y [m].
            floor: Least x, least y, greatest x, greatest y [m].
            walls: What stands.
        """
        super().__init__()
        self._graph = scene_graph
        self.source_id = scene_graph.RegisterSource("arena")
        self._draw_floor(goal, floor)
        self._draw_walls(walls)
        self._robot_frame = self._add_frame("robot")
        self._draw_robot(radius, vision)
        self._frames = []
        for k, r in enumerate(radii):
            frame = self._add_frame(f"obstacle_{k}")
            self._put(frame, Cylinder(r, HEIGHT), (0.0, 0.0, 0.5 * HEIGHT), "disc", RED)
            self._frames.append(frame)
        self._robot = self.signal_in("robot", RobotState)
        self._obstacles = self.signal_in("obstacles", OBSTACLES)
        self.value_out(
            "poses",
            lambda: Value(FramePoseVector()),
            self._calc_poses,
            {self._robot.ticket(), self._obstacles.ticket()},
        )

    def _calc_poses(self, context: Any, output: Any) -> None:
        robot = RobotState(*self._robot.Eval(context).tolist())
        poses = FramePoseVector()
        X_WR = RigidTransform(
            RotationMatrix.MakeZRotation(robot.theta), [robot.x, robot.y, 0.0]
        )
        poses.set_value(self._robot_frame, X_WR)
        obstacles = view(OBSTACLES, self._obstacles.Eval(context))
        for k, frame in enumerate(self._frames):
            p_WO = [obstacles.x[k], obstacles.y[k], 0.0]
            poses.set_value(frame, RigidTransform(p_WO))
        output.set_value(poses)

    def _add_frame(self, name: str) -> Any:
        return self._graph.RegisterFrame(self.source_id, GeometryFrame(name))

    def _put(
        self, frame: Any, shape: Any, place: Any, name: str, rgba: list[float]
    ) -> None:
        geometry = illustration(shape, RigidTransform(list(place)), name, rgba)
        self._graph.RegisterGeometry(self.source_id, frame, geometry)

    def _draw_floor(self, goal: Sequence[float], floor: Sequence[float]) -> None:
        low_x, low_y, high_x, high_y = floor
        goal_x, goal_y = goal
        middle = [0.5 * (low_x + high_x), 0.5 * (low_y + high_y), -0.03]
        slab = Box(high_x - low_x, high_y - low_y, 0.05)
        self._graph.RegisterAnchoredGeometry(
            self.source_id, illustration(slab, RigidTransform(middle), "floor", FLOOR)
        )
        for name, shape, z in (
            ("goal", Cylinder(0.16, 0.02), 0.012),
            ("pole", Cylinder(0.015, 0.6), 0.3),
            ("knob", Sphere(0.06), 0.6),
        ):
            X_WG = RigidTransform([goal_x, goal_y, z])
            self._graph.RegisterAnchoredGeometry(
                self.source_id, illustration(shape, X_WG, name, GREEN)
            )

    def _draw_walls(self, walls: Sequence[WallParams]) -> None:
        for k, (ax, ay, bx, by) in enumerate(segments(walls)):
            length = hypot(bx - ax, by - ay)
            if length > 0.0:
                R_WA = RotationMatrix.MakeZRotation(atan2(by - ay, bx - ax))
                middle = [0.5 * (ax + bx), 0.5 * (ay + by), 0.25]
                shape, pose = Box(length, 0.02, 0.5), RigidTransform(R_WA, middle)
                wall = illustration(shape, pose, f"wall_{k}", WALL)
                self._graph.RegisterAnchoredGeometry(self.source_id, wall)

    def _draw_robot(self, radius: float, vision: float) -> None:
        frame = self._robot_frame
        for k, z in enumerate((0.06, 0.16, 0.26)):
            self._put(frame, Cylinder(radius, 0.02), (0.0, 0.0, z), f"plate_{k}", DARK)
        self._put(frame, Cylinder(0.97 * radius, 0.07), (0.0, 0.0, 0.04), "base", BODY)
        post = Cylinder(0.012, 0.22)
        for k in range(4):
            angle = pi * (0.25 + 0.5 * k)
            place = (0.8 * radius * cos(angle), 0.8 * radius * sin(angle), 0.16)
            self._put(frame, post, place, f"post_{k}", STEEL)
        nose = (0.8 * radius, 0.0, 0.285)
        self._put(frame, Box(0.4 * radius, 0.05, 0.03), nose, "nose", SIGHT)
        # The vision circle: a ring of short bars.
        count = 90
        bar = Box(0.03, 2.0 * pi * vision / count * 0.6, 0.01)
        for k in range(count):
            angle = 2.0 * pi * k / count
            X_RB = RigidTransform(
                RotationMatrix.MakeZRotation(angle),
                [vision * cos(angle), vision * sin(angle), 0.01],
            )
            ring = illustration(bar, X_RB, f"sight_{k}", SIGHT)
            self._graph.RegisterGeometry(self.source_id, frame, ring)


def add_arena(builder: Any, **settings: Any) -> tuple[Any, Any]:
    """Adds a SceneGraph and an `Arena`, named "scene_graph" and "arena".

    Args:
        builder: The diagram's builder.
        settings: Arguments of `Arena` but the SceneGraph.
    """
    scene_graph = builder.AddNamedSystem("scene_graph", SceneGraph())
    arena = builder.AddNamedSystem("arena", Arena(scene_graph, **settings))
    builder.Connect(
        arena.GetOutputPort("poses"),
        scene_graph.get_source_pose_port(arena.source_id),
    )
    return scene_graph, arena
