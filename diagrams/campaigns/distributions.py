"""How a key of a scenario varies: `{uniform: [0.0, 0.1]}` and its like.

    uniform: [low, high]        normal: [mean, deviation]
    log_uniform: [low, high]    choice: [one, another, ...]
    each: count                 0, 1, ... count - 1, one run after the other
    rows: FILE.csv              a row of the file, the same for all keys that name it;
                                the column is called like the key

Bounds may be lists of one shape: then each element is drawn by itself.
"""

from collections.abc import Callable, Sequence
import csv
from functools import cache
import math
from pathlib import Path
from typing import Any

from diagrams.campaigns.tape import Tape
from diagrams.common.scenario import ScenarioError, nearest
from diagrams.common.tree import read_yaml

type Draw = Callable[[Tape], Any]
"""Draws the value of a key."""


def distribution(key: str, told: Any) -> Draw:
    """What draws a key's values.

    Args:
        key: Dotted, of the scenario.
        told: Plain data, see the module.

    Raises:
        ScenarioError: If it has no such form, or no mass.
    """
    if not isinstance(told, dict) or len(told) != 1:
        raise ScenarioError(f"vary.{key}={told!r}: expected e.g. {{uniform: [0, 1]}}")
    (kind, values), where = next(iter(told.items())), f"vary.{key}"
    if kind not in KINDS:
        raise ScenarioError(f"{where}.{kind}: {nearest(str(kind), KINDS)}")
    return KINDS[kind](key, f"{where}.{kind}", values)


def _pair(where: str, values: Any) -> tuple[Any, Any]:
    if not isinstance(values, list) or len(values) != 2:
        raise ScenarioError(f"{where}={values!r}: expected two bounds")
    return values[0], values[1]


def _elements(key: str, where: str, low: Any, high: Any, of: Callable) -> Draw:
    """Draws one number, or a list of them, from bounds of one shape."""
    if isinstance(low, list) and isinstance(high, list) and len(low) == len(high):
        pairs = enumerate(zip(low, high, strict=True))
        parts = [_elements(f"{key}.{i}", where, a, b, of) for i, (a, b) in pairs]
        return lambda tape: [part(tape) for part in parts]
    numbers = [v for v in (low, high) if isinstance(v, int | float)]
    if len(numbers) != 2 or not all(map(math.isfinite, numbers)):
        raise ScenarioError(f"{where}={[low, high]}: expected two finite numbers")
    draw: Draw = of(key, where, float(low), float(high))
    return draw


def _uniform(key: str, where: str, low: float, high: float) -> Draw:
    if not low < high:
        raise ScenarioError(f"{where}={[low, high]}: expected low < high")
    return lambda tape: tape.uniform(key, low, high)


def _log_uniform(key: str, where: str, low: float, high: float) -> Draw:
    if not 0.0 < low < high:
        raise ScenarioError(f"{where}={[low, high]}: expected 0 < low < high")
    a, b = math.log(low), math.log(high)
    return lambda tape: math.exp(tape.uniform(key, a, b))


def _normal(key: str, where: str, mean: float, deviation: float) -> Draw:
    if not deviation > 0.0:
        raise ScenarioError(f"{where}={[mean, deviation]}: expected a deviation > 0")
    return lambda tape: mean + deviation * tape.normal(key)


def _bounded(of: Callable[..., Draw]) -> Callable[[str, str, Any], Draw]:
    return lambda key, where, told: _elements(key, where, *_pair(where, told), of)


def _choice(key: str, where: str, values: Any) -> Draw:
    if not isinstance(values, list) or not values:
        raise ScenarioError(f"{where}={values!r}: expected a list of values")
    return lambda tape: values[tape.whole(key, len(values))]


def _each(key: str, where: str, count: Any) -> Draw:
    if not isinstance(count, int) or count < 1:
        raise ScenarioError(f"{where}={count!r}: expected a whole number >= 1")
    return lambda tape: tape.run % count


def _rows(key: str, where: str, name: Any) -> Draw:
    rows = table(str(name))
    if not rows or key not in rows[0]:
        raise ScenarioError(
            f"{where}={name!r}: {nearest(key, rows[0] if rows else ())}"
        )
    return lambda tape: rows[tape.whole(f"rows {name}", len(rows))][key]


@cache
def table(name: str) -> Sequence[dict[str, Any]]:
    """The rows of a CSV file, each value read as YAML.

    Raises:
        ScenarioError: If it cannot be read.
    """
    try:
        text = Path(name).read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise ScenarioError(f"rows={name!r}: cannot be read: {error}") from error
    return [
        {key: read_yaml(value or "", name) for key, value in row.items() if key}
        for row in csv.DictReader(text.splitlines())
    ]


KINDS: dict[str, Callable[[str, str, Any], Draw]] = {
    "uniform": _bounded(_uniform),
    "log_uniform": _bounded(_log_uniform),
    "normal": _bounded(_normal),
    "choice": _choice,
    "each": _each,
    "rows": _rows,
}
