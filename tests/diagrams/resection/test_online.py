"""Procedures chosen while the robot works: as the plan whole, late, and cut off."""

import pytest

from diagrams.common.run import simulate
from diagrams.resection.online import save_choices
from diagrams.studies import load_scenario

SMALL = ["spacing=0.001", "reach_effort=0.02", "automatic=false"]
ENTRY = ["entry 24 6 clipped", "commit"]
NEXT = ["suggest", "commit"]


def scenario_of(file, lines, *overrides):
    save_choices(file, lines)
    return load_scenario("resect_auto_small", [*SMALL, f"choices={file}", *overrides])


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Three procedures chosen at once, and the same planned before."""
    file = tmp_path_factory.mktemp("whole") / "c.csv"
    lines = [(0.0, line) for line in [*ENTRY, *NEXT, *NEXT]]
    online = simulate(scenario_of(file, lines, "duration=60.0"))
    scenario = load_scenario("resect_auto_small", SMALL)
    scenario.procedures = [
        step.procedure for step in online.case.session.steps if step.procedure
    ]
    return simulate(scenario), online


def test_it(whole):
    off, on = whole
    print(
        off.duration,
        on.duration,
        on.metrics,
        [(s.name, s.first, s.last) for s in off.case.session.steps],
    )
