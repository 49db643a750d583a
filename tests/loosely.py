"""Compiled functions called as tests like to: with lists, whole numbers, dataclasses.

Every new type of an argument would compile a function anew; so numbers become what
the blocks pass: tuples of three floats, signals, arrays, records.
"""

from collections.abc import Callable
from dataclasses import is_dataclass
from functools import wraps
from typing import Any

import numpy as np


def loosely(
    function: Callable[..., Any], constants: Callable[[Any], np.ndarray] | None = None
) -> Callable[..., Any]:
    """The function, with its positional arguments brought into form.

    Args:
        function: A compiled function.
        constants: Makes a record of the parameters' dataclass, if it takes one.
    """

    def formed(value: Any) -> Any:
        if hasattr(value, "_fields"):
            return type(value)(*map(formed, value))
        if is_dataclass(value) and constants is not None:
            return constants(value)[0]
        if isinstance(value, list | tuple) and np.ndim(value) == 2:
            return tuple(map(formed, value))
        if isinstance(value, list | tuple | np.ndarray):
            if len(value) <= 3:
                return tuple(map(float, value))
            return np.array(value, float)
        return float(value) if isinstance(value, int | np.floating) else value

    @wraps(function)
    def loose(*args: Any) -> Any:
        return function(*map(formed, args))

    return loose
