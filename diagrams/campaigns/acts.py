"""What a run of a campaign does: data in, figures out, in a process of its own."""

from collections.abc import Callable
import copy
from importlib import import_module
import json
import math
from typing import Any

from diagrams.common.metrics import WALL_CLOCK
from diagrams.common.scenario import ScenarioError

type Job = dict[str, Any]
"""Plain data: `run`, `variant`, `seed`, `base` (a scenario's), `overrides`."""
type Figures = dict[str, Any]


def texts(values: dict[str, Any]) -> list[str]:
    """Values by key as `--set` takes them."""
    return [f"{key}={json.dumps(value)}" for key, value in values.items()]


def scenario(job: Job) -> Figures:
    """Runs the whole loop of a scenario; its figures but for those of the clock."""
    from diagrams.common.run import simulate
    from diagrams.studies import scenario_of

    tree = copy.deepcopy(job["base"])
    run = simulate(scenario_of(tree, job["overrides"], job["seed"]))
    return {k: v for k, v in run.metrics.items() if k not in WALL_CLOCK}


def crossing(job: Job) -> Figures:
    """Runs a planner through a scene of crossing tools, robot and tools ideal."""
    from diagrams.campaigns.crossing import figures

    return figures(job["overrides"])


def plan(job: Job) -> Figures:
    """Plans the resection of a mask, which is not carried out."""
    from diagrams.resection.planned import planned
    from diagrams.studies import scenario_of

    return planned(scenario_of(copy.deepcopy(job["base"]), job["overrides"]))


ACTS: dict[str, Callable[[Job], Figures]] = {
    "scenario": scenario,
    "crossing": crossing,
    "plan": plan,
}
"""By the campaign's `act`."""


def find_act(name: str) -> Callable[[Job], Figures]:
    """An act of this list, or of one's own as `module:function`."""
    if name in ACTS:
        return ACTS[name]
    module, _, function = name.partition(":")
    act: Callable[[Job], Figures] = getattr(import_module(module), function)
    return act


def answer(act: Callable[[Job], Figures], job: Job) -> dict[str, Any]:
    """What an act gives; an error becomes a part of the answer."""
    try:
        return {"figures": _finite(act(job))}
    except ScenarioError as error:
        return {"refused": str(error)}
    except (Exception, SystemExit) as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        return {"error": reason}


def _finite(value: Any) -> Any:
    """Plain data for JSON; what is not finite becomes none."""
    if isinstance(value, dict):
        return {str(key): _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    if hasattr(value, "tolist"):
        return _finite(value.tolist())
    is_odd = isinstance(value, float) and not math.isfinite(value)
    return None if is_odd else value
