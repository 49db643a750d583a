"""What is seen of a world by lidar: circles, tracks, a grid, and the own place."""

from math import asin, cos, hypot, sin

import numpy as np
import pytest

from plants.crowd.walls import WallParams, segments
from plants.turtlebot.lidar import RAYS, LidarParams, scan_of
from plants.turtlebot.lidar import constants as lidar_constants
from plants.turtlebot.signals import RobotState
from systems.common.signal import size, view
from systems.perception import grid_mapping, tracking, tracks
from systems.perception.clusters import BETWEEN, LEG, Cluster, people, seen_as
from systems.perception.clusters import SEEN as WHOLE
from systems.perception.grid import OCCUPIED
from systems.perception.grid_mapping import GridMappingParams
from systems.perception.place import Belief
from systems.perception.signals import CELLS, GRID
from systems.perception.tracking import TrackingParams
from systems.perception.tracks import Track, matched
from systems.switching.signals import STANDING

ROOM = [WallParams([[-3, -3], [5, -3], [5, 3], [-3, 3], [-3, -3]])]
MAPPING = GridMappingParams()
CENTRE = RobotState(0.0, 0.0, 0.0, 0.0, 0.0)


class World:
    """A robot's perception of a world, scan by scan."""

    def __init__(self, walls=(), **lidar):
        self.walls = walls
        self.lidar = lidar_constants(LidarParams(**lidar), segments(walls))[0]
        self.k_map = grid_mapping.constants(MAPPING)
        person = 0.3 if lidar.get("legs") else 0.0
        params = TrackingParams(person=person)
        self.k_track = tracking.constants(params, MAPPING)
        self.belief, self.grid = np.zeros(size(Belief)), np.zeros(size(GRID))
        self.tracks = np.zeros(tracking.CAPACITY * tracks.TRACK_SIZE)
        self.stamp, self.time = np.zeros(2), 0.0
        self.rng = np.random.default_rng(5)

    def look(self, robot=CENTRE, rows=(), reckoned=None):
        """A scan of rows of `Obstacle`, 0.1 s after the last."""
        table = np.reshape(np.array(rows, float), (-1, 5))
        noise = self.rng.standard_normal((RAYS, 2))
        scan = scan_of(self.lidar, robot, table, noise)[0].ravel()
        told = np.array(reckoned or robot)
        place = grid_mapping.place_now(self.belief, told)
        dt = self.time - self.stamp[0]
        moving = tracking.walking(self.k_track, self.tracks, dt)
        self.tracks, self.stamp = tracking.tracked(
            self.k_track, self.tracks, self.stamp, self.time, place, self.grid, scan
        )
        self.belief, self.grid = grid_mapping.mapped(
            self.k_map, self.belief, self.grid, told, scan, moving
        )
        self.time += 0.1

    def all(self) -> list[Track]:
        """Tracks, whether they move or not."""
        rows = self.tracks.reshape(-1, tracks.TRACK_SIZE)
        return [Track(*row) for row in rows if row[0] > 0.0]

    def moving(self) -> list[Track]:
        """Tracks that move."""
        return [track for track in self.all() if track.moves]

    def occupied(self, x: float, y: float, within: float = 0.15) -> bool:
        """Whether the grid holds something near a place."""
        c = view(GRID, self.grid)
        near = np.hypot(c.x - x, c.y - y) < within
        return bool((near & (c.odds >= OCCUPIED)).any())


@pytest.mark.parametrize(("radius", "away"), [(0.2, 1.0), (0.3, 2.0), (0.5, 3.0)])
def test_a_disc_is_seen_as_its_circle(radius, away):
    world = World()
    for _ in range(5):
        world.look(rows=[(away, 0.4, radius, 0.0, 0.0)])
    (track,) = world.all()
    assert hypot(track.x - away, track.y - 0.4) < 0.03
    assert track.radius == pytest.approx(radius, abs=0.03)
    assert not world.moving()


@pytest.mark.parametrize("legs", [False, True])
def test_who_walks_is_tracked_and_kept_in_mind_while_hidden(legs):
    world = World(ROOM, legs=legs)

    def scene(k: int, hidden: bool = False):
        walker = (2.0, -1.5 + 0.04 * k, 0.3, 0.0, 0.4)
        before = (1.0, 0.5 * walker[1], 0.3, 0.0, 0.2)
        return [walker, *([before] if hidden else [])]

    for k in range(30):
        world.look(rows=scene(k))
    (track,) = world.moving()
    assert hypot(track.x - 2.0, track.y + 0.34) < (0.15 if legs else 0.06)
    assert hypot(track.v_x, track.v_y - 0.4) < (0.15 if legs else 0.06)
    # Who walks is no part of the map, the wall behind is.
    assert not world.occupied(2.0, -0.34, 0.5) and world.occupied(5.0, 0.0)
    number = track.number
    for k in range(30, 36):
        world.look(rows=scene(k, hidden=True))
    hidden = [t for t in world.moving() if t.number == number]
    assert hidden and hypot(hidden[0].x - 2.0, hidden[0].y + 0.1) < 0.2
    for _ in range(8):
        world.look()  # gone, and seen to be
    assert not world.moving()


