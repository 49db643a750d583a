"""The sweep has the cases it should, and one of them runs."""

from tests.benchmarks.wrist_sweep import HARDEST, monte_carlo, run_case, summary, sweep


def test_cases():
    cases = sweep(1)
    assert len(cases) >= 120
    assert max(c.stiffness * c.amplitude for c in cases) == HARDEST
    assert {c.stiffness for c in cases} >= {100.0, 3000.0}
    assert {c.wave for c in cases} == {"sine", "ventilator"}
    assert monte_carlo(3, 5) == monte_carlo(3, 5) != monte_carlo(4, 5)


def test_the_stiffest_case_is_stable():
    case = next(c for c in sweep(1) if c.stiffness * c.amplitude == HARDEST)
    row = run_case(case)
    assert not row["error"]
    assert row["max_lateral_force"] < 5.0
    assert "1 cases, 0 ended early" in summary([row], "one")
