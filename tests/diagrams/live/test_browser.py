"""A live session in a real browser: what is done there reaches the robot."""

import time

import numpy as np
import pytest

from diagrams.common.replay import start_meshcat
from diagrams.gauze.live import clearance
from diagrams.live.page import Page
from diagrams.live.session import Session
from diagrams.studies import load_scenario
from systems.common.signals import RobotTool, Shaft


def tip(session):
    return session.read("robot.tool", RobotTool).tip


def control(page, name):
    """The row of a control of Meshcat's, by its label."""
    label = page.locator(".property-name", has_text=name)
    return page.locator("li.cr").filter(has=label).last


def wait(page, until):
    end = time.monotonic() + 60.0
    while not until():
        assert time.monotonic() < end
        page.wait_for_timeout(50)


@pytest.mark.browser
def test_a_slider_moves_a_tool_and_the_robot_gives_way(page, tmp_path):
    meshcat = start_meshcat()
    session = Session(load_scenario("gauze_static", seed=4), Page(meshcat))
    page.goto(meshcat.web_url())
    wait(page, lambda: meshcat.GetNumActiveConnections())
    page.get_by_text("Open Controls").click()
    for _ in range(30):
        session.frame()
    before = tip(session)
    undisturbed = Session(load_scenario("gauze_static", seed=4), None)
    # Where the robot is, and what it has to keep clear of.
    for axis, value in zip("xyz", 1e3 * before, strict=True):
        box = control(page, f"obstacle {axis} [mm]").locator("input")
        box.fill(f"{value:.0f}")
        box.press("Enter")
        wanted = f"obstacle {axis} [mm]"
        wait(page, lambda w=wanted, v=value: abs(meshcat.GetSliderValue(w) - v) < 1.0)
    gaps, aside = [], []
    for _ in range(30):
        undisturbed.frame()
    for _ in range(120):
        session.frame()
        undisturbed.frame()
        gaps.append(clearance(session))
        aside.append(np.linalg.norm(tip(session) - tip(undisturbed)))
    hand = session.read("obstacle.shaft", Shaft).tip
    assert np.linalg.norm(hand - before) < 0.002  # it went where the slider is
    assert max(aside) > 0.01
    assert min(gaps) > 0.0
    # Figures and words are on the page; a button there is pressed.
    wait(page, lambda: page.locator("li.function", has_text=session.words).count())
    shown = control(page, "> clearance [mm]").locator("input")
    wait(page, lambda: abs(float(shown.input_value()) - 1e3 * gaps[-1]) < 2.0)
    control(page, "pause").click()
    wait(page, lambda: session.frame() or session.is_paused)
    page.screenshot(path=tmp_path / "live.png")
    assert (tmp_path / "live.png").stat().st_size > 30_000
