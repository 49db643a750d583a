"""The speed benchmark: its parts add up (how fast it is, no test can say)."""

import pytest

from diagrams.studies import load_scenario
from tests.benchmarks.gauze_speed import measure, summary, table


def test_the_parts_add_up():
    runs, shares = measure(load_scenario("gauze_dynamic", duration=0.5), 1)
    assert runs[0].metrics["planner_step_median"] > 0.0
    parts = [share for share in shares[:-1] if not share.name.startswith(" ")]
    assert sum(share.wall for share in parts) == pytest.approx(shares[-1].wall)
    blocks = [share for share in shares if share.name.startswith(" ")]
    assert sum(share.wall for share in blocks) == pytest.approx(shares[1].wall)
    assert {"  joint_commands", "  go_to_target"} <= {share.name for share in blocks}
    assert shares[0].wall > 0.0
    assert "real_time_factor" in summary(runs)


def test_the_table_names_every_part():
    _, shares = measure(load_scenario("gauze_static", duration=0.5), 1)
    text = table(shares)
    assert all(share.name in text for share in shares)
    assert text.splitlines()[1].split()[-1] == "1.00"
