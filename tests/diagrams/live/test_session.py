"""A live session, its sliders moved by the test instead of a hand."""

from dataclasses import replace
import json
from types import SimpleNamespace

import numpy as np
import pytest

from diagrams.common.replay import start_meshcat
from diagrams.common.run import simulate
from diagrams.common.scenario import ScenarioError
from diagrams.gauze.live import clearance
from diagrams.live.page import OTHER, Page
from diagrams.live.session import NEVER, Session, spans
from diagrams.studies import get_study, load_scenario
from systems.common.signals import RobotTool, Shaft

FRAME = get_study("gauze").live.frame


@pytest.fixture(scope="module")
def meshcat():
    return start_meshcat()


class Pressed(Page):
    """A page with a gamepad that the test holds, and more buttons pressed."""

    held = SimpleNamespace(index=None, button_values=[0.0] * 16, axes=[0.0] * 4)

    def __init__(self, meshcat):
        super().__init__(meshcat)
        self.more = []

    def clicked(self):
        """What was pressed."""
        more, self.more = self.more, []
        return super().clicked() + more

    def move_by_gamepad(self, elapsed):
        """By the one that is held."""
        page = self.meshcat
        self.meshcat = SimpleNamespace(
            GetGamepad=lambda: self.held,
            GetSliderValue=page.GetSliderValue,
            SetSliderValue=page.SetSliderValue,
        )
        super().move_by_gamepad(elapsed)
        self.meshcat = page


@pytest.fixture
def page(meshcat):
    return Pressed(meshcat)


def robot(session):
    return session.read("robot.tool", RobotTool).tip


@pytest.fixture(scope="module")
def played(meshcat, tmp_path_factory):
    """Two seconds in which a hand moves O and everything fails, saved."""
    page = Pressed(meshcat)
    session = Session(load_scenario("gauze_breathing", seed=4), page)
    for k in range(120):
        if k == 20:
            meshcat.SetSliderValue("obstacle y [mm]", -40.0)
        if k == 50:
            page.more = ["cough", "wrong fulcrum"]
        if k in (70, 85):
            page.more = ["lose sight"]
        session.frame()
    shown = meshcat.GetSliderValue("> clearance [mm]")
    folder = tmp_path_factory.mktemp("live")
    return session, session.save(folder), folder, shown


def test_tool_goes_where_the_slider_is(played):
    session, _, folder, _ = played
    path = np.loadtxt(folder / "obstacle_recording.csv", delimiter=",", skiprows=1)
    assert path[:, 0] == pytest.approx([0.0, 20 * FRAME])
    assert path[1, 2] == pytest.approx(-0.040)
    tip = session.read("obstacle.shaft", Shaft).tip
    assert tip[1] == pytest.approx(-0.040, abs=1e-3)


def test_what_was_played_runs_again(played):
    session, scenario, _, _ = played
    run = simulate(scenario)
    assert run.error == ""
    assert run.simulated == pytest.approx(120 * FRAME)
    # The same run, to the last digit.
    np.testing.assert_array_equal(run.robot.tool.tip[-1], robot(session))
    # What failed is in it.
    kinds = [fault.kind for fault in scenario.faults if fault.start < NEVER]
    assert kinds == ["frame_lost", "fulcrum_aside"]
    assert scenario.faults[0].duration == pytest.approx(1.75)
    assert len(scenario.wall_motion.irregular.coughs) == 1
    speeds = np.linalg.norm(run.obstacle.tip_velocity.v, axis=1)
    assert 0.03 < speeds.max() < 0.16
    wall = run.wall.fulcrum.p[:, 2]
    after = run.signals["time"] > 50 * FRAME + 0.05
    assert wall[after].max() - wall[~after].max() > 0.003


def test_figures_are_what_is(played):
    session, _, _, shown = played
    assert shown == pytest.approx(1e3 * clearance(session), abs=0.1)
    assert "lost by the tracker" in session.words


