"""Live sessions whose buttons and sliders a test moves, and the runs they play back."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from diagrams.common.replay import start_meshcat
from diagrams.common.run import simulate
from diagrams.connect.address import Address
from diagrams.connect.messages import HEADER
from diagrams.connect.stream import pose, text
from diagrams.live.page import Page
from diagrams.live.session import Session
from diagrams.studies import load_scenario

HERE = Address("localhost", 0)
START = {"seed": 4, "duration": 20.0}


def begin(name: str, *overrides: str) -> Session:
    """A session of a scenario, and its page."""
    return Session(load_scenario(name, overrides, **START), Page(start_meshcat()))


def play(
    session: Session,
    frames: int,
    moves: Mapping[str, float],
    presses: Mapping[int, str],
) -> None:
    """Plays frames; sliders are moved after a third, buttons pressed at a frame."""
    meshcat = session._page.meshcat
    for frame in range(frames):
        if frame == frames // 3:
            for slider, change in moves.items():
                value = meshcat.GetSliderValue(slider)
                meshcat.SetSliderValue(slider, value + change)
        if frame in presses:
            session.press(presses[frame])
        session.frame()
    for name, told in session._live.streamed(session).items():
        is_text = isinstance(told, str)
        message = text(name, told) if is_text else pose(name, HERE, *told)
        assert len(message.pack()) > HEADER


def assert_plays_back(session: Session, port: str, folder: Path) -> Any:
    """What was saved runs again to the same end; returns the run."""
    run = simulate(session.save(folder))
    assert run.error == ""
    columns = [name for name in run.signals if name.startswith(f"{port}.")]
    last = [run.signals[name][-1] for name in columns]
    np.testing.assert_array_equal(last, session.values(port))
    return run
