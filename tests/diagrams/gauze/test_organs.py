"""Organs in the whole loop."""

import numpy as np
import pytest

from tests.runs import run

pytestmark = pytest.mark.xdist_group("gauze")


def test_the_lobe_is_passed_and_nothing_touched():
    figures = run("gauze_organs").metrics
    assert figures["reached"]
    assert figures["max_tissue_force"] == 0.0
    assert figures["min_organ_clearance"] >= 0.002
    assert figures["min_tool_clearance"] >= 0.002
    assert figures["time_ratio"] < 1.3


def test_without_constraint_and_bypass_it_would_go_through():
    through = run(
        "gauze_organs",
        "behaviour=field",
        "clearance_constraint.active=false",
        "time_ratio=false",
        "duration=3.0",
    )
    assert through.metrics["min_organ_clearance"] < -0.005
    assert through.metrics["max_tissue_force"] > 1.0
    assert np.isfinite(through.organs.touch.f).all()
