"""Campaigns on a real scheduler and real workers, killed and begun again."""

from contextlib import ExitStack, contextmanager
from dataclasses import replace
import os
import random
import signal
import subprocess
import sys
import threading
import time

import pandas
import pytest

from diagrams.campaigns import engine
from diagrams.campaigns import run as running
from diagrams.campaigns.campaign import Campaign, StopParams, load_campaign
from diagrams.campaigns.engine import cluster
from diagrams.campaigns.report import write_report
from diagrams.campaigns.run import Interrupted, run_campaign
from diagrams.campaigns.splitting import SplittingParams
from diagrams.campaigns.store import HEAD, Store, schema
from diagrams.common.cli import main
from diagrams.common.scenario import ScenarioError

ACT = "tests.diagrams.campaigns.poison:act"
SLOW = Campaign(
    act=ACT,
    runs=120,
    fixed={"do": "slow"},
    vary={"x": {"uniform": [0.0, 1.2]}},
    variants={"one": {}, "two": {"y": 1}},
    fail=["x > 1"],
    worst="-x",
)


def content(out):
    return (out / "runs" / "000000.parquet").read_bytes()


@pytest.fixture(scope="module")
def begun():
    """As `cluster`, but one of a single worker is begun once for all who ask."""
    with ExitStack() as stack:
        found = []

        @contextmanager
        def one(workers, scheduler=""):
            assert workers == 1 and not scheduler
            if not found:
                found.append(stack.enter_context(cluster(1)))
            yield found[0]

        yield one


@pytest.fixture
def one_cluster(begun, monkeypatch):
    """For tests that are of something else than how clusters begin and end."""
    monkeypatch.setattr(running, "cluster", begun)


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory, begun):
    out = tmp_path_factory.mktemp("campaign")
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(running, "cluster", begun)
        run_campaign(SLOW, out, workers=1)
    return out


def test_rows_are_what_was_drawn(undisturbed):
    runs = pandas.read_parquet(undisturbed / "runs")
    assert len(runs) == 240
    assert (runs.status == "done").all()
    assert ((runs.x > 1) == (runs.failed == "x > 1")).all()
    one, two = (runs[runs.variant == name] for name in ("one", "two"))
    assert (one.x.to_numpy() == two.x.to_numpy()).all()  # the same draws
    assert (one.share.to_numpy() != two.share.to_numpy()).any()
    assert 0.1 < (one.x > 1).mean() < 0.25


def test_a_figure_called_as_a_column_leaves_that_as_it_is():
    columns = schema({"seed": 1, "run": 0.5, "x": 2})
    assert str(columns.field("seed").type) == "int64"
    assert columns.names.count("seed") == columns.names.count("run") == 1


def test_many_parts_become_one(tmp_path):
    store = Store(tmp_path, {"x": 0.5})
    for run in range(230):
        store.add(
            {**dict.fromkeys(HEAD, ""), "run": run, "seed": run}, {"x": 0.1 * run}
        )
        store.flush()
    assert len(list(tmp_path.glob("*.parquet"))) < 103
    assert store.done() == {(run, "") for run in range(230)}
    store.compact()
    assert [row["x"] for row in store.rows()] == [0.1 * run for run in range(230)]


def test_number_of_workers_makes_no_difference(undisturbed, tmp_path):
    run_campaign(SLOW, tmp_path, workers=2)
    assert content(tmp_path) == content(undisturbed)


