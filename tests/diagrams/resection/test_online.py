"""Procedures chosen while the robot works: as the plan whole, late, and cut off."""

from time import sleep

import numpy as np
import pytest

from diagrams.common.metrics import WALL_CLOCK
from diagrams.common.replay import start_meshcat
from diagrams.common.run import prepare, simulate
from diagrams.common.scenario import ScenarioError
from diagrams.resection.console import procedure_from
from diagrams.resection.online import answered, load_choices, save_choices
from diagrams.resection.operate import Listener, OnlineDesk, listened, operate
from diagrams.studies import load_scenario
from plants.tissue.execution import load_execution
from systems.common.archive import beside
from systems.resection.planning.resumed import load_session
from systems.resection.wires.online_player import Wait

SMALL = ["spacing=0.002", "tumour.length=0.024", "automatic=false"]
SMALL += ["reach_effort=0.005"]
ENTRY = "entry 8 5.5 clipped"
SECOND = "elementary 0 0 14 0 0 1 2 7"
THIRD = "elementary 0 0 12 0.02 0 1 2 8 clipped"


def at(*told):
    """Lines at their times, each choice followed by `commit`."""
    return [(time, line) for time, first in told for line in (first, "commit")]


def online(file, lines, *overrides):
    save_choices(file, lines)
    overrides = [*SMALL, f"choices={file}", *overrides]
    return simulate(load_scenario("resect_auto_small", overrides))


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Three procedures planned, and each chosen while one is carried out."""
    scenario = load_scenario("resect_auto_small", SMALL)
    scenario.procedures = [procedure_from(p.split()) for p in (ENTRY, SECOND, THIRD)]
    planned = simulate(scenario)
    lines = at((0.0, ENTRY), (1.0, SECOND), (4.0, THIRD))
    file = tmp_path_factory.mktemp("whole") / "c.csv"
    return planned, online(file, lines, f"duration={planned.duration}")


def told(run):
    """A run's figures without those of the clock on the wall, and of choosing."""
    left = {*WALL_CLOCK, "choices", "time_waited"}
    return {key: value for key, value in run.metrics.items() if key not in left}


def test_chosen_ahead_of_need_it_is_the_plan_to_the_last_digit(whole):
    planned, chosen = whole
    assert not chosen.error and planned.simulated == chosen.simulated > 14.0
    for name, column in planned.signals.items():
        np.testing.assert_array_equal(column, chosen.signals[name], err_msg=name)
    assert told(planned) == told(chosen) and len(planned.case.session.steps) == 4
    assert chosen.metrics["time_waited"] == 0.0
    assert chosen.metrics["resected_fraction"] > 0.3
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
        *at((0.5, ENTRY), (2.0, SECOND)),
        (2.0, "stop"),
        (2.2, "undo"),
        (2.3, "commit"),
        *at((2.3, SECOND)),
        (5.0, "go"),
        (6.0, "undo"),
        (6.0, "update none.nrrd"),
        *at((10.5, THIRD)),
    ]
    run = online(tmp_path / "c.csv", lines, "duration=40.0")
    assert not run.error and run.simulated < 25.0
    said = {row["line"]: row["answer"] for row in run.metrics["choices"]}
    assert "the robot has begun that step" in said["undo"]
    assert "between two runs" in said["update none.nrrd"]
    reason, time = run.plan.waiting.reason, run.signals["time"]
    assert (reason[(time > 3.9) & (time < 4.9)] == Wait.TOLD).all()
    late = (time > 9.0) & (time < 10.4)
    assert (reason[late] == Wait.NOTHING_CHOSEN).all()
    assert np.ptp(run.tip.reference.p[late], axis=0).max() == 0.0
    assert run.metrics["time_waited"] > 3.0
    for key in ("resected_fraction", "planned_fraction", "path_length"):
        assert run.metrics[key] == pytest.approx(ahead.metrics[key], rel=2e-3), key
    assert run.metrics["body_collisions"] == 0
    assert run.metrics["max_tool_error"] < 0.1e-3


def test_a_run_cut_off_goes_on_with_the_lines_that_are_left(whole, tmp_path):
    planned, _ = whole
    file, session = tmp_path / "c.csv", tmp_path / "s.session"
    lines = at((0.0, ENTRY), (1.0, SECOND), (5.0, THIRD))
    first = online(file, lines, f"session={session}", "duration=2.0")
    assert len(first.metrics["choices"]) == 4
    assert len(load_session(session).steps) == 2
    rest = online(file, lines, f"session={session}", "duration=40.0")
    assert [row["line"] for row in rest.metrics["choices"]] == [THIRD, "commit", "end"]
    assert rest.metrics["choices"][0]["start"] == pytest.approx(5.0)
    assert rest.metrics["resumed_at"] == 2.0
    plan = planned.case.session.postures
    np.testing.assert_array_equal(rest.case.session.postures, plan)
    done = load_execution(
        beside(session, "executed"), plan, planned.case.session.volume.labels.shape
    )
    assert done.posture == len(plan) - 1
    for key in ("execution_time", "path_length", "resected_fraction"):
        assert rest.metrics[key] == pytest.approx(planned.metrics[key], rel=0.02), key


def test_an_end_is_said_once():
    for said, heard in ((["check", "end"], ["check", "end"]), (["x"], ["x", "end"])):
        assert Listener(said, 0.0).hear(0.0, 0) == heard


def test_what_was_typed_plays_back(tmp_path):
    """Typed while the robot works, at a pace; `quit` stands for `end`."""
    told: list[str] = []

    def typed():
        yield f"{ENTRY}\n"
        yield "commit\n"
        while not any("no procedure" in text for text in told):
            sleep(0.01)
        yield "quit\n"

    scenario = load_scenario("resect_auto_small", [*SMALL, "duration=8.0"])
    file, out = tmp_path / "s.session", tmp_path / "out"
    seen = operate(scenario, file, out, listened(typed(), 100.0, told.append), False)
    assert not seen.error and seen.simulated < 8.0
    assert told[1].startswith("> commit\ncommitted")
    assert any("it waits: no procedure is chosen" in text for text in told)
    again = simulate(load_scenario(str(out / "scenario.yaml")))
    for name, column in seen.signals.items():
        np.testing.assert_array_equal(column, again.signals[name], err_msg=name)
    assert [row["line"] for row in again.metrics["choices"]][-1] == "end"


def test_on_a_page_it_is_the_same_lines(tmp_path):
    """Sliders and buttons while the robot works, as lines that play back."""
    case = prepare(
        load_scenario("resect_auto_small", [*SMALL, "duration=5.0", "choices=''"])
    )
    desk = OnlineDesk(case, tmp_path / "s.session", start_meshcat(), 0.0)
    desk.want("move", {"kind": "entry", "length": 8.0, "radius": 5.5})
    desk.want("move", {"clipped": True})
    for line in ("commit", "list", "quit"):
        desk.want("line", line)
    desk.want("stop", None)
    seen = simulate(case)
    desk.close()
    assert not seen.error and desk.show["robot"].endswith(", entry")
    assert seen.plan.waiting.reason[-1] == Wait.TOLD  # the way home is not begun
    said = [line for line, _ in desk.log]
    assert said == ["entry 8 5.5 clipped", "commit", "list", "end", "stop"]
    assert desk.log[-1][1] == "no further step is begun"
    assert len(case.session.steps) == 2
    again = online(tmp_path / "c.csv", case.choosing.lines, "duration=5.0")
    assert [row["line"] for row in again.metrics["choices"]] == said
    for name, column in seen.signals.items():
        np.testing.assert_array_equal(column, again.signals[name], err_msg=name)


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