def told(world: World) -> np.ndarray:
    """What the planner is told from the middle, rows of `Seen`."""
    rows = tracking.sight(
        world.k_track, world.tracks, 0.0, np.array(CENTRE), world.grid
    ).reshape(-1, 6)
    return rows[rows[:, 0] >= 0.0]


def test_who_stands_is_as_wide_as_a_person_and_no_part_of_the_map():
    world = World(ROOM, legs=True)
    for _ in range(30):
        world.look(rows=[(1.5, 0.5, 0.3, 0.0, 0.0)])
    people = [row for row in told(world) if row[0] < 1000.0]
    assert len(people) == 1
    assert people[0][1:] == pytest.approx([1.5, 0.5, 0.3, 0.0, 0.0], abs=0.03)
    points = told(world)[:, 1:3] - (1.5, 0.5)
    assert (np.hypot(*points.T) < 0.3).sum() == 1  # himself
    assert world.occupied(-3.0, 0.0)  # the wall is there as ever
    # He walks on and is the same; behind a screen he is soon forgotten.
    number = people[0][0]
    for k in range(8):
        world.look(rows=[(1.5, 0.5 - 0.04 * k, 0.3, 0.0, -0.4)])
    (walker,) = [row for row in told(world) if row[0] < 1000.0]
    assert walker[0] == number and walker[5] == pytest.approx(-0.4, abs=0.2)


def test_who_is_new_is_told_with_the_speed_that_two_scans_show():
    world = World(ROOM, legs=True)
    for k in range(3):
        world.look(rows=[(2.0, 0.1 * k, 0.3, 0.0, 1.0)])
    (walker,) = [row for row in told(world) if row[0] < 1000.0]
    assert walker[5] > 0.5


def test_legs_that_are_nearest_to_each_other_are_one_persons():
    # Three legs in a row: the middle one belongs to the nearer of its neighbours.
    legs = [Cluster(2.0, y, 0.06, WHOLE, 0.0, 1.9, 0.0, 0.0, 0.0, 0.0)
            for y in (0.0, 0.4, 0.62)]  # fmt: skip
    params = tracking.constants(TrackingParams(person=0.3), MAPPING)[0]
    found = people(params, np.array(legs))
    (one, two) = sorted((Cluster(*row) for row in found), key=lambda c: c.y)
    assert one.y == 0.0 and one.hidden == LEG
    assert two.y == pytest.approx(0.51) and two.hidden == WHOLE
    assert one.legs == two.legs == 1.0


def test_one_leg_moves_nobody_who_may_stand_beside_it():
    params = TrackingParams(person=0.3)
    leg = Cluster(2.0, 0.0, 0.3, LEG, 0.0, 1.9, 0.0, 0.0, 0.0, 1.0)
    assert seen_as.py_func(params, CENTRE, leg, 2.0, 0.15, 0.3)[:2] == (2.0, 0.15)
    x, y, _ = seen_as.py_func(params, CENTRE, leg, 2.0, 0.5, 0.3)
    assert (x, y) == pytest.approx((2.0, params.beside))


def test_nobody_is_tracked_twice():
    world = World(ROOM)
    for k in range(12):
        if k == 8:  # the same body again, as when it was seen as two for a moment
            rows = world.tracks.reshape(-1, tracks.TRACK_SIZE)
            rows[1] = rows[0]
            rows[1, :3] += (90.0, 0.05, 0.05)
        world.look(rows=[(2.0 - 0.04 * k, 0.5, 0.25, -0.4, 0.0)])
        assert len(world.moving()) <= (1 if k != 7 else 2)
    assert len(world.all()) == 1


def test_what_was_seen_for_a_moment_is_believed_in_for_a_moment():
    thing, before_it = (2.5, 0.0, 0.3, 0.0, 0.0), (1.2, 0.0, 0.4, 0.0, 0.0)
    kept = []
    for scans in (3, 20):
        world = World()
        for _ in range(scans):
            world.look(rows=[thing])
        for _ in range(6):
            world.look(rows=[thing, before_it])
        kept.append(any(hypot(t.x - 2.5, t.y) < 0.3 for t in world.all()))
    assert kept == [False, True]