@pytest.mark.parametrize("most", [1, pytest.param(10, marks=pytest.mark.study)])
def test_workers_killed_at_random_make_no_difference(
    undisturbed, tmp_path, monkeypatch, most
):
    dice, killed = random.Random(1), []

    def kill(client):
        while len(killed) < most:
            time.sleep(dice.uniform(0.05, 0.4))
            pids = client.run(os.getpid).values() if client.status == "running" else ()
            for pid in list(pids)[:1]:
                os.kill(pid, signal.SIGKILL)
                killed.append(pid)

    def disturbed(*args):
        context = cluster(*args)

        class Disturbed:
            def __enter__(self):
                client = context.__enter__()
                self.killer = threading.Thread(target=kill, args=[client], daemon=True)
                self.killer.start()
                return client

            def __exit__(self, *error):
                return context.__exit__(*error)

        return Disturbed()

    monkeypatch.setattr(running, "cluster", disturbed)
    run_campaign(SLOW, tmp_path, workers=2)
    assert killed
    assert content(tmp_path) == content(undisturbed)


@pytest.mark.parametrize("most", [1, pytest.param(10, marks=pytest.mark.study)])
def test_campaign_killed_and_resumed_is_the_same(
    undisturbed, tmp_path, one_cluster, most
):
    """Once as soon as something was kept, or often and at any moment."""
    script = (
        "from tests.diagrams.campaigns.test_run import SLOW;"
        "from diagrams.campaigns import run; from pathlib import Path;"
        "run._FLUSH = 0.1;"
        f"run.run_campaign(SLOW, Path({str(tmp_path)!r}), 1)"
    )
    dice, kills = random.Random(2), 0
    for _ in range(most):
        process = subprocess.Popen(
            [
                sys.executable,
                "-c",
                f"""
if __name__ == '__main__':
    {script}
""",
            ],
            cwd=os.getcwd(),
            start_new_session=True,
        )
        try:
            while most == 1 and not (kept := list(tmp_path.glob("runs/*.parquet"))):
                assert process.poll() is None
                time.sleep(0.02)
            process.wait(dice.uniform(0.0, 0.5) if most == 1 else dice.uniform(3, 6))
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
            kills += 1
        else:
            break
    assert kills
    if most == 1:
        assert kept and 0 < len(Store(tmp_path / "runs", {}).done()) < 240
    run_campaign(SLOW, tmp_path, workers=1)
    assert content(tmp_path) == content(undisturbed)


def test_poisoned_runs_are_named_and_the_rest_is_done(tmp_path, one_cluster):
    poison = ["nothing"] * 9 + ["segfault", "loop", "memory", "error", "exit"]
    campaign = Campaign(
        act=ACT,
        runs=16,
        seed=31,  # every poison is drawn, and not by the first run
        vary={"do": {"choice": poison}},
        time_limit=1.0,
        memory_limit=4e8,
        tries=2,
    )
    run_campaign(campaign, tmp_path, workers=1)
    runs = pandas.read_parquet(tmp_path / "runs")
    assert len(runs) == 16
    did = runs.draws.str.extract(r'"do": "(\w+)"')[0]
    assert set(did) == set(poison)
    assert (runs[did == "nothing"].status == "done").all()
    assert (runs[did == "segfault"].said.str.startswith("SIGSEGV")).all()
    assert (runs[did == "loop"].said.str.startswith("no answer in 1 s")).all()
    assert (runs[did == "error"].said == "ValueError: no such thing").all()
    assert not (runs[did != "nothing"].status == "done").any()
    assert (runs[did != "nothing"].failed != "").all()


def test_early_end_does_not_hang_on_the_workers(tmp_path):
    early = replace(SLOW, runs=5000, variants={}, fixed={}, stop=StopParams(0.12, 20))
    for workers in (1, 2):
        run_campaign(early, tmp_path / str(workers), workers)
    assert content(tmp_path / "1") == content(tmp_path / "2")
    assert 20 <= len(pandas.read_parquet(tmp_path / "1" / "runs")) < 1000


