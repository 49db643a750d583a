"""Resections end to end."""

from dataclasses import replace
import json
import signal
import subprocess
import sys
import time
from types import SimpleNamespace

import numpy as np
import pytest

from diagrams.common.cli import main
from diagrams.common.replay import start_meshcat
from diagrams.common.run import prepare, run_scenario, simulate
from diagrams.common.scenario import ScenarioError
from diagrams.resection import replay
from diagrams.resection.metrics import times_of
from diagrams.studies import build, load_scenario
from plants.tissue.execution import Execution, load_execution, save_execution
from systems.common.archive import beside
from systems.resection.planning.procedure import Procedure
from systems.resection.planning.reach import load_reach, save_reach
from tests import runs

SMALL = ["spacing=0.001", "reach_effort=0.25"]
"""Of `resect_auto_small`: what a minute allows."""
COARSE = [*SMALL, "planner.target=0.5", "planner.candidates=4"]


@pytest.fixture(scope="module")
def paper(tmp_path_factory):
    out = tmp_path_factory.mktemp("paper")
    scenario = load_scenario("resect_paper", ["spacing=0.001", "reach_effort=0.05"])
    return run_scenario(scenario, out), out


def test_paper(paper):
    run, out = paper
    m = run.metrics
    assert not run.error
    assert m["procedures"] == 4 and m["refusals"] == []
    assert m["mask_volume"] is None  # synthetic
    assert 0.4 < m["resected_fraction"] < 0.7
    volumes = m["cap_volume"], m["channel_volume"], m["tumour_volume"]
    assert 0.0 < volumes[0] < 0.06 * volumes[2] and volumes[1] > 0.0
    assert m["body_collisions"] == 0
    assert m["healthy_removed"] <= 1.001e-9  # a voxel, of 1 mm here
    assert m["max_tool_error"] < 0.1e-3
    assert m["resected_fraction"] == pytest.approx(m["planned_fraction"], abs=0.01)
    assert json.loads((out / "metrics.json").read_text())["procedures"] == 4
    assert (out / "replay.html").stat().st_size < 15e6
    for name in ("figure8.png", "report.png"):
        assert (out / name).stat().st_size > 50_000


def test_two_procedures_of_figure_8_have_axes_of_their_own(paper):
    """Modules 1 and 2 bend in them, as the paper's elementary procedures need."""
    session = paper[0].case.session
    tilted = [s for s in session.steps if s.kind == "elementary"]
    assert len(tilted) == 2
    for step in tilted:
        x, y, z = step.procedure.axis()
        assert np.arctan2(np.hypot(x, y), z) > np.deg2rad(9.5)
        bends = session.postures[step.first : step.last]
        beta_1, beta_2 = np.abs(bends[:, 2]), np.abs(bends[:, 4])
        print(beta_1.max(), beta_2.max())
        assert np.median(beta_1) > 1e-3 and np.median(beta_2) > 1e-3


def test_carving_keeps_up(paper):
    """Each instant carves what was swept since the one before: a few stamps."""
    run, _ = paper
    instants = run.tissue.index.number
    assert instants[-1] == round(run.simulated / run.scenario.period)
    carved, way = np.diff(instants), np.diff(run.tissue.way.length)
    assert carved.min() >= 4 and carved.max() <= 6  # in 0.1 s
    assert (way / carved).max() <= 4 * run.scenario.carver.pitch


def test_a_case_runs_the_same_once_more(paper):
    run, _ = paper
    case = run.case
    case.scenario.duration, whole = 3.0, case.scenario.duration
    again = simulate(case)
    case.scenario.duration = whole
    assert again.case is case
    for name, column in again.signals.items():
        before = run.signals[name][: len(column)]  # with more frames, of its replay
        np.testing.assert_allclose(column, before, rtol=1e-9, atol=1e-12)


def wires(diagram):
    """All wires of a diagram, by the names of systems and ports."""
    return {
        (
            sink.get_name(),
            sink.get_input_port(port).get_name(),
            source.get_name(),
            source.get_output_port(index).get_name(),
        )
        for (sink, port), (source, index) in diagram.connection_map().items()
    }


def test_a_diagram_needs_no_plan(paper, monkeypatch):
    def planning(*_, **__):
        raise AssertionError("a diagram that plans")

    for name in ("find_reach", "load_reach", "load_session", "propose_access"):
        monkeypatch.setattr(f"diagrams.resection.operation.{name}", planning)
    monkeypatch.setattr("diagrams.resection.operation.Planner.run", planning)
    planned = paper[0].diagram.GetSubsystemByName("station")
    for name in ("resect_auto_large", "resect_mask", "resect_paper"):
        diagram = build(load_scenario(name))
        assert wires(diagram) == wires(planned)
        player = diagram.GetSubsystemByName("procedure_player")
        assert len(player.times) == 1  # at home
        carver = diagram.GetSubsystemByName("tissue_carver")
        assert carver.carving.volume.labels.size < 50_000  # a stand-in, made at once


