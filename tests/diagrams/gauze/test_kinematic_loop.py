"""The kinematic loop tells what happened, and the robot keeps its limits."""

import pytest

from diagrams.gauze.kinematic_loop import Robot, estimate, run
from diagrams.gauze.scenes import Leg, Scene
from systems.common.geometry import norm, scaled, sub
from systems.common.signal import size


class Straight:
    """A planner that goes straight at 50 mm/s and stops."""

    def step(self, dt, robot, obstacle, target, others=()):
        """See `Planner`."""
        d = sub(target.p, robot.tip)
        return scaled(min(0.05, 10.0 * norm(d)) / max(norm(d), 1e-9), d)


def test_the_loop_tells_contact_from_arrival():
    away, across = (0.0, 0.09, -0.1), (0.0, -0.03, -0.1)
    start, goal = (-0.04, 0.0, -0.1), (0.04, 0.0, -0.1)

    def outcome(tip, planner):
        leg = Leg(0.0, tip, tip, 1.0)
        return run(Scene((0, 0, 0), start, goal, (0.0, 0.1, 0.0), [leg]), planner)

    there = outcome(away, Straight())
    assert there.reached and not there.contact
    assert there.time == pytest.approx(0.08 / 0.05, abs=0.3)
    hit = outcome(across, Straight())
    assert hit.contact and not hit.reached and hit.clearance <= 0.0


def test_the_robot_keeps_its_limits():
    robot = Robot(max_speed=0.1, max_turning=0.5, least_insertion=0.05)
    tip = robot.moved((0, 0, 0), (0, 0, -0.1), (1.0, 0.0, 0.0), 0.1)
    assert tip[0] == pytest.approx(0.5 * 0.1 * 0.1)  # turning: 0.5 rad/s at 0.1 m
    tip = robot.moved((0, 0, 0), (0, 0, -0.1), (0.0, 0.0, -1.0), 0.1)
    assert tip[2] == pytest.approx(-0.11)
    tip = robot.moved((0, 0, 0), (0, 0, -0.052), (0.0, 0.0, 0.1), 0.1)
    assert tip[2] == pytest.approx(-0.05)


def test_estimate_lays_out_the_signal():
    e = estimate((1, 2, 3), (4, 5, 6), (7, 8, 9), (10, 11, 12))
    assert size(type(e)) == 17 and e.fulcrum == (4.0, 5.0, 6.0) and e.known == 1.0