def test_interrupted_keeps_what_was_done(tmp_path, monkeypatch):
    take, seen = running.Ledger.take, []

    def tired(self, job, answer):
        seen.append(job)
        if len(seen) == 20:
            raise KeyboardInterrupt
        return take(self, job, answer)

    with monkeypatch.context() as patch:
        patch.setattr(running.Ledger, "take", tired)
        with pytest.raises(Interrupted, match="19 runs are kept"):
            run_campaign(replace(SLOW, runs=30), tmp_path, workers=1)
    run_campaign(replace(SLOW, runs=30), tmp_path, workers=1)
    assert len(pandas.read_parquet(tmp_path / "runs")) == 60


def test_folder_of_another_campaign_is_refused(undisturbed):
    with pytest.raises(ScenarioError, match="another campaign: its seed is 1, not 2"):
        run_campaign(replace(SLOW, seed=2), undisturbed, workers=1)


def test_unknown_figures_are_refused_before_anything_runs(tmp_path):
    bad = replace(SLOW, fail=["share > 1", "y > 0"])
    with pytest.raises(ScenarioError, match="no figure 'y'"):
        run_campaign(bad, tmp_path, workers=1)
    assert not list(tmp_path.glob("runs/*.parquet"))


def test_splitting_finds_what_chance_does_not_and_resumes(tmp_path, one_cluster):
    rare = Campaign(
        act=ACT,
        search="splitting",
        vary={"x": {"normal": [0.0, 1.0]}},
        fail=["x > 3.5"],
        splitting=SplittingParams(
            "x", rises=True, failure=3.5, population=30, moves=1, replicates=2
        ),
    )
    run_campaign(rare, tmp_path, workers=1)
    told = (tmp_path / "splitting.json").read_text()
    assert '"worst_level": 3.' in told or '"worst_level": 4.' in told
    again = run_campaign(rare, tmp_path, workers=1)
    assert again["runs"] == 0
    assert (tmp_path / "splitting.json").read_text() == told


def test_report_says_how_sure_it_is(undisturbed):
    rows = Store(undisturbed / "runs", {}).rows()
    page = write_report(SLOW, rows, undisturbed, {}).read_text(encoding="utf-8")
    assert "Clopper" in page
    assert "data:image/png;base64" in page
    assert "one / two" in page  # compared on the same draws
    assert "http" not in page.replace("http-equiv", "")


def test_crossing_from_the_command_line(tmp_path, capsys, one_cluster):
    out = tmp_path / "crossing"
    words = ["campaign", "crossing", "--runs", "3", "--workers", "1"]
    assert main([*words, "--out", str(out)]) == 0
    assert "of 3 failed" in capsys.readouterr().out
    assert (out / "report.html").is_file()


@pytest.mark.parametrize(
    ("words", "match"),
    [
        (["campaign", "operation"], "did you mean 'operations'"),
        (["campaign", "crossing", "--runs", "0"], "runs=0"),
        (["campaign", "crossing", "--scheduler", "tcp://127.0.0.1:9"], "be reached"),
    ],
)
def test_bad_words_end_in_one_line(words, match, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(engine, "PATIENCE", "0.5s")
    assert main([*words, "--out", str(tmp_path / "x")]) == 2
    assert match in capsys.readouterr().err


def test_file_cannot_name_code(tmp_path):
    file = tmp_path / "mine.yaml"
    file.write_text("act: crossing\nvariants: {a: {planner: 'os:getcwd'}}\n")
    with pytest.raises(ScenarioError, match="--planner alone"):
        load_campaign(str(file))


def test_drakes_garbage_is_left_to_the_main_thread():
    """A Meshcat that goes in another thread ends the process: a cluster must not."""
    script = """
import gc, threading
from diagrams.campaigns.engine import frozen
from diagrams.common.replay import start_meshcat
ring = [start_meshcat()]
ring.append(ring)
del ring
with frozen():
    ring = [start_meshcat()]
    other = threading.Thread(target=gc.collect)
    other.start()
    other.join()
print("alive")
"""
    told = subprocess.run(
        [sys.executable, "-c", script], capture_output=True, text=True, check=True
    )
    assert told.stdout.strip() == "alive"
