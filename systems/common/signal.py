"""Signals: what travels between blocks, each declared once.

A signal is a `NamedTuple` whose fields are floats and vectors, each annotated with a
`Field`: its unit, meaning and an example.

    class Guide(NamedTuple):
        M_R: Annotated[Vector, Field("m", "guide point p_WMR", (0.012, 0.0, -0.072))]
        s: Annotated[float, Field("1", "proportion of R's inserted length", 0.6)]

From the declaration come the port's size, the example that the contract test feeds, the
columns of the log, and the tuple itself: compiled functions take it (`guide.M_R`), and
`view` gives the same names to arrays.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cache
from math import isfinite
import typing
from typing import Any

import numpy as np

from systems.common.compiled import generated

type Vector = tuple[float, float, float]

AXES = ("x", "y", "z")


@dataclass(frozen=True)
class Field:
    """What a field of a signal is.

    Attributes:
        unit: SI.
        meaning: In words; vectors are expressed in the world frame W if it says nothing
            else.
        example: A physically sensible value: a number, or as many as the field has.
        columns: Names of its columns in the log; the field's own name, with `_x`,
            `_y`, `_z` for a vector, if empty.
    """

    unit: str
    meaning: str
    example: float | Sequence[float]
    columns: tuple[str, ...] = ()

    @property
    def size(self) -> int:
        """Number of elements."""
        return 1 if self.is_number else len(typing.cast(Sequence[float], self.example))

    @property
    def is_number(self) -> bool:
        """Whether it is a float, not a tuple."""
        return isinstance(self.example, float)

    def names(self, name: str) -> tuple[str, ...]:
        """Names of the columns of a field of this name."""
        if self.columns or self.is_number:
            return self.columns or (name,)
        ends = AXES if self.size == len(AXES) else range(1, self.size + 1)
        return tuple(f"{name}_{end}" for end in ends)


@dataclass(frozen=True)
class Many:
    """A set of things as one signal of fixed size, one row below the other.

    Compiled functions take it as an array (n, size of the row's signal).

    Attributes:
        signal: What each row is.
        names: Of the rows: a field `x` is in the columns `x_NAME`, a column without
            a name of its own in NAME.
    """

    signal: Any
    names: tuple[str, ...]


@cache
def fields(signal: Any) -> dict[str, Field]:
    """The fields of a signal, in their order; a block's state may leave them bare."""
    hints = typing.get_type_hints(signal, include_extras=True)
    return {name: _field(hints[name]) for name in signal._fields}


def _field(hint: Any) -> Field:
    if hasattr(hint, "__metadata__"):
        told: Field = hint.__metadata__[0]
        return told
    numbers = typing.get_args(getattr(hint, "__value__", hint))
    return Field("", "", (0.0,) * len(numbers) if numbers else 0.0)


@cache
def size(signal: Any) -> int:
    """Number of elements of a signal."""
    if isinstance(signal, Many):
        return len(signal.names) * size(signal.signal)
    return sum(field.size for field in fields(signal).values())


@cache
def columns(signal: Any) -> tuple[str, ...]:
    """Names of a signal's elements, as the log has them."""
    if isinstance(signal, Many):
        parts = columns(signal.signal)
        joined = [f"{part}_{name}" for name in signal.names for part in parts]
        return tuple(column.removeprefix("_") for column in joined)
    named = fields(signal).items()
    return tuple(column for name, field in named for column in field.names(name))


def vector(values: Iterable[float]) -> Vector:
    """Three numbers as compiled functions take them."""
    x, y, z = values
    return float(x), float(y), float(z)


def example(signal: Any) -> Any:
    """The signal with the examples of its fields."""
    if isinstance(signal, Many):
        return (example(signal.signal),) * len(signal.names)
    return signal(*(field.example for field in fields(signal).values()))


def example_array(signal: Any) -> np.ndarray:
    """The same as a port has it; of many things one by one would take long."""
    if isinstance(signal, Many):
        return np.tile(example_array(signal.signal), len(signal.names))
    return flat(example(signal))


def flat(value: Any) -> np.ndarray:
    """A signal's value as a port has it: one element after the other."""
    if isinstance(value, tuple):
        return np.concatenate([flat(part) for part in value])
    return np.ravel(value).astype(float)


def view(signal: Any, array: np.ndarray) -> Any:
    """The signal of an array whose last axis has its elements; nothing is copied.

    Args:
        signal: Its declaration.
        array: Shape (..., size).

    Returns:
        The signal; a number's field is an array (...), a vector's one (..., 3). Of many
        things the fields are arrays (..., n) and (..., n, 3).
    """
    if isinstance(signal, Many):
        rows = (*array.shape[:-1], len(signal.names), size(signal.signal))
        return view(signal.signal, array.reshape(rows))
    return signal(*[array[..., part] for part in _parts(signal)])


@cache
def _parts(signal: Any) -> list[int | slice]:
    """Where in an array of a signal's elements its fields are."""
    parts: list[int | slice] = []
    first = 0
    for field in fields(signal).values():
        parts.append(first if field.is_number else slice(first, first + field.size))
        first += field.size
    return parts


def reading(signal: Any, array: str, first: int = 0) -> str:
    """Source of the expression that makes the signal of an array's elements."""
    parts = []
    for field in fields(signal).values():
        elements = [f"{array}[{first + i}]" for i in range(field.size)]
        parts.append(elements[0] if field.is_number else f"({', '.join(elements)},)")
        first += field.size
    return f"{signal.__name__}({', '.join(parts)})"


def elements(signal: Any, value: str) -> list[str]:
    """Sources of the expressions that give the signal's elements one by one."""
    return [
        f"{value}.{name}" if field.is_number else f"{value}.{name}[{i}]"
        for name, field in fields(signal).items()
        for i in range(field.size)
    ]


def reader(signal: Any) -> Any:
    """A compiled function that makes the signal of an array of its elements."""
    name = f"read_{signal.__name__}"
    source = f"def {name}(values):\n    return {reading(signal, 'values')}\n"
    return generated(source, name, signal, {signal.__name__: signal})


def row_writer(signal: Any) -> Any:
    """A compiled function that writes the signal into a row of an array."""
    name = f"write_{signal.__name__}_row"
    parts = enumerate(elements(signal, "value"))
    body = "".join(f"    rows[i, {k}] = {part}\n" for k, part in parts)
    return generated(f"def {name}(rows, i, value):\n{body}", name, signal, {})


def writer(signal: Any) -> Any:
    """A compiled function that makes an array of a signal's elements."""
    name = f"write_{signal.__name__}"
    parts = ", ".join(elements(signal, "value"))
    source = f"def {name}(value):\n    return np.array(({parts},))\n"
    return generated(source, name, signal, {"np": np})


def finiteness(signal: Any) -> Any:
    """A compiled function that says whether all elements of a signal are finite."""
    name = f"finite_{signal.__name__}"
    total = " + ".join(elements(signal, "value"))
    # A sum with a NaN or an infinity in it is never finite.
    source = f"def {name}(value):\n    return isfinite({total})\n"
    return generated(source, name, signal, {"isfinite": isfinite})
