"""Tracking: the circles of scan after scan as things that have a velocity.

Each is a track (`tracks`). It is born by three scans, lives on while it is hidden, and
dies where rays pass through it. What moves is told as discs, what stands as the grid's
points: nothing is told twice, and what the robot has seen to stand it does not forget.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, hypot, inf, isfinite, sin
from typing import Any

import numpy as np

from plants.crowd.signals import CAPACITY
from plants.turtlebot.lidar import RAYS, SCAN, ray
from plants.turtlebot.signals import RobotState
from systems.common.block import Block
from systems.common.compiled import compiled, packed
from systems.common.parameter import Rules, check, parameter
from systems.common.signal import reader, row_writer, size
from systems.perception.clusters import clusters
from systems.perception.grid import standing, stands, walks
from systems.perception.grid_mapping import SCAN_PERIOD, GridMappingParams
from systems.perception.grid_mapping import constants as grid_constants
from systems.perception.signals import GRID, MOVING
from systems.perception.tracks import (
    TRACK_SIZE,
    corrected,
    costs,
    evident,
    matched,
    predicted,
    read_track,
)
from systems.switching.signals import CORNERS, EDGES, SEEN, Corner, Seen

read_robot, write_seen = reader(RobotState), row_writer(Seen)
write_corner = row_writer(Corner)
SEEN_SIZE, CORNER_SIZE = size(Seen), size(Corner)
NOBODY = -1.0


@dataclass
class TrackingParams:
    """Parameters of clusters and tracks."""

    vision: float = parameter(
        3.0, "radius R_v within which the planner is told", "m", above=0.0, most=100.0
    )
    farthest: float = parameter(12.0, "of what is tracked", "m", above=0.0, most=100.0)
    jump: float = parameter(
        0.12, "of ranges between two things", "m", above=0.0, most=2.0
    )
    largest: float = parameter(0.6, "radius of what may move", "m", above=0.0, most=5.0)
    person: float = parameter(
        0.0,
        "radius that whoever is seen by the legs is given; 0 if there are no people",
        "m",
        least=0.0,
        most=1.0,
    )
    leg: float = parameter(
        0.13, "greatest radius of a leg, as seen", "m", above=0.0, most=0.5
    )
    apart: float = parameter(
        0.6, "greatest distance of a person's legs", "m", above=0.0, most=2.0
    )
    beside: float = parameter(
        0.2, "greatest distance of a leg from the middle", "m", above=0.0, most=1.0
    )
    noise: float = parameter(
        0.02, "standard deviation of a circle's place", "m", above=0.0, most=0.5
    )
    hidden_noise: float = parameter(
        0.1, "of one of which a part is hidden", "m", above=0.0, most=1.0
    )
    agility: float = parameter(
        2.0, "of their accelerations, standard deviation", "m/s^2", above=0.0, most=20.0
    )
    gate: float = parameter(
        4.0, "of a match, in standard deviations", above=0.0, most=20.0
    )
    leap: float = parameter(
        0.4, "of nothing in a scan, whatever the gate says", "m", above=0.0, most=5.0
    )
    memory: float = parameter(
        1.5, "how long what is hidden is believed in", "s", least=0.0, most=60.0
    )
    starts: float = parameter(
        0.15, "speed from which something moves", "m/s", above=0.0, most=2.0
    )
    strays: float = parameter(
        0.2, "so far from where it stood it moves, if slowly", "m", above=0.0, most=2.0
    )
    stops: float = parameter(
        0.04, "speed below which it stands again", "m/s", above=0.0, most=2.0
    )
    hides: float = parameter(
        0.6, "depth behind an edge in which somebody may be", "m", above=0.0, most=5.0
    )
    point: float = parameter(
        0.02, "radius of a point of what stands", "m", above=0.0, most=0.5
    )

    def rules(self) -> Rules:
        """Who moves is not at once said to stand."""
        yield self.stops < self.starts, "stops", f"< starts={self.starts}"


@compiled
def told(
    params: Any, tracks: np.ndarray, dt: float, place: RobotState, within: float
) -> np.ndarray:
    """People and what moves, a time after the scan, within a distance: as `Seen`."""
    rows = np.zeros((len(tracks), SEEN_SIZE))
    rows[:, 0] = NOBODY
    for i in range(len(tracks)):
        t = read_track(tracks[i])
        w = 1.0 if t.moves > 0.0 or t.hits < 4.0 else 0.0
        v_x, v_y = w * t.v_x, w * t.v_y
        x, y = t.x + dt * v_x, t.y + dt * v_y
        person = t.legs > 0.5 and t.hits >= 2.0  # who stands is wider than his legs
        near = hypot(x - place.x, y - place.y) <= within
        if near and t.number > 0.0 and (t.moves > 0.0 or person):
            write_seen(rows, i, Seen(t.number, x, y, t.radius, v_x, v_y))
    return rows


@compiled
def walking(params: np.ndarray, tracks: np.ndarray, dt: float) -> np.ndarray:
    """People and all that moves, as the port `moving` has it."""
    nowhere = RobotState(0.0, 0.0, 0.0, 0.0, 0.0)
    table = tracks.reshape((CAPACITY, TRACK_SIZE))
    return told(params[0], table, dt, nowhere, inf).ravel()


@compiled
def sight(
    params: np.ndarray,
    tracks: np.ndarray,
    dt: float,
    place: np.ndarray,
    grid: np.ndarray,
) -> np.ndarray:
    """All that the planner is told, as the port `seen` has it."""
    robot = read_robot(place)
    rows = grid.reshape((len(grid) // 3, 3))
    table = tracks.reshape((CAPACITY, TRACK_SIZE))
    vision = params[0].vision
    moving = told(params[0], table, dt, robot, vision)
    points = standing(params[0], rows, robot, vision)
    people = moving[moving[:, 0] >= 0.0]
    for n in range(len(points)):  # where somebody is nothing stands
        if points[n, 0] >= 0.0 and walks(people, points[n, 1], points[n, 2], 0.0):
            points[n, 0] = NOBODY
    return np.concatenate((moving, points)).ravel()


@compiled
def observed(
    params: np.ndarray,
    tracks: np.ndarray,
    dt: float,
    place: np.ndarray,
    grid: np.ndarray,
    scan: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, bool]:
    """Tracks as predicted, clusters of a scan, and what each match would cost.

    Also the matches that are `evident`, and whether there are others.
    """
    robot = read_robot(place)
    rows, rays = grid.reshape((len(grid) // 3, 3)), scan.reshape((len(scan), 1))
    table = predicted(params[0], tracks.reshape((CAPACITY, TRACK_SIZE)), dt)
    found = clusters(params[0], rows, robot, rays)
    prices = costs(params[0], table, found, robot)
    mates, chosen = evident(prices)
    return table, found, prices, mates, chosen


@compiled
def updated(
    params: np.ndarray,
    tracks: np.ndarray,
    found: np.ndarray,
    mates: np.ndarray,
    place: np.ndarray,
    scan: np.ndarray,
    last: float,
) -> tuple[np.ndarray, float]:
    """As `corrected`, of arrays as ports have them."""
    rays = scan.reshape((len(scan), 1))
    robot = read_robot(place)
    return corrected(params[0], tracks, found, mates, robot, rays, last)


def tracked(
    params: np.ndarray,
    tracks: np.ndarray,
    stamp: np.ndarray,
    time: float,
    place: np.ndarray,
    grid: np.ndarray,
    scan: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Tracks and stamp after another scan; all as ports and context have them."""
    if not isfinite(place.sum() + scan.sum()):
        return tracks, stamp
    then, last = stamp.tolist()
    dt = time - then
    table, found, prices, mates, chosen = observed(
        params, tracks, dt, place, grid, scan
    )
    mates = matched(prices) if chosen else mates
    table, last = updated(params, table, found, mates, place, scan, last)
    return table.ravel(), np.array([time, last])


