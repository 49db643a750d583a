"""Procedures chosen while the robot works: as the plan whole, late, and cut off."""

from time import sleep

import numpy as np
import pytest

from diagrams.common.metrics import WALL_CLOCK
from diagrams.common.run import simulate
from diagrams.common.scenario import ScenarioError
from diagrams.resection.online import answered, load_choices, save_choices
from diagrams.resection.operate import operate
from diagrams.studies import load_scenario
from plants.tissue.execution import load_execution
from systems.common.archive import beside
from systems.resection.planning.resumed import load_session
from systems.resection.wires.online_player import Wait

SMALL = ["spacing=0.001", "reach_effort=0.005", "automatic=false"]
ENTRY = "entry 14 5.5 clipped"
SECOND = "elementary 0 0 14 0 0 1 3 8 clipped"
THIRD = "elementary 0 0 17 0.02 0 1 4 9 clipped"


def at(*told):
    """Lines at their times, each choice followed by `commit`."""
    return [(time, line) for time, first in told for line in (first, "commit")]


def online(file, lines, *overrides):
    save_choices(file, lines)
    overrides = [*SMALL, f"choices={file}", *overrides]
    return simulate(load_scenario("resect_auto_small", overrides))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Three procedures, each chosen while one is carried out; and planned before."""
    file = tmp_path_factory.mktemp("whole") / "c.csv"
    lines = at((0.0, ENTRY), (3.0, SECOND), (9.0, THIRD))
    run = online(file, lines, "duration=27.1")
    scenario = load_scenario("resect_auto_small", SMALL)
    scenario.procedures = [
        step.procedure for step in run.case.session.steps if step.procedure
    ]
    return simulate(scenario), run


def told(run):
    """A run's figures without those of the clock on the wall, and of choosing."""
    left = {*WALL_CLOCK, "choices", "time_waited"}
    return {key: value for key, value in run.metrics.items() if key not in left}


def test_chosen_ahead_of_need_it_is_the_plan_to_the_last_digit(whole):
    planned, chosen = whole
    assert not chosen.error and planned.simulated == chosen.simulated == 27.1
    for name, column in planned.signals.items():
        np.testing.assert_array_equal(column, chosen.signals[name], err_msg=name)
    assert told(planned) == told(chosen) and len(planned.case.session.steps) == 4
    assert chosen.metrics["time_waited"] == 0.0
    assert chosen.metrics["resected_fraction"] == pytest.approx(0.34, abs=0.02)
    answers = [row["answer"] for row in chosen.metrics["choices"]]
    assert sum(answer.startswith("committed") for answer in answers) == 3


def test_what_is_checked_is_what_will_be_free(whole, tmp_path):
    """The second procedure is refused before the entry is accepted, and not after."""
    lines = [*at((0.0, SECOND), (0.0, ENTRY), (0.1, SECOND)), (0.2, "undo")]
    run = online(tmp_path / "c.csv", lines, "duration=1.0")
    answers = [row["answer"] for row in run.metrics["choices"]]
    assert "committed" not in answers[1] and answers[5].startswith("committed")
    assert answers[6].startswith("took back")


def test_chosen_late_it_waits_and_does_the_same(whole, tmp_path):
    _, ahead = whole
    lines = [
        *at((0.5, ENTRY), (5.0, SECOND)),
        (5.0, "stop"),
        (5.5, "undo"),
        (5.6, "commit"),
        (5.6, SECOND),
        (5.6, "commit"),
        (9.0, "go"),
        (11.0, "undo"),
        (11.0, "update none.nrrd"),
        *at((22.0, THIRD)),
    ]
    run = online(tmp_path / "c.csv", lines, "duration=60.0")
    assert not run.error and run.simulated < 40.0
    said = {row["line"]: row["answer"] for row in run.metrics["choices"]}
    assert "the robot has begun that step" in said["undo"]
    assert "between two runs" in said["update none.nrrd"]
    reason, time = run.plan.waiting.reason, run.signals["time"]
    assert (reason[(time > 7.2) & (time < 8.9)] == Wait.TOLD).all()
    late = (time > 19.0) & (time < 21.9)
    assert (reason[late] == Wait.NOTHING_CHOSEN).all()
    assert np.ptp(run.tip.reference.p[late], axis=0).max() == 0.0
    assert run.metrics["time_waited"] > 4.0
    for key in ("resected_fraction", "planned_fraction", "path_length"):
        assert run.metrics[key] == pytest.approx(ahead.metrics[key], rel=2e-3), key
    assert run.metrics["body_collisions"] == 0
    assert run.metrics["max_tool_error"] < 0.1e-3