def test_refused():
    run = runs.run("resect_refused", "spacing=0.001", "reach_effort=0.05")
    m = run.metrics
    assert [refusal["reason"] for refusal in m["refusals"]] == [
        "tool outside",
        "never freed",
        "freed too late",
        "limit",
        "jam",
        "critical",
    ]
    for refusal in m["refusals"]:
        assert refusal["where"] and refusal["gap"] >= 0.0 and refusal["text"]
    assert m["resected_fraction"] == 0.0 and m["procedures"] == 0
    assert m["path_length"] < 1e-4


@pytest.fixture
def session_file(tmp_path):
    """A session's file to be, with what can be reached of `SMALL` beside it."""
    case = runs.run("resect_auto_small", *SMALL).case
    file = tmp_path / "s.session"
    save_reach(beside(file, "reach"), case.reach, case.session, 1, 0.25)
    return file


def test_auto_resumes_after_being_killed(session_file):
    """A plan cut off goes on from its file, and ends with all that it had."""
    scenario = load_scenario("resect_auto_small", [*COARSE, f"session={session_file}"])
    first = prepare(scenario).session
    steps = [step.name for step in first.steps]
    scenario.planner.target = 0.95
    again = prepare(scenario).session
    assert [step.name for step in again.steps][: len(steps)] == steps
    assert again.fraction > first.fraction


@pytest.mark.parametrize(
    "overrides", [SMALL, pytest.param([], marks=pytest.mark.study)]
)
def test_auto_small(overrides):
    run = runs.run("resect_auto_small", *overrides)
    m = run.metrics
    assert not run.error and run.simulated < 1200.0
    assert m["reachable_fraction"] >= 0.80
    assert m["resected_fraction"] >= 0.98 * m["reachable_fraction"]
    assert m["healthy_removed"] <= 0.01 * m["tumour_volume"]
    assert m["max_outside_depth"] <= 1e-3
    assert m["body_collisions"] == 0


def test_the_replay_shows_the_ball_that_is_carried():
    tiny = ["spacing=0.002", "tumour.length=0.024", "automatic=false"]
    tiny += ["reach_effort=0.005", "balls.time=1.0"]
    case = prepare(load_scenario("resect_auto_small", tiny))
    case.session.commit(Procedure("entry", length=0.002, radius=0.0055, clipped=True))
    case.session.change_tool(0.003)
    meshcat = start_meshcat()
    run = simulate(case, meshcat)
    assert not run.error and run.simulated > case.scenario.balls.time
    times = times_of(run) / run.replay_speed
    change = times[case.session.tools[0].time]
    told: list[tuple] = []
    stand_in = SimpleNamespace(
        frame=lambda time: time, SetProperty=lambda *said: told.append(said)
    )
    scene = SimpleNamespace(SetObject=lambda path, shape, rgba: told.append(path))
    replay._tools(scene, stand_in, run)
    ball, *shown = told
    assert ball == "scene/snake/tool/ball1"
    assert (0.0, ball, "visible", False) in shown
    assert (change, ball, "visible", True) in shown
    first = {path for _, path, _, on in shown if path != ball}
    assert len(first) == 21  # the ball that the ring sweeps, and the ring's pieces
    assert all((change, path, "visible", False) in shown for path in first)
    assert all(meshcat.HasPath(path) for path in [ball, *first])


@pytest.mark.study
def test_auto_large():
    run = simulate(load_scenario("resect_auto_large"))
    m = run.metrics
    assert 60e-6 <= m["tumour_volume"] <= 90e-6
    assert m["reachable_fraction"] >= 0.93
    assert m["resected_fraction"] >= 0.98 * m["reachable_fraction"]
    assert m["healthy_removed"] <= 0.005 * m["tumour_volume"]
    assert m["max_outside_depth"] <= 1e-3
    assert m["body_collisions"] == 0
    assert m["min_critical_distance"] >= run.scenario.margin


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("mask=none.nrrd", "a file that is there"),
        ("spacing=0.0", "spacing=0.0 m: expected >= 0.0001"),
        ("tumour.length=0.5", "tumour.length=0.5 m: expected >= 0.005 and <= 0.1"),
        ("access.direction=[0, 0, 0]", "expected a direction"),
        ("planner.target=2.0", "planner.target=2.0"),
        ("procedures=[{kind: entri}]", "kind='entri'.*did you mean 'entry'"),
        ("procedures=[{radius: 0.003}]", r"procedures\[0\].radius=0.003 m: expected"),
        ("carver.pitch=0.1", "carver.pitch=0.1 m: expected"),
        ("carver.period=1e-12", "carver.period=1e-12 s: expected"),
        ("watch.least=0.0", "watch.least=0.0 N: expected > 0"),
    ],
)
def test_bad_input(override, message):
    with pytest.raises(ScenarioError, match=message):
        load_scenario("resect_paper", [override])