def constants(params: TrackingParams, mapping: GridMappingParams) -> np.ndarray:
    """The parameters as the compiled functions take them."""
    of_grid = grid_constants(mapping)[0]
    names = ("left", "bottom", "cell")
    where = {name: float(of_grid[name]) for name in names}
    return packed(params, period=SCAN_PERIOD, **where)


@compiled
def corners(
    params: np.ndarray, place: np.ndarray, grid: np.ndarray, scan: np.ndarray
) -> np.ndarray:
    """Edges of what stands, behind which somebody may be; as the port has them."""
    p, robot = params[0], read_robot(place)
    rows, rays = grid.reshape((len(grid) // 3, 3)), scan.reshape((len(scan), 1))
    found = np.zeros((EDGES, CORNER_SIZE))
    ahead, across, count = cos(robot.theta), sin(robot.theta), 0
    for k in range(RAYS):
        r = rays[k, 0]
        if r == 0.0 or r > p.vision:
            continue
        for side in (-1, 1):
            open_ = True
            for n in range(1, 4):  # a single ray may be a dropout
                s = rays[(k + side * n) % RAYS, 0]
                if 0.0 < s <= r + p.hides:
                    open_ = False
                    break
            if open_ and count < EDGES:
                ex, ey = ray(ahead, across, k)
                x, y = robot.x + r * ex, robot.y + r * ey
                if stands(p, rows, x, y) > 0.0:
                    write_corner(found, count, Corner(1.0, x, y))
                    count += 1
    return found.ravel()


class Tracking(Block):
    """Tells what moves by its tracks, and what stands by the grid.

    Input that is not finite leaves the tracks as they are.

    Port ``place`` accepts the `RobotState` that the robot believes in.
    Port ``scan`` accepts rows of `Ray`.
    Port ``grid`` accepts rows of `Cell`.
    Port ``moving`` emits rows of `Seen`, all that moves.
    Port ``seen`` emits rows of `Seen`: what moves and what stands, within sight.
    Port ``corners`` emits rows of `Corner`: behind which somebody may be, of the last
    scan.
    """

    def __init__(
        self,
        params: TrackingParams | None = None,
        mapping: GridMappingParams | None = None,
    ) -> None:
        """Makes the block.

        Args:
            params: Parameters.
            mapping: Those of the grid.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        params = params or TrackingParams()
        check(params)
        self._constants = constants(params, mapping or GridMappingParams())
        self._place = self.signal_in("place", RobotState)
        self._scan = self.signal_in("scan", SCAN)
        self._grid = self.signal_in("grid", GRID)
        self._tracks = self.DeclareDiscreteState(np.zeros(CAPACITY * TRACK_SIZE))
        self._stamp = self.DeclareDiscreteState([0.0, 0.0])
        now = {self.xd_ticket(), self.time_ticket()}
        self.signal_out("moving", MOVING, self._calc_moving, now)
        inputs = {self._place.ticket(), self._grid.ticket()}
        self.signal_out("seen", SEEN, self._calc_seen, now | inputs)
        self.state_out("corners", CORNERS, np.zeros(size(CORNERS)))
        self.update_every(SCAN_PERIOD, self._update)

    def _state(self, context: Any, group: int) -> np.ndarray:
        state: np.ndarray = context.get_discrete_state(group).value()
        return state

    def _now(self, context: Any) -> tuple[np.ndarray, float]:
        """The tracks, and how long ago they were made."""
        then = float(self._state(context, self._stamp)[0])
        return self._state(context, self._tracks), context.get_time() - then

    def _calc_moving(self, context: Any) -> np.ndarray:
        return walking(self._constants, *self._now(context))

    def _calc_seen(self, context: Any) -> np.ndarray:
        place, grid = self._place.Eval(context), self._grid.Eval(context)
        return sight(self._constants, *self._now(context), place, grid)

    def _update(self, context: Any) -> Sequence[Any]:
        place, grid = self._place.Eval(context), self._grid.Eval(context)
        scan = self._scan.Eval(context)
        tracks, stamp = tracked(
            self._constants,
            self._state(context, self._tracks),
            self._state(context, self._stamp),
            context.get_time(),
            place,
            grid,
            scan,
        )
        return tracks, stamp, corners(self._constants, place, grid, scan)
