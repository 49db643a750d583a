"""Progress of long work: bars on a terminal, or nothing."""

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
import sys

from tqdm import tqdm

Show = Callable[[float, float], None]
"""To be called with how far it is, and the whole."""
Progress = Callable[[str, str], AbstractContextManager[Show]]
"""Called with what is going on, and the unit of what is shown of it."""


@contextmanager
def silent(label: str, unit: str = "") -> Iterator[Show]:
    """No progress."""
    yield lambda value, whole: None


@contextmanager
def progress_bar(label: str, unit: str = "") -> Iterator[Show]:
    """A bar on standard error; silent in a pipe.

    Args:
        label: What is going on.
        unit: Of the values shown.

    Yields:
        To be called with how far it is, and the whole.
    """
    shown = "{l_bar}{bar}| {n:.4g} of {total:.4g}" + f" {unit} [{{elapsed}}]"
    with tqdm(
        total=1.0,
        desc=label,
        disable=not sys.stderr.isatty(),
        bar_format=shown,
        leave=False,
    ) as bar:

        def show(value: float, whole: float) -> None:
            bar.total = whole
            bar.update(value - bar.n)

        yield show


def progress_of(name: str, progress: Progress) -> Progress:
    """The progress of a part of the work, its name before every label."""
    return lambda label, unit: progress(f"{name}: {label}", unit)
