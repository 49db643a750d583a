"""Compiling the numeric kernels of the blocks with numba.

Inside a simulation a block runs once in some milliseconds, between stretches of C++
that push the interpreter out of the processor's caches: there a line of Python costs
twice what a tight loop of it does. A compiled function costs one call.

A compiled function is the function; there is no second version in Python. It takes
arrays straight from `port.Eval`, floats, tuples of floats (3-vectors are tuples, which
stay in registers) and a block's parameters as `packed` has them. It is compiled at
its first call for the types it gets and cached on disk, where that can be written to.
"""

import ast
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext, suppress
from functools import cache, cached_property
import hashlib
from importlib.util import find_spec
import inspect
import marshal
from pathlib import Path
import sys
from time import time_ns
from types import CodeType, FunctionType
from typing import Any

import numba
from numba.core.caching import InTreeCacheLocator, UserWideCacheLocator
from numba.core.event import Listener, install_listener
from numba.core.registry import CPUDispatcher
from numba.core.sigutils import normalize_signature
import numpy as np

type Numbers = Sequence[float] | np.ndarray
"""An array or a tuple of floats."""


def compiled[F: Callable[..., Any]](function: F) -> F:
    """Compiles a function of numbers when it is first called.

    Division by zero gives an infinity or NaN, as in numpy, and the blocks test for
    them; hence no `fastmath`, which would take them for impossible.
    """
    outer = _dispatcher(function, "InTree", "UserWide")
    outer.__class__ = _Outer
    outer.inner = _dispatcher(
        function, "InnerInTree", "InnerUserWide", no_cpython_wrapper=True
    )
    outer.inner.__class__ = _Inner
    outer.inner.outer = outer
    return outer


class _Outer(CPUDispatcher):
    """A compiled function as Python calls it; others that call it are given `inner`.

    Taking arguments from Python is a fifth of what there is to compile, and most
    functions are called by compiled ones alone.
    """

    inner: Any

    @property
    def _numba_type_(self) -> Any:
        return numba.types.Dispatcher(self.inner)


class _Inner(CPUDispatcher):
    """A compiled function as others call it.

    Constants in a call are numbers like others: -1 in it compiles nothing anew. What
    Python has called already, or a process before, is taken from `outer`.
    """

    outer: Any

    def get_call_template(self, args: Any, kws: Any) -> Any:
        """What a call with arguments of these types is compiled to."""
        plain = {name: numba.types.unliteral(kind) for name, kind in kws.items()}
        return super().get_call_template(tuple(map(numba.types.unliteral, args)), plain)

    def compile(self, sig: Any) -> Any:
        """Compiles it for a signature that it has not been compiled for."""
        outer, (args, _) = self.outer, normalize_signature(sig)
        if args not in self.overloads:
            found = outer.overloads.get(args)
            if not found and (found := outer._cache.load_overload(sig, self.targetctx)):
                parts = found.entry_point, found.fndesc, [found.library]
                self.targetctx.insert_user_function(*parts)
                outer.add_overload(found)
            if found:
                self.add_overload(found)
        return super().compile(sig)


def _dispatcher(function: Any, *locators: str, **options: Any) -> Any:
    """Numba's, with a cache on disk where there is a place."""
    before = numba.config.CACHE_LOCATOR_CLASSES
    names = ",".join(f"{__name__}.{locator}" for locator in locators)
    numba.config.CACHE_LOCATOR_CLASSES = names
    compile_ = numba.njit(error_model="numpy", no_cfunc_wrapper=True, **options)
    result = compile_(function)
    try:
        if Path(function.__code__.co_filename).is_file():  # not in a notebook
            result.enable_caching()
    except RuntimeError:  # no place can be written to: each process compiles anew
        result = compile_(function)
    finally:
        numba.config.CACHE_LOCATOR_CLASSES = before
    return result


def inlined(function: Any) -> Any:
    """A compiled function for one caller: compiled as a part of it, not by itself."""
    return numba.njit(inline="always", error_model="numpy")(function.py_func)


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
            print("compiling the blocks, once: up to two minutes ...", file=sys.stderr)
        self._said = True

    def on_end(self, event: Any) -> None:
        """Called when numba has compiled a function."""


def announced() -> AbstractContextManager[Any]:
    """Within this context, a compilation is announced to who sits at a terminal."""
    if not sys.stderr.isatty():
        return nullcontext()
    return install_listener("numba:compile", _Announcer())


_FOREIGN = sys.stdlib_module_names | {"numba", "numpy"}
"""Packages that are not looked into."""


def rehearse(act: Callable[[], Any]) -> None:
    """Acts once and forgets it, before a clock runs.

    Kernels are compiled at their first call, or loaded from the disk: that is no part
    of the time that the act takes. An error will come again in the act itself.
    """
    with announced(), suppress(Exception, SystemExit):
        act()


@cache
def _file(module: str) -> str:
    """A module's source file; "" if it is no module, or a foreign one."""
    if not module or module.split(".")[0] in _FOREIGN:
        return ""
    try:
        spec = find_spec(module)
    except (ModuleNotFoundError, ValueError):  # a name in a module; a script
        return ""
    origin = str(spec and spec.has_location and spec.origin)
    return origin if origin.endswith(".py") else ""


