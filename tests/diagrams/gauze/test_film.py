"""What the endoscope saw, rendered after a run."""

import subprocess

import numpy as np
import pytest

from diagrams.common.run import run_scenario
from diagrams.common.scenario import ScenarioError
from diagrams.gauze import film
from diagrams.studies import load_scenario
from tests.runs import run


def test_a_picture_shows_tissue_and_tools_or_it_is_said_why_not():
    if not film.can_render():
        with pytest.raises(ScenarioError, match="no EGL"):
            film.refuse_without_egl()
        return
    shown = film.Film(run("gauze_organs"), 160, 120)
    first, last = shown.picture(0), shown.picture(200)
    assert first.shape == (120, 160, 3)
    assert first.std() > 10.0
    assert (first != last).any()
    green = last[..., 1].astype(int) - last[..., 0]
    assert (green > 30).sum() > 50  # S, and nothing else, is green
    depth = shown.depth(200)
    assert np.isfinite(depth).any()
    assert 0.01 < np.nanmin(depth) < 0.2


def test_without_egl_it_is_refused_and_not_crashed(monkeypatch):
    def crashes(*told, **more):
        return subprocess.CompletedProcess(told, -11)

    film.can_render.cache_clear()
    monkeypatch.setattr(film.subprocess, "run", crashes)
    with pytest.raises(ScenarioError, match=r"no EGL .* libegl1"):
        film.refuse_without_egl()
    film.can_render.cache_clear()


def test_what_has_no_endoscope_says_so(tmp_path):
    with pytest.raises(ScenarioError, match="snake has no endoscope"):
        run_scenario(load_scenario("snake_circle"), tmp_path, with_film=True)


def test_the_camera_stands_upright():
    X = film.upright(np.zeros(3), np.array([0.6, 0.0, -0.8]))
    assert X.rotation().matrix()[:, 2] == pytest.approx([0.6, 0.0, -0.8])
    assert X.rotation().matrix()[2, 1] < 0.0  # the picture's y leads down
    assert X.rotation().matrix()[2, 0] == pytest.approx(0.0)