@pytest.mark.parametrize(
    ("known", "hidden", "cut", "born"),
    [
        (0, WHOLE, 0, 1),
        (1, WHOLE, 0, 1),
        (2, WHOLE, 0, 0),
        (1, LEG, 0, 0),
        (1, 0, 1, 0),
    ],
)
def test_what_is_new_or_slow_is_tracked_anew_but_nothing_that_stood(
    known, hidden, cut, born
):
    world = World()
    found = np.array([Cluster(2.0, 0.0, 0.3, hidden, known, 1.7, -0.1, 0.1, cut, 0.0)])
    table = world.tracks.reshape(-1, tracks.TRACK_SIZE)
    nobody = np.full(len(table), -1)
    rows, _ = tracking.updated(
        world.k_track, table, found, nobody, np.array(CENTRE), np.zeros(RAYS), 0.0
    )
    assert (rows[:, 0] > 0.0).sum() == born


def test_walls_are_nobody_and_what_stood_there_before_is_forgotten():
    world = World(ROOM)
    for k in range(12):
        world.look(RobotState(0.05 * k, 0.0, 0.0, 0.5, 0.0), [(2.0, 1.0, 0.3, 0, 0)])
    assert world.occupied(1.8, 0.8, 0.3) and not world.moving()
    here = RobotState(0.55, 0.0, 0.0, 0.0, 0.0)
    for _ in range(12):
        world.look(here)
    assert not world.occupied(1.8, 0.8, 0.3)
    # Behind a screen the wall is out of sight, and remembered.
    world.lidar = lidar_constants(LidarParams(), segments([
        *ROOM, WallParams([[2.0, -2.0], [2.0, 2.0]])]))[0]  # fmt: skip
    for _ in range(40):
        world.look(here)
    assert world.occupied(5.0, 0.0)
    rows = tracking.sight(
        world.k_track, world.tracks, 0.0, np.array(here), world.grid
    ).reshape(-1, 6)
    stands = rows[rows[:, 0] >= 1000.0]
    assert 10 < len(stands) <= STANDING
    assert (np.hypot(stands[:, 1] - 0.55, stands[:, 2]) <= 3.0).all()


def test_the_place_is_put_right_in_a_room_and_unsure_along_a_corridor():
    corridor = [WallParams([[-60, -1], [60, -1]]), WallParams([[-60, 1], [60, 1]])]
    sigmas = {}
    for name, walls in (("room", ROOM), ("corridor", corridor)):
        world = World(walls)
        for k in range(100):
            s = 0.02 * k
            true = RobotState(s, 0.2 * sin(s), 0.2 * cos(s), 0.2, 0.0)
            # Three per cent too long, and turning away by a third of a degree a metre.
            wrong = true._replace(
                x=1.03 * s, y=true.y + 0.003 * s * s, theta=true.theta + 0.006 * s
            )
            world.look(true, reckoned=wrong)
        belief = Belief(*world.belief)
        sigmas[name] = np.sqrt([belief.xx, belief.yy])
        across, along = abs(belief.y - true.y), abs(belief.x - true.x)
        assert across < 0.015 and abs(belief.theta - true.theta) < 0.012
        assert along < (0.04 if name == "room" else 0.08)
    assert sigmas["room"][0] < 0.8 * sigmas["corridor"][0]
    assert sigmas["corridor"][0] > 1.5 * sigmas["corridor"][1]


def test_the_cheapest_matches_in_all_are_taken():
    table = np.full((4, 3), tracks.FORBIDDEN)
    table[0, 0], table[0, 1], table[2, 0] = 1.0, 2.0, 3.5
    np.testing.assert_array_equal(matched(table), [1, -1, 0, -1])
    assert (matched(table[:, :0]) == -1).all()


def test_who_is_hidden_on_both_sides_covers_what_is_seen_of_them():
    params = TrackingParams()
    near, ends = 2.0, (-0.05, 0.05)
    slit = Cluster(2.1, 0.0, 0.1, BETWEEN, 0.0, near, *ends, 0.0, 0.0)
    phi = asin(0.3 / 2.3)
    for bearing, told in ((0.02, 0.02), (1.5, -0.05 + phi), (-1.5, 0.05 - phi)):
        x, y = 2.3 * cos(bearing), 2.3 * sin(bearing)
        at = seen_as.py_func(params, CENTRE, slit, x, y, 0.3)
        assert at[:2] == pytest.approx((2.3 * cos(told), 2.3 * sin(told)))


def test_broken_input_changes_nothing():
    world = World(ROOM)
    for _ in range(5):
        world.look()
    before = world.belief.copy(), world.grid.copy(), world.tracks.copy()
    broken = np.full(5, np.nan)
    scan = np.ones(RAYS)
    moving = tracking.walking(world.k_track, world.tracks, 0.0)
    belief, grid = grid_mapping.mapped(
        world.k_map, world.belief, world.grid, broken, scan, moving
    )
    tracks, _ = tracking.tracked(
        world.k_track, world.tracks, world.stamp, 1.0, broken, world.grid, scan
    )
    for old, new in zip(before, (belief, grid, tracks), strict=True):
        np.testing.assert_array_equal(old, new)
    assert world.grid.size == 3 * CELLS * CELLS
