"""What comes into a diagram from outside: a hand at a slider, another program."""

from pathlib import Path
from typing import Any

import numpy as np

from systems.common.block import Block
from systems.common.signal import example, flat, size
from systems.common.signals import Point
from systems.common.tape import load_tape

PERIOD = 1.0 / 60.0
"""Between two times that it is asked [s]."""


class Outside(Block):
    """Tells the diagram what somebody outside said last, or what a tape says.

    Whoever runs the diagram says it between two advances (`say`); it is taken at the
    next instant. A tape of what was said, and when, gives the same values at the same
    instants.

    Port ``told`` emits it, a `Point` or whatever signal it was made for.
    """

    def __init__(
        self,
        signal: Any = Point,
        rest: Any = None,
        tape: str | Path | None = None,
        period: float = PERIOD,
    ) -> None:
        """Makes the block.

        Args:
            signal: What is said, its declaration.
            rest: What holds until something is said, a value of it.
            tape: What is said if nobody says anything, see `load_tape`.
            period: Between two times that it is asked, in s.

        Raises:
            ValueError: If the tape cannot be used.
        """
        super().__init__()
        self._times, self._rows = np.zeros(0), np.zeros((0, size(signal)))
        if tape:
            self._times, self._rows = load_tape(tape, signal)
        first = flat(example(signal) if rest is None else rest)
        self.state_out("told", signal, first)
        self._said = self.DeclareDiscreteState(np.full(size(signal), np.nan))
        self.update_every(period, self._update)

    def say(self, root: Any, value: Any) -> None:
        """Says something, in the root diagram's context; it must be finite."""
        context = self.GetMyMutableContextFromRoot(root)
        context.get_mutable_discrete_state(self._said).set_value(flat(value))

    def _update(self, context: Any) -> tuple[np.ndarray, np.ndarray]:
        said = context.get_discrete_state(self._said).value()
        if np.isfinite(said).all():
            return said, said
        line = np.searchsorted(self._times, context.get_time(), side="right") - 1
        before = context.get_discrete_state(0).value()
        return self._rows[line] if line >= 0 else before, said
