"""The random scenes keep their rules, and the loop tells what happened."""

import pytest

from systems.common.geometry import (
    closest_on_segment,
    closest_points,
    norm,
    segment_triangle_distance,
    sub,
)
from tests.benchmarks.crossed_scenes import CONTACT, KINDS, Leg, Scene, scene
from tests.benchmarks.kinematic_loop import Robot, estimate, run
from tests.benchmarks.kinematic_scenes import corrected, table, tally


@pytest.mark.parametrize("kind", KINDS)
def test_scenes_keep_the_recipe(kind):
    for k in range(20):
        s = scene(kind, 7, k)
        tip = s.obstacle_tip(0.0)[0]
        start, goal = s.p_WPr, s.p_WPs
        assert norm(sub(s.p_WGr, s.p_WGo)) >= 0.06
        assert norm(sub(goal, start)) >= 0.03
        for p, g in ((start, s.p_WGr), (goal, s.p_WGr), (tip, s.p_WGo)):
            assert 0.08 <= norm(sub(p, g)) <= 0.16 and p[2] >= -0.065
        # The straight motion touches O.
        assert segment_triangle_distance(s.p_WGo, tip, s.p_WGr, start, goal) < CONTACT
        rest = s.obstacle_tip(100.0)[0]
        assert closest_points(s.p_WGr, goal, s.p_WGo, rest)[2] >= CONTACT + 0.003
        least = 0.0265 if kind == "standing" else 0.0295
        for t in range(8):
            p = s.obstacle_tip(float(t))[0]
            assert closest_on_segment(s.p_WGr, s.p_WGo, p)[1] >= least
        assert s.rest_time == pytest.approx(0.0 if kind == "standing" else 7.0)


def test_scenes_depend_on_seed_kind_and_number_only():
    assert scene("moving", 3, 5) == scene("moving", 3, 5)
    assert scene("moving", 3, 5) != scene("moving", 4, 5)
    with pytest.raises(ValueError, match="standing, moving"):
        scene("flying", 1, 1)


def test_a_leg_has_a_trapezoid_of_speed():
    leg = Leg(1.0, (0.0, 0.0, 0.0), (0.1, 0.0, 0.0), 0.04)
    # 0.1 s to 40 mm/s at 400 mm/s^2, so 2.6 s in all.
    assert leg.end == pytest.approx(3.6)
    assert leg.at(1.05)[1][0] == pytest.approx(0.02)
    assert leg.at(2.0)[1][0] == pytest.approx(0.04)
    assert leg.at(9.0) == ((0.1, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    h = 1e-6
    for t in (1.03, 2.2, 3.55):
        slope = (leg.at(t + h)[0][0] - leg.at(t - h)[0][0]) / (2 * h)
        assert leg.at(t)[1][0] == pytest.approx(slope, abs=1e-6)
    short = leg.shortened(2.0)
    assert short.end == pytest.approx(2.0) and short.p1[0] == pytest.approx(0.036)


class Straight:
    """A planner that goes straight at 50 mm/s and stops."""

    def step(self, dt, robot_tool, obstacle, target, others=()):
        """See `Planner`."""
        d = sub(target[0:3], robot_tool[3:6])
        scale = min(0.05, 10.0 * norm(d)) / max(norm(d), 1e-9)
        return d[0] * scale, d[1] * scale, d[2] * scale


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


def test_the_standing_scenes_are_reached_as_often_as_measured():
    # 300 scenes of seed 1 gave 40 %, and no contact.
    t = tally("standing", corrected, 40, 1)
    assert 0.25 < t.share("reached") < 0.6
    assert t.share("contact") == 0.0


def test_the_table_has_a_row_for_every_set():
    lines = table(2, 1, ["corrected"]).splitlines()
    assert len(lines) == 3
    assert lines[1].startswith("standing") and lines[2].startswith("moving")


def test_estimate_lays_out_the_signal():
    e = estimate((1, 2, 3), (4, 5, 6), (7, 8, 9), (10, 11, 12))
    assert len(e) == 17 and e[9:12].tolist() == [4, 5, 6] and e[15] == 1.0
