"""A resection by the snake as it would be."""

from dataclasses import replace

import numpy as np
import pytest

from diagrams.common.run import simulate
from diagrams.resection.metrics import body_error
from diagrams.resection.plots import plots
from diagrams.resection.tool_error import carried_out, error_figure, stray
from diagrams.studies import load_scenario
from tests import runs

SMALL = ["spacing=0.001", "reach_effort=0.25"]
LOG = 0.1


@pytest.fixture(scope="module")
def ideal():
    """The plan for the ideal snake, which other tests need, too."""
    return runs.run("resect_auto_small", *SMALL).case


@pytest.fixture(scope="module")
def real(ideal):
    """Its beginning on the real one."""
    scenario = load_scenario("resect_auto_small_real", SMALL, duration=8.0)
    scenario.snake.tool_radius = ideal.scenario.snake.tool_radius
    return simulate(replace(ideal, scenario=scenario))


def test_the_true_balls_carve_and_are_measured(real):
    m = real.metrics
    assert not real.error and m["stops"] == 0 and m["buckled_at"] is None
    assert 0.02e-3 < m["rms_tool_error"] < 0.4e-3
    assert m["max_split"] > 1e-3 and m["least_eigenvalue"] > 0.0
    far = body_error(real)
    tool = np.linalg.norm(real.snake.tool.p - real.tip.reference.p, axis=1)
    np.testing.assert_allclose(far[:, -1], tool, atol=1e-6)
    assert m["max_body_error"] == far[:, :-1].max() > 0.05e-3
    assert m["resected_fraction"] > 0.03
    assert np.linalg.norm(real.tool.force.f, axis=1).max() > 0.1
    assert "report" in plots(real)


def test_more_error_is_more_contact_and_more_healthy_tissue(ideal, real):
    off = stray(real)
    assert np.abs(off).max() > 1e-3
    rows = [carried_out(ideal, off, LOG, e) for e in (0.0, 0.1e-3, 0.7e-3)]
    assert [row.error for row in rows[:2]] == pytest.approx([0.0, 0.1e-3], abs=1e-5)
    assert rows[0].executed > 0.98
    assert rows[0].contact < 1e-3 < rows[1].contact < rows[2].contact
    assert rows[0].healthy < rows[1].healthy < rows[2].healthy
    assert len(error_figure({"one": rows}).axes) == 3


@pytest.mark.study
@pytest.mark.parametrize("seed", [1, 2])
def test_auto_small_real(seed):
    of = [f"tumour.seed={seed}"]
    m = simulate(load_scenario("resect_auto_small_real", of, seed)).metrics
    assert m["resected_fraction"] >= 0.9 * m["reachable_fraction"]
    assert m["healthy_removed"] <= 0.02 * m["tumour_volume"]
    assert m["max_outside_depth"] <= 1.5e-3
    assert m["stops"] == 0
