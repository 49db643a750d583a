"""Faults in mid-run: noticed, survived, and refused where there is nothing to fail."""

import pytest

from diagrams.common.scenario import ScenarioError
from diagrams.studies import build, load_scenario
from tests.faults import FIRST_SEED, ROWS, good, ran


def test_a_fault_of_no_place_is_refused():
    scenario = load_scenario("snake_reach", ["faults=[{kind: arm_slow}]"])
    with pytest.raises(ScenarioError, match=r"faults\[0\].kind='arm_slow': no wire"):
        build(scenario)


@pytest.mark.parametrize("row", ROWS)
@pytest.mark.parametrize("seed", [FIRST_SEED])
def test_a_faulted_run_is_as_the_table_asks(row, seed):
    outcome = ran(ROWS[row], seed)
    assert good(ROWS[row], outcome), outcome
    asks_for_a_stop = row.startswith(("force s", "force f", "force +", "tension"))
    assert outcome.stopped or not asks_for_a_stop
