"""One run of a scenario serves all tests of a process."""

from functools import cache
import json

from diagrams.common.run import Run, simulate
from diagrams.studies import load_scenario


@cache
def run(name: str, *overrides: str) -> Run:
    """A scenario's run to its end, with its own seed.

    Args:
        name: Of the scenario.
        *overrides: KEY=VALUE.
    """
    result = simulate(load_scenario(name, list(overrides)))
    assert not result.error
    json.dumps(result.metrics, allow_nan=False)
    return result
