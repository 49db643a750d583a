"""What dies, hangs or eats memory costs its own run only, and says why."""

from dataclasses import replace

import pytest

from diagrams.campaigns.supervisor import Child, Limits

ACT = "tests.diagrams.campaigns.poison:act"
LIMITS = Limits(time=60.0, memory=6e8, tries=2, kept=3e8)


@pytest.fixture(scope="module")
def child():
    child = Child(ACT, LIMITS)
    yield child
    child.close()


def job(**told):
    return {"run": 0, "variant": "", "seed": 1, "base": {}, "overrides": told}


def test_figures_come_back(child):
    assert child.ask(job(x=0.5))["figures"]["x"] == 0.5


@pytest.mark.parametrize(
    ("do", "why"),
    [
        ("segfault", "SIGSEGV"),
        ("memory", "memory"),
    ],
)
def test_death_is_told_and_the_next_run_is_well(child, do, why):
    told = child.insist(job(do=do))
    assert why in told.get("died", "") or "MemoryError" in told.get("error", "")
    assert child.ask(job(x=0.25))["figures"]["x"] == 0.25


def test_a_run_that_hangs_is_ended():
    child = Child(ACT, replace(LIMITS, time=2.0))
    try:
        assert "no answer in 2 s" in child.insist(job(do="loop"))["died"]
    finally:
        child.close()


def test_errors_and_exits_are_answers(child):
    assert child.ask(job(do="error")) == {"error": "ValueError: no such thing"}
    assert child.ask(job(do="exit")) == {"error": "SystemExit: a demand was not met"}


def test_run_that_dies_once_is_done_again(child, tmp_path):
    told = child.insist(job(do="once", mark=str(tmp_path / "mark"), x=0.125))
    assert told["figures"]["x"] == 0.125


def test_a_process_that_keeps_memory_is_begun_anew():
    child = Child(ACT, LIMITS)
    try:
        held = []
        for _ in range(4):
            assert "figures" in child.ask(job(do="keep"))
            held.append(child._process is not None)
        assert held[0] and not all(held)
    finally:
        child.close()
