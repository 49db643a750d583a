"""What a robot that knows the future could have avoided."""

import numpy as np

from diagrams.gauze.foresight import Reach, unavoidable

REACH = Reach(0.25, 4.0, 0.6, 0.03, 0.7)
G, START = (0.0, 0.0, 0.0), (0.0, 0.0, -0.12)
TIMES = np.linspace(0.0, 3.0, 601)


def sweep(depth, begin, speed=0.3):
    """A tool that sweeps across R's shaft `depth` below its trocar."""
    x = np.clip(0.06 - speed * np.maximum(TIMES - begin, 0.0), -0.06, None)
    tips = np.column_stack([x, np.full_like(x, -0.05), np.full_like(x, -depth)])
    fulcrums = np.tile([0.0, 0.1, -depth + 1e-3], (len(TIMES), 1))
    fulcrums[:, 0] = x
    return tips[:, None], fulcrums[:, None]


def test_who_knows_in_time_withdraws():
    assert not unavoidable(REACH, 0.005, TIMES, G, START, *sweep(0.08, 1.0))


def test_a_sweep_that_is_too_fast_cannot_be_avoided():
    tips, fulcrums = sweep(0.08, 0.0, 1.0)
    assert unavoidable(REACH, 0.005, TIMES, G, START, tips, fulcrums)


def test_a_tool_that_crosses_at_the_trocar_cannot_be_avoided():
    assert unavoidable(REACH, 0.005, TIMES, G, START, *sweep(0.015, 1.0))
