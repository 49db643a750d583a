"""Compiling the numeric kernels of the blocks with numba.

Inside a simulation a block runs once in some milliseconds, between stretches of C++
that push the interpreter out of the processor's caches: there a line of Python costs
twice what a tight loop of it does. A compiled function costs one call.

A compiled function is the function; there is no second version in Python. It takes
arrays straight from `port.Eval`, floats, tuples of floats (3-vectors are tuples, which
stay in registers) and a block's parameters as `packed` has them. It is compiled at
its first call for the types it gets and cached on disk.
"""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from functools import cache
import hashlib
import inspect
from pathlib import Path
import sys
from typing import Any

import numba
from numba.core.caching import InTreeCacheLocator, UserWideCacheLocator
from numba.core.dispatcher import Dispatcher
from numba.core.event import Listener, install_listener
import numpy as np

type Numbers = Sequence[float] | np.ndarray
"""An array or a tuple of floats."""

_sources: dict[str, frozenset[str]] = {}
"""Every file with compiled functions, and the files that its functions call into."""


def compiled[F: Callable[..., Any]](function: F) -> F:
    """Compiles a function of numbers when it is first called.

    Division by zero gives an infinity or NaN, as in numpy, and the blocks test for
    them; hence no `fastmath`, which would take them for impossible.
    """
    own = function.__code__.co_filename
    called = {own} | _sources.get(own, frozenset())
    for value in function.__globals__.values():
        if isinstance(value, Dispatcher):
            called |= _sources.get(value.py_func.__code__.co_filename, frozenset())
    _sources[own] = frozenset(called)
    before = numba.config.CACHE_LOCATOR_CLASSES
    numba.config.CACHE_LOCATOR_CLASSES = f"{__name__}.InTree,{__name__}.UserWide"
    try:
        result: Any = numba.njit(cache=True, error_model="numpy")(function)
    finally:
        numba.config.CACHE_LOCATOR_CLASSES = before
    return result


def generated(source: str, name: str, home: Any, names: dict[str, Any]) -> Any:
    """Compiles a function from its source text.

    Args:
        source: Of one function.
        name: Its name.
        home: A function or class of the file that it counts as part of.
        names: What the source refers to.
    """
    scope = {**names, "__name__": home.__module__}
    file = inspect.getfile(getattr(home, "py_func", home))
    exec(compile(source, file, "exec"), scope)
    return compiled(scope[name])


class _Announcer(Listener):
    """Says once that something is being compiled."""

    def __init__(self) -> None:
        self._said = False

    def on_start(self, event: Any) -> None:
        """Called when numba begins to compile; not when it loads from its cache."""
        if not self._said:
            print("compiling the blocks, once: about 20 s ...", file=sys.stderr)
        self._said = True

    def on_end(self, event: Any) -> None:
        """Called when numba has compiled a function."""


def announced() -> AbstractContextManager[Any]:
    """Within this context, a compilation is announced to who sits at a terminal."""
    if not sys.stderr.isatty():
        return nullcontext()
    return install_listener("numba:compile", _Announcer())


def rehearse(act: Callable[[], Any]) -> None:
    """Acts once and forgets it, before a clock runs.

    Kernels are compiled at their first call, or loaded from the disk: that is no part
    of the time that the act takes. An error will come again in the act itself.
    """
    with announced(), suppress(Exception, SystemExit):
        act()


@cache
def _stamp(files: frozenset[str]) -> str:
    contents = b"".join(Path(file).read_bytes() for file in sorted(files))
    return hashlib.sha256(contents).hexdigest()


class InTree(InTreeCacheLocator):
    """A cache beside the source that also notices a change in a called file.

    numba's own looks at the calling function's file alone, and would go on using
    what it inlined from a file that has changed since.
    """

    def get_source_stamp(self) -> str:
        """A fingerprint of the function's file and of all files it calls into."""
        return _stamp(_sources[self._py_file])


class UserWide(UserWideCacheLocator):
    """The same in the user's cache folder, for an installation that is read-only."""

    def get_source_stamp(self) -> str:
        """A fingerprint of the function's file and of all files it calls into."""
        return _stamp(_sources[self._py_file])


def packed(params: Any = None, **more: Any) -> np.ndarray:
    """Parameters as compiled functions take them.

    Args:
        params: A dataclass of parameters; its numbers, flags and lists of numbers are
            taken over, all else is left out. None for none.
        **more: Further values by name, numbers or arrays; they keep their type.

    Returns:
        An array of one record: in a compiled function `packed(params)[0].name` is the
        parameter's value. Pass the array, which is checked far faster than its record.
    """
    values = {}
    given = vars(params) if params is not None else {}
    for name, value in (given | more).items():
        array = np.asarray(value) if value is not None else np.empty(0, object)
        if array.dtype.kind == "i" and name not in more:
            array = array.astype(float)  # 20 where 20.0 is meant
        if array.dtype.kind in "bif" and array.size:
            values[name] = array
    layout = [(name, array.dtype, array.shape) for name, array in values.items()]
    record = np.zeros(1, np.dtype(layout, align=True))
    for name, array in values.items():
        record[name] = array
    return record
