"""A robot's senses in the benchmark's loop: lidar, odometry, grid and tracks."""

from dataclasses import dataclass, field, replace
from math import hypot

import numpy as np

from plants.crowd.signals import CAPACITY, Obstacle
from plants.crowd.walls import segments
from plants.turtlebot.lidar import RAYS, LidarParams, scan_of
from plants.turtlebot.lidar import constants as lidar_constants
from plants.turtlebot.odometry import Odometer, OdometryNoise, OdometryParams, reckon
from plants.turtlebot.signals import RobotState
from systems.common.compiled import packed
from systems.common.signal import size
from systems.perception.grid_mapping import (
    SCAN_PERIOD,
    GridMappingParams,
    constants,
    mapped,
    place_now,
)
from systems.perception.place import Belief
from systems.perception.signals import GRID
from systems.perception.tracking import (
    TrackingParams,
    corners,
    sight,
    tracked,
    walking,
)
from systems.perception.tracking import constants as tracking_constants
from systems.perception.tracks import TRACK_SIZE
from systems.switching.signals import Corner, Seen
from tests.benchmarks.navigation_scenes import Frame, Scene

Pose = tuple[float, float, float]
"""x, y [m] and heading [rad]."""


@dataclass
class Senses:
    """What a robot of a scene is given for senses."""

    lidar: LidarParams = field(default_factory=LidarParams)
    odometry: OdometryParams = field(default_factory=OdometryParams)
    tracking: TrackingParams = field(default_factory=TrackingParams)


LEGS = (
    LidarParams(legs=True),
    OdometryParams(),
    TrackingParams(person=0.3),
)
"""The same where obstacles are people."""


class Sensed:
    """A robot's perception in one scene; it never sees its true pose."""

    def __init__(self, scene: Scene, senses: Senses, seed: int) -> None:
        self.rng = np.random.default_rng(seed)
        (x, y), (gx, gy) = scene.start, scene.goal
        mapping = GridMappingParams(x=0.5 * (x + gx), y=0.5 * (y + gy))
        vision = min(scene.robot.vision, 6.0)
        tracking = replace(senses.tracking, vision=vision)
        self.k_lidar = lidar_constants(senses.lidar, segments(scene.walls))
        self.k_odometry = packed(senses.odometry)
        self.k_mapping = constants(mapping)
        self.k_tracking = tracking_constants(tracking, mapping)
        self.odometer = Odometer(*[0.0] * 9)
        self.belief = np.zeros(size(Belief))
        self.grid = np.zeros(size(GRID))
        self.tracks = np.zeros(CAPACITY * TRACK_SIZE)
        self.stamp = np.zeros(2)
        self.last = 0.0

    def at(
        self, pose: Pose, velocity: tuple[float, float], frame: Frame, time: float
    ) -> tuple[Pose, list[Seen], list[Corner]]:
        """Where the robot believes to be at a time, what it sees and what it does not.

        Between two calls scans are taken at least `SCAN_PERIOD` apart, and everybody
        goes straight.

        Args:
            pose: The true one.
            velocity: Since the call before [m/s].
            frame: The obstacles, now.
            time: Now [s].
        """
        span = time - self.last
        parts = max(1, round(span / SCAN_PERIOD))
        for n in range(1, parts + 1):
            back = (parts - n) * span / parts
            x, y, theta = pose
            u, v = velocity
            then = (x - back * u, y - back * v, theta)
            self._reckon(RobotState(*then, hypot(u, v), 0.0))
            if time - back - self.stamp[0] > SCAN_PERIOD - 1e-6 or time == 0.0:
                moved = [(a - back * c, b - back * d, r, c, d)
                         for a, b, r, c, d in frame]  # fmt: skip
                self._look(RobotState(*then, 0.0, 0.0), moved, time - back)
        self.last = time
        place = place_now(self.belief, self.reckoned)
        dt = time - self.stamp[0]
        rows = sight(self.k_tracking, self.tracks, dt, place, self.grid)
        rows = rows.reshape(-1, size(Seen))
        seen = [Seen(*row) for row in rows[rows[:, 0] >= 0.0].tolist()]
        edges = corners(self.k_tracking, place, self.grid, self.scan)
        edges = edges.reshape(-1, size(Corner))
        hiding = [Corner(*row) for row in edges[edges[:, 0] > 0.0].tolist()]
        return tuple(place[:3].tolist()), seen, hiding

    def _reckon(self, robot: RobotState) -> None:
        noise = OdometryNoise(*self.rng.standard_normal(4).tolist())
        self.odometer, told = reckon(self.k_odometry[0], self.odometer, robot, noise)
        self.reckoned = np.array(told)

    def _look(self, robot: RobotState, frame: Frame, time: float) -> None:
        rows = np.reshape(np.array(frame, float), (-1, size(Obstacle)))
        noise = self.rng.standard_normal((RAYS, 2))
        (scan,) = scan_of(self.k_lidar[0], robot, rows, noise)
        self.scan = scan = scan.ravel()
        place = place_now(self.belief, self.reckoned)
        dt = time - self.stamp[0]
        moving = walking(self.k_tracking, self.tracks, dt)
        tracks = tracked(
            self.k_tracking, self.tracks, self.stamp, time, place, self.grid, scan
        )
        self.belief, self.grid = mapped(
            self.k_mapping, self.belief, self.grid, self.reckoned, scan, moving
        )
        self.tracks, self.stamp = tracks
