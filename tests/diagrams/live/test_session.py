"""A live session, its sliders moved by the test instead of a hand."""

import json

import numpy as np
import pytest

from diagrams.common.replay import start_meshcat
from diagrams.common.run import simulate
from diagrams.common.scenario import ScenarioError
from diagrams.live.session import FRAME, Session
from diagrams.studies import load_scenario


@pytest.fixture(scope="module")
def meshcat():
    return start_meshcat()


def click(session, name):
    session._clicks[name] -= 1  # as if the page had one click more


@pytest.fixture(scope="module")
def played(meshcat, tmp_path_factory):
    """Two seconds in which a hand moves O, saved."""
    session = Session(load_scenario("gauze_static", seed=4), meshcat)
    for k in range(60):
        if k == 10:
            meshcat.SetSliderValue("obstacle y [mm]", -40.0)
        session.frame()
    folder = tmp_path_factory.mktemp("live")
    return session, session.save(folder), folder


def test_tool_goes_where_the_slider_is(played):
    _, _, folder = played
    path = np.loadtxt(folder / "obstacle_recording.csv", delimiter=",", skiprows=1)
    assert path[-1, 0] == pytest.approx(60 * FRAME, abs=1e-3)
    assert path[-1, 2] == pytest.approx(-0.040, abs=1e-3)
    speeds = np.linalg.norm(np.diff(path[:, 1:], axis=0), axis=1) / FRAME
    assert 0.05 < speeds.max() < 0.16
    assert np.ptp(path[:9, 2]) < 1e-6  # still before


def test_what_was_played_runs_again(played):
    session, scenario, _ = played
    run = simulate(scenario)
    assert run.error == ""
    assert run.simulated == pytest.approx(60 * FRAME)
    assert run.obstacle.shaft.tip[-1, 1] == pytest.approx(-0.040, abs=1e-3)
    # The same robot in the same world, but for the recording's own smoothness.
    assert run.robot.tool.tip[-1] == pytest.approx(session._tip, abs=2e-3)


def test_read_outs_are_what_is(played, meshcat):
    session, _, _ = played
    shown = meshcat.GetSliderValue("> clearance [mm]")
    assert shown == pytest.approx(1e3 * session.port("clearance").min(), abs=0.1)


def test_buttons(meshcat):
    session = Session(load_scenario("gauze_static", seed=4), meshcat)
    session.frame()
    click(session, "pause")
    session.frame()
    assert session.is_paused
    assert session.time == FRAME
    click(session, "pause")
    click(session, "push")
    for _ in range(30):
        session.frame()
    assert not session.is_paused
    gap = np.linalg.norm(
        session.port("obstacle.shaft")[:3] - session.port("robot.tool")[3:]
    )
    click(session, "another seed")
    session.frame()
    assert session.scenario.seed == 5
    assert session.time == FRAME
    again = np.linalg.norm(
        session.port("obstacle.shaft")[:3] - session.port("robot.tool")[3:]
    )
    assert gap < again  # the push had brought O nearer
    click(session, "end and save")
    session.play(10.0)
    assert session.is_over
    assert session.time == FRAME


def test_real_time_is_kept_when_the_machine_can(meshcat):
    session = Session(load_scenario("gauze_static", seed=4), meshcat)
    session.play(0.5, speed=0.5)
    assert session.time == pytest.approx(0.5)
    assert len(session.lag) == 15


def test_other_systems_and_empty_sessions_are_refused(meshcat, tmp_path):
    with pytest.raises(ScenarioError, match="gauze deliveries as yet"):
        Session(load_scenario("nav_one_static"), meshcat)
    session = Session(load_scenario("gauze_static"), meshcat)
    with pytest.raises(ScenarioError, match="before it began"):
        session.save(tmp_path)


def test_command_line(tmp_path, monkeypatch, capsys):
    from diagrams.common.cli import main

    monkeypatch.setattr("webbrowser.open", lambda url: None)
    words = ["live", "gauze_static", "--duration", "0.3", "--speed", "5"]
    assert main([*words, "--out", str(tmp_path)]) == 0
    assert json.loads((tmp_path / "metrics.json").read_text())["system"] == "gauze"
    assert (tmp_path / "replay.html").is_file()
    assert "localhost" in capsys.readouterr().out
    assert main(["live", "gauze_static", "--speed", "0"]) == 2
