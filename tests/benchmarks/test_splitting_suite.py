"""Splitting and chance look at the same runs."""

import pytest

from diagrams.campaigns.splitting import SplittingParams
from diagrams.campaigns.tape import Tape
from tests.benchmarks.splitting_suite import clearance, split


def test_a_run_depends_on_its_numbers_alone():
    tape = Tape([1, 0, 3])
    least = clearance(tape)
    known = Tape([9, 9, 9], tape.numbers)
    assert clearance(known) == least > 0.0
    assert clearance(Tape([1, 0, 4])) != least


def test_what_always_happens_is_certain():
    params = SplittingParams("", failure=1.0, population=20, moves=1, replicates=2)
    found = split(1, params)
    assert found.each == [1.0, 1.0] and found.probability == 1.0
    assert found.runs == 60 and 0.0 < found.lowest < 1.0
    assert found.ladder.levels == [pytest.approx(1.0)]