class _Source:
    """A source file: its digest, and the names that each of its names is made of."""

    def __init__(self, content: bytes) -> None:
        self.digest = hashlib.sha256(content).digest()
        self.words: dict[str, frozenset[str]] = {}
        self.imports: dict[str, set[str]] = {}
        for part in ast.parse(content).body:
            nodes = list(ast.walk(part))
            words = {getattr(n, "id", getattr(n, "attr", "")) for n in nodes}
            if isinstance(part, ast.FunctionDef | ast.ClassDef):
                nodes = [ast.Name(part.name, ast.Store())]
            for node in nodes:
                if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
                    self.words[node.id] = self.words.get(node.id, frozenset()) | words
                elif isinstance(node, ast.Import | ast.ImportFrom):
                    of = f"{node.module}." if isinstance(node, ast.ImportFrom) else ""
                    for n in node.names:
                        bound = (n.asname or n.name).split(".")[0]
                        self.imports.setdefault(bound, set()).add(of + n.name)


@cache
def _source(file: str, changed: int) -> _Source:
    return _Source(Path(file).read_bytes())


def _words(code: CodeType) -> frozenset[str]:
    inner = [_words(c) for c in code.co_consts if isinstance(c, CodeType)]
    return frozenset(code.co_names).union(*inner)


def _origins(function: FunctionType) -> list[tuple[str, frozenset[str]]]:
    """Files, and the names in them that a function begins with."""
    words = _words(function.__code__) | {function.__name__}
    found = [(function.__code__.co_filename, words)]
    names = function.__globals__
    if names is not vars(sys.modules[function.__module__]):  # it is generated
        values: list[Any] = [names.get(word) for word in words]
        for value in values:
            value = getattr(value, "py_func", value)
            if isinstance(value, FunctionType) and value is not function:
                found += _origins(value)
            elif hasattr(value, "_fields"):
                found.append((inspect.getfile(value), frozenset({value.__name__})))
    return found


def _stamp(function: FunctionType, loaded: int) -> str:
    """A fingerprint of all files that a function is made of.

    They are its own and those of the functions, constants and types that it names,
    and so on. numba's own stamp is of the first alone: it would go on using what was
    inlined from a file that has changed since. Imports are absolute, as everywhere.

    Args:
        function: The function.
        loaded: When, in ns. What is in a file that was written later is not what runs:
            the fingerprint is then one that no other process will have.
    """
    new = _origins(function)
    seen, sources = set(new), {}
    for file, words in new:
        if file not in sources:
            sources[file] = _source(file, Path(file).stat().st_mtime_ns)
        for word in words:
            found = [(file, sources[file].words.get(word, frozenset()))]
            for target in sources[file].imports.get(word, ()):
                above, _, name = target.rpartition(".")
                if _file(target):
                    found.append((_file(target), words))
                elif _file(above):
                    found.append((_file(above), frozenset({name})))
            new += [one for one in found if one not in seen]
            seen.update(found)
    digests = b"".join(sources[file].digest for file in sorted(sources))
    stamp = hashlib.sha256(digests).hexdigest()
    if any(Path(file).stat().st_mtime_ns > loaded for file in sources):
        return f"{stamp} was loaded at {loaded} and has changed since"
    return stamp


class _Stamp:
    """A fingerprint that is taken when it is first compared or kept.

    That is at the function's first call; most of what is imported is never called.
    """

    def __init__(self, function: FunctionType) -> None:
        self._function = function
        self._loaded = time_ns()

    @cached_property
    def text(self) -> str:
        """The fingerprint."""
        return _stamp(self._function, self._loaded)

    def __eq__(self, other: object) -> bool:
        return self.text == (other.text if isinstance(other, _Stamp) else other)

    def __str__(self) -> str:
        """The fingerprint."""
        return self.text

    def __reduce__(self) -> Any:
        """It is kept as a text."""
        return str, (self.text,)


class _Stamped:
    """A place for a function's compiled code that notices a change in any callee."""

    mark = ""
    """Tells apart what Python calls and what has no way in from it."""

    def __init__(self, *function_and_file: Any) -> None:
        super().__init__(*function_and_file)
        self._function = function_and_file[0]

    def get_source_stamp(self) -> Any:
        """The fingerprint of all that the function is made of."""
        return _Stamp(self._function)

    def get_disambiguator(self) -> str:
        """Tells functions of a file apart, also generated ones of the same text."""
        code = marshal.dumps(self._function.__code__, 2)
        origins = [(file, *sorted(words)) for file, words in _origins(self._function)]
        text = repr(sorted(origins)).encode()
        return hashlib.sha256(code + text).hexdigest()[:12] + self.mark


class InTree(_Stamped, InTreeCacheLocator):
    """A cache beside the source."""


class UserWide(_Stamped, UserWideCacheLocator):
    """One in the user's cache folder, for an installation that is read-only."""


class InnerInTree(InTree):
    """A cache beside the source, of what compiled functions call."""

    mark = "-inner"


class InnerUserWide(UserWide):
    """The same in the user's cache folder."""

    mark = "-inner"


@cache
def _layout(fields: tuple[Any, ...]) -> np.dtype:
    """The type of a record: one object, by which numba knows it at once.

    Equal ones it compares field by field, at every call.
    """
    return np.dtype(list(fields), align=True)


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
    record = np.zeros(1, _layout(tuple(layout)))
    for name, array in values.items():
        record[name] = array
    return record