def test_console(tmp_path, monkeypatch, capsys):
    lines = [
        "entry 20 5\n",
        "commit\n",
        "entry 20\n",
        "elementary 0 0 30 0 0 1 4 6\n",
        "list\n",
        f"save {tmp_path / 'p.json'}\n",
        "undo\n",
        f"load {tmp_path / 'p.json'}\n",
        "suggest\n",
        "commit\n",
        "load none.json\n",
        "nonsense\n",
        "quit\n",
    ]

    class Lines(list):
        def isatty(self):
            return False

    monkeypatch.setattr("sys.stdin", Lines(lines))
    file = tmp_path / "s.session"
    assert main(["resect", "resect_paper", "--session", str(file)]) == 0
    out = capsys.readouterr().out
    assert "feasible: removes" in out and "committed" in out
    assert "entry takes 2 numbers, not 1" in out
    assert "never freed" in out or "tool outside" in out
    assert "took back entry" in out and "undo" in out
    assert "entry: committed" in out and "none.json holds no procedures" in out
    assert "mm along (" in out
    assert out.count("committed") == 3
    assert file.exists()


def test_execution_goes_on_after_being_killed(session_file, tmp_path):
    """What a killed run had removed stays removed, and the next one does the rest."""
    file = session_file
    scenario = load_scenario("resect_auto_small", [*COARSE, f"session={file}"])
    case = prepare(scenario)
    whole = simulate(replace(case, scenario=replace(scenario, session="")))
    command = [sys.executable, "-m", "diagrams", "run", "resect_auto_small"]
    for override in [*COARSE, f"session={file}"]:
        command += ["--set", override]
    executed = beside(file, "executed")
    with subprocess.Popen([*command, "--no-replay", "--out", tmp_path / "o"]) as child:
        while child.poll() is None and not executed.is_file():
            time.sleep(0.02)
        child.kill()
    assert child.returncode == -signal.SIGKILL
    shape = case.session.volume.labels.shape
    done = load_execution(executed, case.session.postures, shape)
    assert 0.0 < done.time < whole.metrics["execution_time"]
    rest = simulate(scenario)
    assert rest.metrics["resumed_at"] == done.time
    for key in ("execution_time", "path_length", "resected_fraction"):
        assert rest.metrics[key] == pytest.approx(whole.metrics[key], rel=0.02)
    assert rest.metrics["body_collisions"] == 0
    again = simulate(scenario)  # nothing is left to do
    assert again.simulated < 1.5
    assert again.metrics["resected_fraction"] == rest.metrics["resected_fraction"]


def test_an_execution_of_another_plan_is_refused(tmp_path):
    file = tmp_path / "s.session"
    scenario = load_scenario(
        "resect_paper", ["spacing=0.001", f"session={file}", "reach_effort=0.05"]
    )
    session = prepare(scenario).session
    postures = session.postures
    done = Execution(posture=5, tau=np.zeros_like(session.volume.tau, np.int32))
    save_execution(beside(file, "executed"), done, postures + 0.1)
    with pytest.raises(ScenarioError, match="is of another plan: move it away"):
        simulate(scenario)
    beside(file, "executed").write_bytes(b"rubbish")
    with pytest.raises(ScenarioError, match="is damaged"):
        simulate(scenario)


def test_the_reachable_part_is_searched_once(session_file, monkeypatch):
    file = session_file
    case = runs.run("resect_auto_small", *SMALL).case
    reach, session = case.reach, case.session
    again = load_reach(beside(file, "reach"), session, 1, 0.25)
    assert again is not None and again.lumps == reach.lumps
    np.testing.assert_array_equal(again.mask, reach.mask)
    assert load_reach(beside(file, "reach"), session, 2, 0.25) is None
    monkeypatch.delattr("diagrams.resection.operation.find_reach")
    scenario = load_scenario("resect_auto_small", [*COARSE, f"session={file}"])
    assert (prepare(scenario).reach.mask >= reach.mask).all()  # a plan may find more
