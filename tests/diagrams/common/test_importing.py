"""`trocar import`, from other people's files to scenarios that load."""

import numpy as np
import pytest

from diagrams.common.arguments import IMPORTED
from diagrams.common.cli import main
from diagrams.common.importing import KINDS
from diagrams.studies import load_scenario
from plants.surgeon.recording import load_recording
from tests.plants.abdomen.test_breathing_curve import belt
from tests.plants.crowd.test_recorded_crowd import obsmat
from tests.plants.surgeon.test_foreign import sequence, table


def test_the_command_line_knows_all_kinds():
    assert IMPORTED == KINDS


def test_a_da_vinci_table_becomes_an_obstacles_recording(tmp_path, capsys):
    np.savetxt(tmp_path / "knot.txt", table(90))
    out = tmp_path / "knot.csv"
    place = ["--place", "0.01,0,-0.1", "--yaw", "90", "--arm", "slave_left"]
    file = str(tmp_path / "knot.txt")
    assert main(["import", file, "--kind", "jigsaws", "--out", str(out), *place]) == 0
    told = capsys.readouterr().out
    assert "90 samples over 2.97 s, 30.0 a second" in told and "extent" in told
    times, points = load_recording(out)
    np.testing.assert_allclose(points.mean(axis=0), [0.01, 0.0, -0.1], atol=1e-6)
    assert times[-1] == pytest.approx(89 / 30, abs=1e-4)
    load_scenario("gauze_static", [f"obstacle.recording={out}"])


def test_gaps_go_to_the_tracker(tmp_path, capsys):
    frames = [
        (0.1 * k, 0.5 * k, "OK" if k not in (5, 6, 7) else "INVALID") for k in range(30)
    ]
    sequence(tmp_path / "a.igs.mha", frames)
    out = tmp_path / "a.csv"
    file = str(tmp_path / "a.igs.mha")
    assert main(["import", file, "--kind", "plus", "--out", str(out)]) == 0
    use = capsys.readouterr().out.splitlines()[-1]
    assert use.endswith('--set "tracker.losses=[{start: 0.400, end: 0.800}]"')
    losses = use.split('"')[1]
    scenario = load_scenario("gauze_static", [f"obstacle.recording={out}", losses])
    assert scenario.tracker.losses[0].end == pytest.approx(0.8)


def test_a_breath_becomes_the_walls(tmp_path, capsys):
    belt(tmp_path / "bio.csv", 60)
    out = tmp_path / "breath.csv"
    file = str(tmp_path / "bio.csv")
    arguments = ["--kind", "breathing", "--arm", "RSP", "--out", str(out)]
    assert main(["import", file, *arguments]) == 0
    assert "60.0 s, 15.0 breaths a minute" in capsys.readouterr().out
    load_scenario("pwe_arc", [f"wall_motion.curve={out}"])


def test_a_crowd_becomes_a_scenario(tmp_path, capsys):
    obsmat(tmp_path / "obsmat.txt")
    out = tmp_path / "crowd.yaml"
    file = str(tmp_path / "obsmat.txt")
    arguments = ["--kind", "crowd", "--duration", "11", "--out", str(out)]
    assert main(["import", file, *arguments]) == 0
    assert capsys.readouterr().out == f"2 people\ntrocar run {out}\n"
    assert len(load_scenario(str(out)).obstacles) == 2


def test_bad_input_is_one_line(tmp_path, capsys):
    (tmp_path / "x").write_text("1 2 3\n")
    for kind in IMPORTED:
        assert main(["import", str(tmp_path / "x"), "--kind", kind]) == 2
        assert main(["import", str(tmp_path / "none"), "--kind", kind]) == 2
    assert main(["import", str(tmp_path / "x"), "--kind", "csv", "--place", "1,2"]) == 2
    lines = capsys.readouterr().err.splitlines()
    assert all(line.startswith("trocar: error: ") for line in lines)
    assert len(lines) == 2 * len(IMPORTED) + 1