def test_buttons(page):
    session = Session(load_scenario("gauze_static", seed=4), page)
    session.frame()
    page.more = ["pause"]
    session.frame()
    assert session.is_paused
    assert session.time == FRAME
    page.more = ["pause", "push"]
    for _ in range(60):
        session.frame()
    assert not session.is_paused

    def gap():
        tip = session.read("obstacle.shaft", Shaft).tip
        return np.linalg.norm(tip - robot(session))

    near = gap()
    page.more = ["another seed"]
    session.frame()
    assert session.scenario.seed == 5
    assert session.time == FRAME
    assert near < gap()  # the push had brought O nearer
    page.more = ["end and save"]
    session.play(10.0)
    assert session.is_over
    assert session.time == FRAME


def test_a_gamepad_moves_what_is_guided(page, meshcat):
    session = Session(load_scenario("gauze_static", seed=4), page)
    names = ["obstacle x [mm]", "obstacle y [mm]", "target x [mm]"]
    before = [meshcat.GetSliderValue(name) for name in names]
    page.held = SimpleNamespace(
        index=0, button_values=[0.0] * 16, axes=[0.1, -1.0, 0.0, 0.0]
    )
    for _ in range(15):
        session.frame()
    page.held.button_values[OTHER], page.held.axes = 1.0, [0.5, 0.0, 0.0, 0.0]
    for _ in range(15):
        session.frame()
    moved = [
        meshcat.GetSliderValue(name) - value
        for name, value in zip(names, before, strict=True)
    ]
    # Up is more y; rest is rest; with the button held it is the other tool.
    assert moved == pytest.approx([0.0, 32.0, 16.0], abs=8.0)
    assert moved[0] == 0.0


def test_what_lasts_goes_on():
    assert spans([1.0, 1.5, 4.0], 1.0) == [(1.0, 2.5), (4.0, 5.0)]


def test_real_time_is_kept_when_the_machine_can(page):
    session = Session(load_scenario("gauze_static", seed=4), page)
    session.play(0.5, speed=0.5)
    assert session.time == pytest.approx(0.5)
    assert len(session.lag) == 30


@pytest.mark.parametrize(("late", "lost"), [(0.04, 0.0), (0.2, 0.15)])
def test_a_late_frame_is_made_up_for_but_not_a_long_one(page, monkeypatch, late, lost):
    session = Session(load_scenario("gauze_static", seed=4), page)
    frame, now = session._live.frame, [10.0]

    def step():
        session.time += frame
        now[0] += late + frame if session.time == pytest.approx(2 * frame) else 0.0

    monkeypatch.setattr(session, "frame", step)
    monkeypatch.setattr("diagrams.common.pace.perf_counter", lambda: now[0])
    monkeypatch.setattr(
        "diagrams.live.session.sleep", lambda time: now.__setitem__(0, now[0] + time)
    )
    session.play(20 * frame)
    assert now[0] - 10.0 == pytest.approx(20 * frame + lost)
    assert max(session.lag) == pytest.approx(late) and session.lag[-1] == 0.0


def test_other_systems_and_empty_sessions_are_refused(page, tmp_path, monkeypatch):
    session = Session(load_scenario("gauze_static"), page)
    with pytest.raises(ScenarioError, match="before it began"):
        session.save(tmp_path)
    without = replace(get_study("gauze"), live=None)
    monkeypatch.setattr("diagrams.live.session.get_study", lambda name: without)
    with pytest.raises(ScenarioError, match="system='gauze': expected one of gauze"):
        Session(load_scenario("gauze_static"), page)


def test_command_line(tmp_path, monkeypatch, capsys):
    from diagrams.common.cli import main

    monkeypatch.setattr("webbrowser.open", lambda url: None)
    words = ["live", "gauze_static", "--duration", "0.3", "--speed", "5"]
    assert main([*words, "--out", str(tmp_path)]) == 0
    assert json.loads((tmp_path / "metrics.json").read_text())["system"] == "gauze"
    assert (tmp_path / "replay.html").is_file()
    assert "localhost" in capsys.readouterr().out
    assert main(["live", "gauze_static", "--speed", "0"]) == 2
