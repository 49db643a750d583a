"""`trocar keys`: every key of a scenario, with default, unit, bounds and meaning."""

from dataclasses import asdict
import fnmatch
import json
import math
from typing import Any

from diagrams.common.scenario import ScenarioError, nearest
from systems.common.parameter import Key, keys


def matching(scenario: Any, pattern: str = "") -> list[Key]:
    """The keys of a scenario that a pattern names.

    Args:
        scenario: A study's scenario.
        pattern: A part of the key, or one with `*` and `?`; all if empty.

    Raises:
        ScenarioError: If there is none; the nearest is named.
    """
    known = list(keys(scenario))
    wanted = pattern if set("*?") & set(pattern) else f"*{pattern}*"
    found = [key for key in known if fnmatch.fnmatchcase(key.name, wanted)]
    if not found:
        hint = nearest(pattern, [key.name for key in known])
        raise ScenarioError(f"no key {pattern!r} in the scenario: {hint}")
    return found


def as_text(found: list[Key]) -> str:
    """The keys as lines of text: name, value and unit, bounds, meaning."""
    rows = []
    for key in found:
        told = key.parameter
        bounds = "" if told.bounds() == "finite" else told.bounds()
        value = f"{_short(key.value)} {told.unit}".rstrip()
        if key.value != key.default:
            value += f" (default {_short(key.default)})"
        rows.append((key.name, value, " | ".join(told.choices) or bounds, told.meaning))
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    return "\n".join(
        "  ".join(
            f"{cell:<{width}}" for cell, width in zip(row, [*widths, 0], strict=True)
        )
        for row in rows
    )


def _short(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else repr(value)


def as_json(found: list[Key]) -> str:
    """The keys as JSON, for programs; what has no bound is null."""
    items = []
    for key in found:
        told = {
            name: None if isinstance(value, float) and math.isinf(value) else value
            for name, value in asdict(key.parameter).items()
        }
        items.append(
            {"key": key.name, "value": key.value, "default": key.default, **told}
        )
    return json.dumps(items, indent=2)
