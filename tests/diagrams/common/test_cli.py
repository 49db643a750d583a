"""Tests of the command line: what it writes, prints and refuses."""

import json
from pathlib import Path
import subprocess
import sys

import numpy as np
import pytest

from diagrams.common.cli import COMMANDS, main
from diagrams.common.scenario import scenario_files

SHORT = ["--duration", "0.2", "--no-replay"]


LONG = "9" * 400


def run(*arguments: str) -> int:
    """Runs the command line in this process."""
    return main([*arguments])


def test_scenarios_lists_every_name_with_its_line(capsys):
    assert run("scenarios") == 0
    lines = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in lines] == list(scenario_files())
    assert all(len(line.split()) > 3 for line in lines)


def test_a_run_writes_everything_and_repeats_itself(tmp_path, capsys):
    out = tmp_path / "first"
    code = run("run", "gauze_static", "--out", str(out), "--seed", "3", *SHORT)
    assert code == 0
    assert "min_tool_clearance" in capsys.readouterr().out
    names = {path.name for path in out.iterdir()}
    assert {"metrics.json", "signals.csv", "scenario.yaml"} <= names
    assert sum(name.endswith(".png") for name in names) >= 4
    log = np.genfromtxt(out / "signals.csv", delimiter=",", names=True)
    assert log["time"][-1] == pytest.approx(0.2)
    again = tmp_path / "second"
    code = run("run", str(out / "scenario.yaml"), "--out", str(again), "--no-replay")
    assert code == 0
    assert (again / "signals.csv").read_text() == (out / "signals.csv").read_text()
    other = tmp_path / "other"
    code = run("run", "gauze_static", "--out", str(other), "--seed", "4", *SHORT)
    assert (other / "signals.csv").read_text() != (out / "signals.csv").read_text()


def test_set_changes_what_runs(tmp_path):
    code = run(
        *("run", "gauze_static", "--out", str(tmp_path), *SHORT),
        *("--set", "abdomen.stiffness=800", "--set", "robot.p_WP=[-0.04, 0.0, -0.1]"),
    )
    assert code == 0
    assert "stiffness: 800" in (tmp_path / "scenario.yaml").read_text()
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    assert metrics["reached"] is False
    assert metrics["time_to_target"] is None


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["run", "gauze_statik"], "did you mean 'gauze_static'"),
        (["run", "gauze_static", "--set", "abdomen.stifness=1"], "'stiffness'"),
        (["run", "gauze_static", "--set", "abdomen.stiffness=-5"], "stiffness=-5"),
        (["run", "gauze_static", "--set", "robot.p_WP=[0, 0]"], "expected 3 numbers"),
        (["run", "gauze_static", "--set", "robot.p_WP=[0,0,.nan]"], "finite"),
        (
            ["run", "gauze_static", "--set", "obstacle.p_WG=[0.0, 0.001, 0.0]"],
            "trocars >= 0.02 m apart",
        ),
        (
            ["run", "gauze_static", "--set", "target.points=[[0.1, 0.0, -0.4]]"],
            "within reach through",
        ),
        (
            ["run", "gauze_static", "--set", "camera.p_WS=[0.2, 0.2, -0.1]"],
            "in the camera's view",
        ),
        (["run", "gauze_static", "--set", "recording=nowhere.csv"], "nowhere.csv"),
        (["run", "gauze_static", "--set", "duration=0"], "duration=0"),
        (["run", "gauze_static", "--set", "go_to_target.form=exact"], "corrected"),
        (["run", "gauze_static", "--set", "seed=1.5"], "whole number"),
        (["run", "gauze_static", "--seed", str(2**64)], "seed=18446744073709551616"),
        (["run", "gauze_static", "--set", "tracker={3: 1}"], "'tracker.3'"),
        (["run", "gauze_static", "--set", "system=[gauze]"], "expected 'gauze'"),
        (["run", "gauze_static", "--set", "system=wrist"], "expected 'gauze'"),
        (["run", "gauze_static", "--set", "robot={3: 1}"], "missing key"),
        (["run", "gauze_static", "--set", "tools=[{name: [1]}]"], "with a name"),
        (["run", "gauze_static", "--set", f"duration={LONG}"], "finite number"),
        (["run", "gauze_static", "--set", f"seed={LONG}"], "<= 9.22337e+18"),
        (["run", "pwe_breathing", "--set", "duration=1e9"], "<= 100000"),
        (["run", "pwe_breathing", "--set", "duration=1e5"], "GB"),
        (["diagram", "gauze_static", "--out", "picture.bmp"], ".svg or .png"),
    ],
)
def test_bad_input_gets_one_clear_line(arguments, message, capsys, tmp_path):
    if arguments[0] == "run":
        arguments = [*arguments, "--out", str(tmp_path / "out"), "--no-replay"]
    assert run(*arguments) == 2
    error = capsys.readouterr().err
    assert error.startswith("trocar: error: ")
    assert message in error
    assert error.count("\n") == 1


