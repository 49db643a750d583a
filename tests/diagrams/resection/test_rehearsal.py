"""A rehearsal on tissue that yields: rounds, what a scan is for, and when it stops."""

from contextlib import contextmanager
import json

import pytest

from diagrams.common.cli import main
from diagrams.common.progress import silent
from diagrams.resection.rounds import rehearse
from diagrams.studies import load_scenario

QUICK = (
    *("spacing=0.0015", "reach_effort=0.02", "planner.tightenings=0"),
    *("tumour.length=0.022", "shift.most=0.002", "scan.points=800"),
)


def told(*more):
    scenario = load_scenario("resect_auto_small", [*QUICK, *more])
    return rehearse(scenario, silent)


@pytest.fixture(scope="module")
def scanned():
    return told("rehearsal.most=10")


def test_rounds_go_on_until_little_more_goes(scanned):
    rows = scanned.rounds
    assert len(rows) >= 3 and not scanned.stopped
    shares = [row["resected"] for row in rows]
    assert shares == sorted(shares) and shares[-1] > 0.8 * scanned.reachable
    assert rows[-1]["time"] > 60.0 * len(rows)  # scans are waited for
    assert rows[-1]["healthy"] < 0.05
    assert scanned.nearest is None and scanned.way > 0.1


def test_where_nothing_moves_scans_do_no_harm():
    """Of the surface alone; what they show is noise."""
    still = told("shift.most=0.0", "scan.image=false", "rehearsal.most=10")
    assert still.rounds[-1]["resected"] > 0.97 * still.reachable
    assert still.rounds[-1]["healthy"] < 0.01 and still.hits == 0
    assert all(row["error"] < 1e-3 for row in still.rounds[:-1])


def test_killed_in_mid_round_it_goes_on_alike(tmp_path):
    class Killed(BaseException):
        """As by the system, in the third round."""

    @contextmanager
    def killing(what, unit):
        yield lambda done, whole: None
        if what == "round 3":
            raise Killed

    quick = [*QUICK, "rehearsal.most=10", "spacing=0.002"]
    scenario = load_scenario("resect_auto_small", quick)
    one, other = tmp_path / "one" / "state", tmp_path / "other" / "state"
    with pytest.raises(Killed):
        rehearse(scenario, killing, one)
    assert one.is_file()
    went_on = rehearse(scenario, silent, one)
    assert went_on.figures() == rehearse(scenario, silent, other).figures()
    assert len(went_on.rounds) > 3 and not one.is_file()
    with pytest.raises(Killed):
        rehearse(scenario, killing, one)
    another = load_scenario("resect_auto_small", [*quick, "seed=2"])
    with pytest.raises(ValueError, match="other parameters"):
        rehearse(another, silent, one)


def test_it_stops_when_more_moves_than_was_reckoned_with(tmp_path, capsys):
    command = ["rehearse", "resect_auto_small", "--out", str(tmp_path)]
    for text in (*QUICK, "shift.most=0.005", "rehearsal.most=1", "scan.image=false"):
        command += ["--set", text]
    assert main(command) == 1
    said = capsys.readouterr()
    assert "stopped: the tissue moved by" in said.err
    assert "% of the reachable" in said.out
    kept = json.loads((tmp_path / "rehearsal.json").read_text())
    assert kept["stopped"] and kept["rounds"]
    assert (tmp_path / "rehearsal.png").stat().st_size > 10_000
    assert main(["rehearse", "nav_one_static"]) == 2
    assert "is no resection" in capsys.readouterr().err
    assert main([*command, "--set", "shift.most=0.01"]) == 2
    assert "shift.most=0.01 m: expected >= 0 and <= 0.005" in capsys.readouterr().err
