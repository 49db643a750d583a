"""Progress of long work on a terminal; silent in a pipe."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import sys

from tqdm import tqdm


@contextmanager
def progress_bar(
    label: str, unit: str = ""
) -> Iterator[Callable[[float, float], None]]:
    """A bar on standard error.

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
