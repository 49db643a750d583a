"""A folder of masks, planned: rows, reasons, resumption, page."""

from contextlib import nullcontext
import csv
import json
from pathlib import Path

import numpy as np
import pytest

from diagrams.campaigns.acts import answer, plan
from diagrams.campaigns.run import Ledger
from diagrams.campaigns.store import Store
from diagrams.common.cli import main
from diagrams.common.scenario import ScenarioError
from diagrams.resection.atlas import masks_in, variants_of
from diagrams.resection.export import session_of
from tests.plants.tissue.dicom_files import slices, write, write_seg
from tests.plants.tissue.mask_files import ellipsoid, write_mask

QUICK = (
    *("spacing=0.002", "reach_effort=0.02", "access.direction=[0, 0, -1]"),
    *("entries.directions=2", "entries.finalists=1", "planner.target=0.8"),
)
SIZE = (16, 16, 16)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A mask, a broken one, a segment of DICOM with its CT, and what is no mask."""
    folder = tmp_path_factory.mktemp("masks")
    whole = write_mask(folder / "ball.nrrd", ellipsoid(SIZE))
    (folder / "broken.nrrd").write_bytes(whole.read_bytes()[:200])
    (folder / "LICENSE.txt").write_text("whatever")
    ct = slices(SIZE, (1.0, 1.0, 1.0), np.eye(3), (0.0, 0.0, 0.0))
    write(folder / "ct", ct)
    write_seg(folder / "ct" / "seg", ct, {"GTV": ellipsoid(SIZE)})
    return folder


def command(folder: Path, out: Path, *more: str) -> list[str]:
    told = ["atlas", str(folder), "--out", str(out), "--workers", "1", *more]
    for text in QUICK:
        told += ["--set", text]
    return told


def here(atlas, base, store, client):
    """Plans in this process what is not planned yet."""
    ledger = Ledger(atlas, store)
    for job in atlas.jobs(base, set(ledger.failed)):
        ledger.take(job, answer(plan, job))


def test_atlas(folder, tmp_path, capsys, monkeypatch):
    """Through the engine it takes the processes that the campaigns' tests have."""
    monkeypatch.setattr("diagrams.resection.atlas.cluster", lambda *_: nullcontext())
    monkeypatch.setattr("diagrams.resection.atlas.sample", here)
    out = tmp_path / "o"
    assert main(command(folder, out)) == 0
    said = capsys.readouterr().out
    assert "broken.nrrd" in said and "the file is damaged: its header has no" in said
    with (out / "atlas.csv").open(encoding="utf-8") as stream:
        ball, broken, seg = csv.DictReader(stream)
    assert [r["status"] for r in (ball, broken, seg)] == ["done", "refused", "done"]
    assert seg["mask"] == "ct/seg" and seg["resected_3"] == ball["resected_3"]
    volume = 1e-9 * np.count_nonzero(ellipsoid(SIZE))
    assert float(ball["mask_volume"]) == pytest.approx(volume)
    shares = [float(ball[f"resected_{n}"]) for n in (1, 2, 3)]
    assert 0.6 < shares[0] <= shares[1] <= shares[2] <= 1.0
    assert shares[0] <= float(ball["reachable_1"]) + 1e-9 <= 1.0
    assert 5.0 < float(ball["time_1"]) <= float(ball["time_3"])
    session = session_of(out / "sessions" / "0000-0.session")
    assert session.fraction == pytest.approx(shares[2])
    left = json.loads(ball["unreached"])
    assert all(lump["reason"] and lump["volume"] > 0.0 for lump in left)
    page = (out / "atlas.html").read_text(encoding="utf-8")
    assert page.count("data:image/png") == 3 and "ct/seg" in page
    # Cut off after the first mask it goes on: with rows that are missing, and plans.
    Store(out / "runs", {}).keep(1)
    assert main(command(folder, out)) == 0
    assert capsys.readouterr().out == said
    again = session_of(out / "sessions" / "0002-0.session")
    np.testing.assert_array_equal(again.postures, session.postures)
    assert main(command(folder, out, "--vary", "snake.wires=[3]")) == 2
    assert "snake.wires" in capsys.readouterr().err
    assert main(command(folder, out, "--vary", "snake.tool_radius=[0.003]")) == 2
    assert "belongs to another campaign" in capsys.readouterr().err


def test_what_is_a_mask(folder, tmp_path, capsys):
    names = [str(path.relative_to(folder)) for path in masks_in(folder)]
    assert names == ["ball.nrrd", "broken.nrrd", "ct/seg"]
    assert main(["atlas", str(tmp_path)]) == 2
    assert "has no masks: expected files that end in .nrrd" in capsys.readouterr().err
    assert main(["atlas", str(tmp_path / "none")]) == 2
    assert "expected a folder with masks" in capsys.readouterr().err


def test_robots_that_vary():
    found = variants_of(["snake.a=[1, 2]", "b=[x]"])
    assert found == {
        "snake.a=1, b=x": {"snake.a": 1, "b": "x"},
        "snake.a=2, b=x": {"snake.a": 2, "b": "x"},
    }
    with pytest.raises(ScenarioError, match=r"expected KEY\.SUB=\[VALUE, \.\.\.\]"):
        variants_of(["snake.a=3"])
