"""The lidar measures what geometry says, and a nearer thing hides a farther one."""

import numpy as np
import pytest

from plants.crowd.walls import WallParams, segments
from plants.turtlebot.lidar import RAYS, LidarParams, constants, scan_of
from plants.turtlebot.signals import RobotState
from systems.common.parameter import ParameterError

ROOM = [WallParams([[-2, -2], [3, -2], [3, 2], [-2, 2], [-2, -2]], True)]
HERE = RobotState(0.0, 0.0, np.pi / 2, 0.0, 0.0)


def scan(rows=(), walls=(), robot=HERE, noise=None, **params):
    """Ranges of a scan of rows of `Obstacle`."""
    table = np.reshape(np.array(rows, float), (-1, 5))
    noise = np.zeros((RAYS, 2)) if noise is None else noise
    record = constants(LidarParams(**params), segments(walls))[0]
    return scan_of(record, robot, table, noise)[0].ravel()


def test_walls_and_a_disc_before_one():
    r = scan([(0.0, 1.0, 0.3, 0.0, 0.0)], ROOM)
    assert r[0] == pytest.approx(0.7)  # straight ahead, along y: the disc
    assert r[90] == pytest.approx(2.0) and r[270] == pytest.approx(3.0)
    assert r[45] == pytest.approx(2.0 * np.sqrt(2.0))
    inside = np.degrees(np.arcsin(0.3))
    assert (r[: int(inside)] < 1.0).all() and r[int(inside) + 1] > 2.0


def test_nothing_comes_back_from_afar_or_by_a_dropout():
    assert not scan().any()
    noise = np.random.default_rng(1).standard_normal((RAYS, 2))
    lost = scan([], ROOM, noise=noise, dropout=0.2) == 0.0
    assert 0.14 < lost.mean() < 0.26
    kept = scan([], ROOM, noise=noise, dropout=0.0)
    assert np.std(kept - scan([], ROOM)) == pytest.approx(0.01, rel=0.15)


def test_a_person_is_two_legs_that_walk():
    gaps = []
    for x in np.linspace(0.0, 0.6, 7):
        r = scan([(x, 1.5, 0.3, 1.0, 0.0)], legs=True)
        legs = np.flatnonzero(r)
        assert 4 < len(legs) < 14 and (r[legs] > 1.3).all()
        gaps.append(np.ptp(r[legs]))
    assert np.ptp(gaps) > 0.05


def test_an_outline_must_close():
    with pytest.raises(ParameterError, match=r"ends where it begins; it is 1 m open"):
        from systems.common.parameter import check

        check(WallParams([[0, 0], [1, 0], [1, 1], [0, 1]], True), "walls[0]")
    with pytest.raises(ValueError, match=r"walls: 65 pieces: expected <= 64"):
        segments([WallParams([[float(k), 0.0] for k in range(66)])])
