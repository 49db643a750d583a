"""What a run leaves: whole files, of one run, whatever breaks."""

from dataclasses import replace
import gc
import json
import os
from pathlib import Path
import socket
import subprocess
import sys
import weakref

import numpy as np
import pytest

from diagrams.common.cli import main
from diagrams.common.log import first_fault
from diagrams.common.replay import MOST_FRAMES, start_meshcat, thinned
from diagrams.common.results import LOCK, results, save_scenario, with_data
from diagrams.common.run import blocks_of, simulate
from diagrams.common.scenario import ScenarioError
from diagrams.studies import STUDIES, build, load_scenario
from systems.common import step_block
from systems.common.archive import whole

HOLD = """
import sys, time
from pathlib import Path
from diagrams.common.results import results
with results(Path(sys.argv[1])):
    print("locked", flush=True)
    time.sleep(60)
"""


def names(folder):
    """What is in a folder."""
    return sorted(p.relative_to(folder).as_posix() for p in folder.rglob("*.*"))


def test_a_file_is_whole_or_not_there(tmp_path):
    path = tmp_path / "signals.csv"
    path.write_text("old")
    with pytest.raises(OSError, match="disk is full"), whole(path) as draft:
        draft.write_text("ne")
        raise OSError("the disk is full")
    assert path.read_text() == "old"
    with whole(path) as draft:
        draft.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert names(tmp_path) == ["signals.csv"]


def test_a_second_run_is_kept_out_until_the_first_is_dead(tmp_path):
    holder = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path)], stdout=subprocess.PIPE, text=True
    )
    assert holder.stdout.readline() == "locked\n"
    with pytest.raises(ScenarioError, match="another run writes to"):
        results(tmp_path).__enter__()
    holder.kill()
    holder.communicate()
    with results(tmp_path) as into, into.file("metrics.json") as draft:
        draft.write_text("{}")
    assert (tmp_path / "metrics.json").read_text() == "{}"


def test_what_an_earlier_run_left_goes_and_nothing_else(tmp_path):
    stranger = tmp_path.parent / "stranger.png"
    for path in (stranger, tmp_path / "mine.png", tmp_path / "metrics.json"):
        path.write_text("")
    with results(tmp_path) as into:
        for name in ("inputs/a.csv", "inputs/b.csv", "speeds.png"):
            with into.file(name) as draft:
                draft.write_text(name)
    with (tmp_path / LOCK).open("a") as stream:
        stream.write("../stranger.png\n\n")
    with results(tmp_path) as into:
        into.clear({(tmp_path / "inputs/b.csv").resolve()})
    assert names(tmp_path) == [LOCK, "inputs/b.csv", "mine.png"]
    assert stranger.exists()


@pytest.mark.parametrize("what", ["measure", "plots"])
def test_the_log_outlives_what_is_made_of_it(what, tmp_path, monkeypatch, capsys):
    def broken(run):
        raise ZeroDivisionError("of nothing")

    study = replace(STUDIES["gauze"], **{what: broken})
    monkeypatch.setattr("diagrams.gauze.study.STUDY", study)
    arguments = ["--duration", "0.2", "--no-replay", "--out", str(tmp_path)]
    assert main(["run", "gauze_static", *arguments]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert lines[-1].startswith("trocar: the run failed: ")
    assert lines[-1].endswith("ZeroDivisionError: of nothing")
    log = np.genfromtxt(tmp_path / "signals.csv", delimiter=",", names=True)
    assert log["time"][-1] == pytest.approx(0.2)
    assert json.loads((tmp_path / "metrics.json").read_text())["duration"] == 0.2


def moved(path, x):
    """A recording of O that hardly moves."""
    path.parent.mkdir(exist_ok=True)
    rows = [f"{0.1 * k},{x},0.02,-0.1" for k in range(20)]
    path.write_text("\n".join(["t,x,y,z", *rows]))
    return path


def test_recordings_are_kept_apart_from_results_and_from_each_other(tmp_path):
    one = moved(tmp_path / "one/signals.csv", 0.01)
    two = moved(tmp_path / "two/signals.csv", -0.01)
    more = f"{{name: other, p_WG: [-0.05, 0.09, 0], recording: {two}}}"
    settings = [f"recording={one}", f"tools=[{more}]"]
    scenario = load_scenario("gauze_static", settings, duration=1.0)
    told = {tool.name: tool.recording for tool in scenario.obstacles}
    assert told == {"obstacle": str(one), "other": str(two)}
    out = tmp_path / "out"
    with results(out) as into:
        saved = save_scenario(scenario, into)
    copies = ["inputs/2/signals.csv", "inputs/signals.csv"]
    assert names(out) == [LOCK, *copies, "scenario.yaml"]
    assert (out / copies[0]).read_text() == two.read_text()
    again = load_scenario(str(saved))  # and into the folder that it lies in
    with results(out) as into:
        save_scenario(again, into)
    assert names(out) == [LOCK, *copies, "scenario.yaml"]
    assert load_scenario(str(saved)) == again


def test_a_header_takes_its_data_along_unless_they_are_elsewhere(tmp_path):
    header, data = tmp_path / "liver.mhd", tmp_path / "liver.raw"
    data.write_bytes(b"12345678")
    for text, parts in (
        ("NDims = 3\nElementDataFile = liver.raw\n", [header, data]),
        ("NDims = 3\nElementDataFile = LOCAL\n", [header]),
    ):
        header.write_text(text)
        assert with_data(header) == parts
    for name in ("../../etc/passwd", "/etc/passwd", "LIST 2D"):
        header.write_text(f"ElementDataFile = {name}\n")
        with pytest.raises(ScenarioError, match="expected one file beside it"):
            with_data(header)


def test_what_is_no_regular_file_is_not_copied(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with results(tmp_path / "out") as into:
        for source in (tmp_path / "pipe", Path("/dev/zero"), tmp_path):
            with pytest.raises(ScenarioError, match="expected a regular file"):
                into.copy(source, "inputs/pipe")


def test_meshcat_listens_on_this_machine_alone():
    meshcat = start_meshcat()
    assert meshcat.web_url().startswith("http://localhost:")
    with socket.socket() as stranger:
        stranger.settimeout(2.0)
        outside = socket.gethostbyname(socket.gethostname())
        if not outside.startswith("127."):
            with pytest.raises(OSError):
                stranger.connect((outside, meshcat.port()))


def test_a_signal_that_is_no_number_is_named():
    time = np.array([0.0, 0.5, 1.0])
    one, two = np.array([0.0, 0.0, np.nan]), np.array([0.0, np.inf, np.nan])
    assert first_fault({"time": time, "one": time}) == ""
    found = first_fault({"time": time, "one": one, "two": two})
    assert found == "signal 'two' is inf at 0.500 s"


def test_a_second_diagram_compiles_nothing(monkeypatch):
    scenario = load_scenario("gauze_static")
    build(scenario)

    def refused(*arguments):
        raise AssertionError("compiled code is never freed")

    monkeypatch.setattr(step_block, "generated", refused)
    assert build(scenario).num_output_ports() > 0


def test_a_long_replay_is_thinned():
    assert thinned(30 * 120) == 1
    assert 30 * 600 / thinned(30 * 600) <= MOST_FRAMES


def test_a_run_that_is_dropped_leaves_no_block_behind():
    result = simulate(load_scenario("gauze_static", duration=0.2))
    blocks = [weakref.ref(block) for block in blocks_of(result.diagram)]
    assert len(blocks) > 5 and all(block() is not None for block in blocks)
    del result
    for _ in range(2):  # the run, and then what it let go
        gc.collect()
    assert all(block() is None for block in blocks)
