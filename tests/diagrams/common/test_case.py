"""Tests of what is done before a run, and that nothing of it is done after."""

from contextlib import contextmanager

import pytest

from diagrams.common.case import Case
from diagrams.common.run import prepare, simulate, simulate_diagram
from diagrams.navigation.plots import plots
from diagrams.studies import build, get_study, load_scenario


class Stages:
    """A progress that notes what went on, and how far it got."""

    def __init__(self, interrupted=""):
        self.seen: dict[str, float] = {}
        self.interrupted = interrupted

    @contextmanager
    def __call__(self, label, unit):
        """Called as a `Progress`."""

        def show(value, whole):
            self.seen[label] = value / whole
            if label == self.interrupted:
                raise KeyboardInterrupt

        yield show


@pytest.fixture(scope="module")
def scenario():
    return load_scenario("nav_one_static", duration=1.0)


def test_companions_are_run_before_and_shown(scenario):
    stages = Stages()
    case = prepare(scenario, stages)
    assert stages.seen == {"statechart: running": 1.0, "classical: running": 1.0}
    for name, run in case.companions.items():
        assert run.scenario.planner == name and run.simulated == 1.0
        assert run.case.companions == {}
    stages = Stages()
    run = simulate(case, progress=stages)
    assert stages.seen == {"running": 1.0}
    assert run.case is case
    labels = [t.get_text() for t in plots(run)["path"].legends[0].get_texts()]
    assert [label.partition(":")[0] for label in labels] == [
        "switching",
        "statechart",
        "classical",
    ]


def test_an_interrupted_companion_ends_it_all(scenario):
    stages = Stages("statechart: running")
    with pytest.raises(KeyboardInterrupt):
        simulate(scenario, progress=stages)
    assert list(stages.seen) == ["statechart: running"]


def test_a_scenario_or_a_case_of_it_may_be_given(scenario):
    case = prepare(scenario)
    runs = [
        simulate(scenario),
        simulate_diagram(scenario, build(scenario)),
        simulate_diagram(case, build(case)),
    ]
    for run in runs:
        for name, column in run.signals.items():
            assert (column == runs[0].signals[name]).all()
        assert set(run.case.companions) == {"statechart", "classical"}


def test_the_figure_that_needs_a_run_without_the_obstacle():
    scenario = load_scenario("gauze_crossed", duration=0.5)
    study = get_study("gauze")
    companions = study.companions(scenario)
    assert list(companions) == ["without obstacle"]
    assert not study.companions(companions["without obstacle"])
    run = simulate(Case(scenario), progress=Stages())
    assert run.metrics["time_ratio"] is None  # nothing was prepared