def test_what_nobody_thought_of_is_one_line_too(monkeypatch, capsys):
    def broken(arguments):
        raise TypeError("unhashable\ntype")

    monkeypatch.setitem(COMMANDS, "run", broken)
    assert main(["run", "gauze_static"]) == 2
    assert capsys.readouterr().err == "trocar: error: TypeError: unhashable type\n"


def test_an_output_folder_that_cannot_be_written(tmp_path, capsys):
    blocked = tmp_path / "file"
    blocked.write_text("in the way")
    assert run("run", "gauze_static", "--out", str(blocked / "out"), *SHORT) == 2
    assert "cannot write to the output folder" in capsys.readouterr().err


def test_diagram_is_drawn(tmp_path):
    picture = tmp_path / "diagram.svg"
    assert run("diagram", "gauze_static", "--out", str(picture)) == 0
    text = picture.read_text()
    for block in ("go_to_target", "fuzzy_arbiter", "joint_commands", "plant"):
        assert block in text


def test_the_module_is_the_command_line_and_teaches():
    done = subprocess.run(
        [sys.executable, "-m", "diagrams", "--help"],
        capture_output=True,
        text=True,
        check=True,
        cwd=Path(__file__).parents[3],
    )
    assert "trocar run gauze_dynamic" in done.stdout


def test_a_run_that_breaks_keeps_what_it_has(tmp_path, monkeypatch):
    from diagrams.common.run import run_scenario
    from diagrams.studies import load_scenario
    from systems.motion.joint_commands import JointCommands

    follow = JointCommands._calc_next

    def broken(self, context):
        if context.get_time() > 0.3:
            raise RuntimeError("the arm fell off")
        return follow(self, context)

    monkeypatch.setattr(JointCommands, "_calc_next", broken)
    scenario = load_scenario("gauze_static", duration=1.0)
    run = run_scenario(scenario, tmp_path, with_replay=False)
    assert "the arm fell off" in run.error
    log = np.genfromtxt(tmp_path / "signals.csv", delimiter=",", names=True)
    assert 0.2 < log["time"][-1] < 0.4
    metrics = json.loads((tmp_path / "metrics.json").read_text())
    assert "the arm fell off" in metrics["error"]


def test_an_interruption_before_the_run_is_no_traceback(monkeypatch, capsys):
    def interrupted(arguments):
        raise KeyboardInterrupt

    monkeypatch.setitem(COMMANDS, "run", interrupted)
    assert main(["run", "gauze_static"]) == 130
    assert "interrupted before the run began" in capsys.readouterr().err


@pytest.fixture(scope="module")
def two_runs(tmp_path_factory):
    """A folder with the results of two short runs."""
    folder = tmp_path_factory.mktemp("runs")
    run("run", "gauze_sta*", "nav_one_static", "--out", str(folder), *SHORT)
    run("run", "gauze_static", "--seed", "5", "--out", str(folder / "5"), *SHORT)
    return folder


def test_several_scenarios_and_patterns_each_get_a_folder(two_runs):
    for name in ("gauze_static", "nav_one_static"):
        made_by = json.loads((two_runs / name / "provenance.json").read_text())
        assert made_by["drake"]
        assert made_by["commit"]
        page = (two_runs / name / "report.html").read_text()
        assert "data:image/png;base64" in page
        assert f"<h1>{name}</h1>" in page


def test_pattern_without_a_match_is_refused(capsys):
    assert run("run", "gaze_*") == 2
    assert "no scenario matches 'gaze_*'" in capsys.readouterr().err


def test_figures_for_people_and_for_programs(tmp_path, capsys):
    assert run("run", "nav_one_static", "--out", str(tmp_path), *SHORT, "--json") == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["system"] == "navigation"
    assert isinstance(figures["min_clearance"], float)


def test_compare_marks_what_differs(two_runs, tmp_path, capsys):
    one, other = two_runs / "gauze_static", two_runs / "5"
    picture = tmp_path / "compare.png"
    assert run("compare", str(one), str(other), "--out", str(picture)) == 0
    lines = capsys.readouterr().out.splitlines()
    assert next(x for x in lines if x.split()[:1] == ["seed"]).endswith("*")
    assert not next(x for x in lines if x.split()[:1] == ["contact"]).endswith("*")
    assert picture.stat().st_size > 10_000


def test_compare_and_replay_need_results(tmp_path, capsys):
    assert run("compare", str(tmp_path), str(tmp_path)) == 2
    assert "holds no results" in capsys.readouterr().err
    assert run("replay", str(tmp_path)) == 2
    assert "no such file" in capsys.readouterr().err


def test_replay_opens_the_browser(tmp_path, monkeypatch):
    opened = []
    monkeypatch.setattr("webbrowser.open", opened.append)
    (tmp_path / "replay.html").write_text("<html></html>")
    assert run("replay", str(tmp_path)) == 0
    assert opened == [(tmp_path / "replay.html").as_uri()]


def test_completion_and_version(capsys):
    assert run("completion", "bash") == 0
    assert "campaign" in capsys.readouterr().out
    with pytest.raises(SystemExit):
        main(["--version"])
    assert capsys.readouterr().out.startswith("trocar 0.")
