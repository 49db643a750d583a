"""The random scenes keep their rules."""

import pytest

from diagrams.gauze.scenes import CONTACT, Leg, scene
from systems.common.geometry import (
    closest_on_segment,
    closest_points,
    norm,
    segment_triangle_distance,
    sub,
)


@pytest.mark.parametrize("kind", ["standing", "moving"])
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
    with pytest.raises(ValueError, match="standing, moving, blocked, crowded"):
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
