"""Parameters: default, unit, bounds and meaning, each declared once.

    @dataclass
    class BackwardMovementParams:
        form: str = parameter("corrected", "form of equation (5)", choices=FORMS)
        period: float = parameter(1 / 60, "of the update", "s", above=0.0, most=1.0)

One walker checks what is declared, and names the whole key. Rules across fields are a
method `rules` that yields what must hold, the field to blame (`hunt.speed` and
`points[0]` as well), and what is expected of it: of parameters as of whole scenarios.
"""

from collections.abc import Callable, Iterator
from dataclasses import MISSING, dataclass, field, fields, is_dataclass
import difflib
import math
import re
from typing import Any

type Rules = Iterator[tuple[bool, str, str]]
"""Whether each rule holds, the field to blame, and what is expected of it."""


class ParameterError(ValueError):
    """A parameter that makes no sense."""


@dataclass(frozen=True)
class Parameter:
    """What a field of a parameters' dataclass may be.

    Attributes:
        meaning: In words.
        unit: SI, "" for none.
        above: It is greater than this, or
        least: at least this,
        most: and at most this.
        choices: Of a text; any text if empty.
        shape: Lengths of a list and of the lists in it, -1 for any; () for one value.
        file: Whether it names a file: relative names are taken from the scenario's
            folder, and a run keeps a copy beside its results.
    """

    meaning: str
    unit: str = ""
    above: float = -math.inf
    least: float = -math.inf
    most: float = math.inf
    choices: tuple[str, ...] = ()
    shape: tuple[int, ...] = ()
    file: bool = False

    def bounds(self) -> str:
        """What each number may be, in words."""
        lower = [f"> {self.above:.6g}"] if self.above > -math.inf else []
        lower += [f">= {self.least:.6g}"] if self.least > -math.inf else []
        upper = [f"<= {self.most:.6g}"] if self.most < math.inf else []
        return " and ".join(lower + upper) or "finite"

    def expected(self, value: Any) -> str:
        """What is expected instead of a value, in words."""
        if self.choices:
            close = difflib.get_close_matches(str(value), self.choices, 1, 0.5)
            hint = f"; did you mean {close[0]!r}?" if close else ""
            return f"one of {', '.join(self.choices)}{hint}"
        lengths = [f"{n if n >= 0 else 'any number of'}" for n in self.shape]
        return " x ".join(lengths) + (" numbers " if lengths else "") + self.bounds()

    def holds(self, value: Any, depth: int = 0) -> bool:
        """Whether a value, or each in a list, is as declared."""
        if depth < len(self.shape):
            length = self.shape[depth]
            is_long = isinstance(value, list | tuple) and length in (-1, len(value))
            return is_long and all(self.holds(item, depth + 1) for item in value)
        if isinstance(value, str | bool):
            return not self.choices or value in self.choices
        is_within = self.above < value and self.least <= value <= self.most
        return is_within and (isinstance(value, int) or math.isfinite(value))


def parameter(default: Any, meaning: str, unit: str = "", **limits: Any) -> Any:
    """A field of a parameters' dataclass.

    Args:
        default: Its default; of a list a copy, of a class a new object.
        meaning: In words.
        unit: SI, "" for none.
        **limits: The other attributes of `Parameter`.
    """
    metadata = {"parameter": Parameter(meaning, unit, **limits)}
    if isinstance(default, type):
        return field(default_factory=default, metadata=metadata)
    if isinstance(default, list):
        return field(default_factory=lambda: _copy(default), metadata=metadata)
    return field(default=default, metadata=metadata)


def part(kind: Callable[[], Any]) -> Any:
    """A field of a dataclass that holds parameters of another, or what makes them."""
    return field(default_factory=kind)


def _copy(value: Any) -> Any:
    return [_copy(item) for item in value] if isinstance(value, list) else value


def owner_of(params: Any) -> str:
    """The key of parameters that stand alone: of `FooBarParams` it is foo_bar."""
    name = type(params).__name__.removesuffix("Params")
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


def default_of(declared: Any) -> Any:
    """The default of a dataclass's field; None if it has none."""
    if declared.default_factory is not MISSING:
        return declared.default_factory()
    return None if declared.default is MISSING else declared.default


def check[T: Any](params: T, owner: str | None = None) -> T:
    """Checks a dataclass of parameters and all that are in it.

    Args:
        params: The dataclass.
        owner: Its key in the scenario, "" for the scenario; by its name if None.

    Returns:
        The dataclass itself.

    Raises:
        ParameterError: With the whole key, the value, what was expected and the
            default.
    """
    owner = owner_of(params) if owner is None else owner
    for declared in fields(params):
        value = getattr(params, declared.name)
        key = f"{owner}.{declared.name}" if owner else declared.name
        parts = _dataclasses(key, value)
        for part, item in parts:
            check(item, part)
        told, default = declared.metadata.get("parameter"), default_of(declared)
        is_left_out = value is None and default is None
        if told and not (parts or is_left_out or told.holds(value)):
            _refuse(key, value, told, told.expected(value), default)
    for holds, name, expected in getattr(params, "rules", lambda: ())():
        if not holds:
            key = f"{owner}.{name}" if owner else name
            above, _, last = name.rpartition(".")
            told = {f.name: f.metadata for f in fields(value_of(params, above))}
            declared = told.get(last, {}).get("parameter")
            _refuse(key, value_of(params, name), declared, expected, None)
    return params


def value_of(params: Any, key: str) -> Any:
    """What a key of a dataclass holds, `player.rates[1]`; itself for an empty one."""
    for word, index in re.findall(r"(\w+)|\[(\d+)\]", key):
        params = getattr(params, word) if word else params[int(index)]
    return params


def _dataclasses(key: str, value: Any) -> list[tuple[str, Any]]:
    """What is in a field, by its key; a tool is called by its name alone."""
    items = [(key, value)]
    if isinstance(value, list):
        items = [(f"{key}[{index}]", item) for index, item in enumerate(value)]
        if key == "tools":
            items = [(item.name, item) for item in value]
    return [(part, item) for part, item in items if is_dataclass(item)]


def _refuse(key: str, value: Any, told: Any, expected: str, default: Any) -> None:
    unit = f" {told.unit}" if told and told.unit else ""
    shown = f"{default:.4g}" if isinstance(default, float) else default
    hint = "" if default is None else f"; the default is {shown}"
    told_value = "" if _dataclasses(key, value) else f"={value!r}{unit}"
    raise ParameterError(f"{key}{told_value}: expected {expected}{hint}")


@dataclass(frozen=True)
class Key:
    """A key of a scenario: its whole name, what it may be, its value and default."""

    name: str
    parameter: Parameter
    value: Any
    default: Any


def keys(params: Any, owner: str = "") -> Iterator[Key]:
    """Every declared key of a dataclass of parameters, with the value it has."""
    for declared in fields(params):
        value = getattr(params, declared.name)
        key = f"{owner}.{declared.name}" if owner else declared.name
        parts = _dataclasses(key, value)
        for part, item in parts:
            yield from keys(item, part)
        if "parameter" in declared.metadata and not is_dataclass(value):
            told, default = declared.metadata["parameter"], default_of(declared)
            yield Key(key, told, None if parts else value, default)
