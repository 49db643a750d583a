"""One run of a scenario serves all tests of a process."""

from dataclasses import replace
from functools import cache
import json
from typing import Any
from unittest.mock import patch

from diagrams.common.progress import Progress, silent
from diagrams.common.run import Run, simulate
from diagrams.studies import load_scenario

_RUNS: dict[str, Run] = {}


def once(scenario: Any, meshcat: Any = None, progress: Progress = silent) -> Run:
    """As `simulate`, but what was simulated before is not again, beside a run either.

    The same scenario is the same run: tests of it simulate by themselves.
    """
    key = repr(scenario)
    if meshcat is not None or key not in _RUNS:
        with patch("diagrams.common.run.simulate", once):
            result = simulate(scenario, meshcat, progress)
        if meshcat is not None:
            return result
        _RUNS[key] = result
    return _RUNS[key]


@cache
def run(name: str, *overrides: str) -> Run:
    """A scenario's run to its end, with its own seed.

    The other planners and wrists that its file has drawn beside it are left out: no
    figure needs them. An override `compare=` asks for them.

    Args:
        name: Of the scenario.
        *overrides: KEY=VALUE.
    """
    scenario = load_scenario(name, list(overrides))
    asked = any(text.startswith("compare=") for text in overrides)
    if not asked and isinstance(getattr(scenario, "compare", None), list):
        scenario = replace(scenario, compare=[])
    result = once(scenario)
    assert not result.error
    json.dumps(result.metrics, allow_nan=False)
    return result
