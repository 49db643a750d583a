"""The synthetic hand has a real one's speeds, and stays where a tool can be."""

import numpy as np
import pytest

from plants.surgeon.surgeon_tool import SurgeonToolParams, tip_motion
from plants.surgeon.synthetic_hand import Line, SyntheticHand, synthetic_motion

G = np.array([0.02, 0.11, 0.0])
OTHER = Line(np.array([0.05, 0.03, -0.12]), np.array([0.11, 0.03, 0.0]))


def hand(seed, duration=20.0):
    """Its times and path."""
    start = np.array([0.0, 0.02, -0.11])
    return synthetic_motion(SyntheticHand(seed=seed), G, start, duration, OTHER)


def test_the_speeds_have_the_tails_of_a_real_hand():
    """A real hand's: mean 11 mm/s, 99 % below 62 mm/s, peaks to 250 mm/s."""
    speeds = []
    for seed in range(101, 161):
        times, path = hand(seed)
        speeds.append(np.linalg.norm(np.diff(path, axis=0), axis=1) / np.diff(times))
    speeds = np.array(speeds)
    assert 0.009 < speeds.mean() < 0.013
    assert 0.050 < np.quantile(speeds, 0.99) < 0.075
    assert 0.13 < speeds.max() < 0.26
    # It rests at times, and slides along the other tool.
    assert 0.2 < np.mean(speeds < 0.008) < 0.8


def test_it_stays_below_its_fulcrum_and_repeats():
    for seed in (1, 2, 3):
        _, path = hand(seed)
        depth = np.linalg.norm(path - G, axis=1)
        assert depth.min() > 0.025 and depth.max() < 0.165
        assert path[:, 2].max() < -0.005
        np.testing.assert_array_equal(path, hand(seed)[1])
    assert np.abs(hand(1)[1] - hand(2)[1]).max() > 0.01


def test_it_is_a_way_to_move_a_tool_and_bad_ones_are_named():
    params = SurgeonToolParams(hand=SyntheticHand(seed=4))
    assert np.ptp([tip_motion(params)(t)[0] for t in range(20)]) > 0.005
    params = SurgeonToolParams(hand=SyntheticHand(least_depth=0.2))
    with pytest.raises(ValueError, match=r"least_depth=0.2 m: expected less than"):
        tip_motion(params)
