"""Procedure chooser: what is chosen while the robot works, line by line."""

from bisect import bisect_right
from collections.abc import Callable, Iterable
from typing import Any

import numpy as np

from systems.common.block import Block
from systems.resection.wires.online_player import (
    Accepted,
    Page,
    Taken,
    Waiting,
    standing,
)

TIGHT = 1e-9
"""By which an instant may be before a line's time, in s."""


class Book:
    """Lines that choose, and the plan after each: things are only ever added to it.

    So a number tells a plan, and a context that holds it holds the plan.

    Attributes:
        pages: The plan before any line, and after each that was answered.
        lines: When, in s, and what.
        hear: What somebody says, asked at every instant: its time in s, and the last
            posture taken. Whoever has it answered at once says nothing here.
        heed: Told at every instant the time, and why the robot waits, a `Wait`.
    """

    def __init__(
        self,
        first: Page,
        answer: Callable[[str, int, float], Page] | None = None,
        lines: Iterable[tuple[float, str]] = (),
    ) -> None:
        """Makes a book.

        Args:
            first: The plan before any line.
            answer: Does what a line says, and returns the plan then; it is told the
                last posture taken, and the time in s.
            lines: Said already: when, in s, and what, in their order.
        """
        self.pages = [first]
        self.lines = list(lines)
        self.hear: Callable[[float, int], Iterable[str]] = lambda time, taken: ()
        self.heed: Callable[[float, int], None] = lambda time, reason: None
        self._answer = answer

    def due(self, time: float) -> int:
        """How many lines are due by a time in s."""
        return bisect_right(self.lines, time + TIGHT, key=lambda line: line[0])

    def say(self, time: float, line: str) -> None:
        """Adds a line that is due at a time in s, or when the last one is."""
        self.lines.append((max(time, self.lines[-1][0] if self.lines else time), line))

    def read(self, number: int, taken: int, time: float) -> int:
        """Answers lines up to a number of them, but those answered before."""
        while len(self.pages) <= number:
            _, line = self.lines[len(self.pages) - 1]
            assert self._answer is not None
            self.pages.append(self._answer(line, taken, time))
        return number


class ProcedureChooser(Block):
    """Has lines answered when their time comes, and says which plan holds then.

    A line is answered at the first instant that is not before its time. What answers
    takes no simulated time, however long it thinks. State is the page; what was
    answered once is not answered again, also in another context.

    Port ``taken`` accepts what the robot has `Taken`.
    Port ``waiting`` accepts why it waits, `Waiting`; nobody heeds it if unconnected.
    Port ``accepted`` emits the `Accepted` page.
    """

    def __init__(self, book: Book | None = None, period: float = 0.02) -> None:
        """Makes the block.

        Args:
            book: Of lines and plans; an empty one if None.
            period: In s.
        """
        super().__init__()
        self.book = book or Book(standing(4e-3))
        self._taken = self.signal_in("taken", Taken)
        self._waiting = self.signal_in("waiting", Waiting)
        self.state_out("accepted", Accepted, np.zeros(1))
        self.update_every(period, self._update)

    def _update(self, context: Any) -> list[float]:
        (page,) = context.get_discrete_state(0).value().tolist()
        (taken,) = self._taken.Eval(context).tolist()
        if not np.isfinite(taken):
            return [page]
        book, time, last = self.book, context.get_time(), int(taken)
        if self._waiting.HasValue(context):
            (reason,) = self._waiting.Eval(context).tolist()
            book.heed(time, int(reason) if np.isfinite(reason) else 0)
        for line in book.hear(time, last):
            book.say(time, line)
        number = book.read(max(book.due(time), int(page)), last, time)
        return [float(number)]