def test_a_run_cut_off_goes_on_with_the_lines_that_are_left(whole, tmp_path):
    planned, _ = whole
    file, session = tmp_path / "c.csv", tmp_path / "s.session"
    lines = at((0.0, ENTRY), (3.0, SECOND), (9.0, THIRD))
    first = online(file, lines, f"session={session}", "duration=8.0")
    assert len(first.metrics["choices"]) == 4
    assert len(load_session(session).steps) == 2
    rest = online(file, lines, f"session={session}", "duration=60.0")
    assert [row["line"] for row in rest.metrics["choices"]] == [THIRD, "commit", "end"]
    assert rest.metrics["choices"][0]["start"] == pytest.approx(9.0)
    assert rest.metrics["resumed_at"] == 8.0
    plan = planned.case.session.postures
    np.testing.assert_array_equal(rest.case.session.postures, plan)
    done = load_execution(
        beside(session, "executed"), plan, planned.case.session.volume.labels.shape
    )
    assert done.posture == len(plan) - 1
    for key in ("execution_time", "path_length", "resected_fraction"):
        assert rest.metrics[key] == pytest.approx(planned.metrics[key], rel=0.02), key


def test_what_was_typed_plays_back(tmp_path):
    """Typed while the robot works, at a pace; `quit` stands for `end`."""
    told: list[str] = []

    def typed():
        yield f"{ENTRY}\n"
        yield "commit\n"
        while not any("no procedure" in text for text in told):
            sleep(0.01)
        yield "quit\n"

    scenario = load_scenario("resect_auto_small", [*SMALL, "duration=12.0"])
    file, out = tmp_path / "s.session", tmp_path / "out"
    seen = operate(scenario, file, typed(), out, 100.0, told.append, False)
    assert not seen.error and seen.simulated < 12.0
    assert told[1].startswith("> commit\ncommitted")
    assert any("all that was chosen is done" in text for text in told)
    again = simulate(load_scenario(str(out / "scenario.yaml")))
    for name, column in seen.signals.items():
        np.testing.assert_array_equal(column, again.signals[name], err_msg=name)
    assert [row["line"] for row in again.metrics["choices"]][-1] == "end"


def test_lines_that_were_answered_before_a_crash():
    rows = [(0.0, 0, "entry 9 6"), (0.0, 0, "commit"), (1.0, 1, "check")]
    assert answered(rows, 1) == 2  # what was proposed is proposed again
    assert answered(rows[:2], 0) == 0  # cut off before the step was saved
    assert answered(rows[:2], 1) == 2
    assert answered([*rows, (2.0, 1, "finish")], 3) == 3  # cut off, perhaps


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,line\n", "line 1: expected 't,line'"),
        ("t,line\n1.0,\n", "line 2: expected a time in s and a line"),
        ("t,line\nsoon,commit\n", "line 2: expected a time"),
        ("t,line\n2.0,check\n1.0,commit\n", "line 3: times must not fall"),
        ("t,line\n2.0,a,b\n", "line 2: expected a time"),
    ],
)
def test_bad_choices(text, message, tmp_path):
    file = tmp_path / "c.csv"
    file.write_text(text)
    with pytest.raises(ValueError, match=message):
        load_choices(file)


def test_no_such_choices():
    with pytest.raises(ScenarioError, match=r"choices='.*': expected a file that is"):
        load_scenario("resect_auto_small", ["choices=none.csv"])
