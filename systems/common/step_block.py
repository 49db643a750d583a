"""The base of blocks whose outputs and update are one step of one function."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from systems.common.block import Block


class StepBlock(Block):
    """A block that computes its next state and its outputs at once.

    Outputs are those of the step from the last update to now: no sample of delay.
    Outputs and update share it, so it is computed once an instant.
    """

    def declare_step(
        self,
        step: Callable[..., np.ndarray],
        inputs: Mapping[str, Sequence[float]],
        state: Sequence[float],
        outputs: Mapping[str, int],
        period: float,
        timed: bool = True,
        defaults: Mapping[str, np.ndarray] | None = None,
    ) -> None:
        """Declares ports, state and update.

        Args:
            step: Takes the state, the time in s if `timed`, and the inputs in their
                order; returns one array, the next state and then the outputs.
            inputs: Ports and their examples.
            state: The state at first.
            outputs: Ports and their sizes.
            period: In s.
            timed: Whether the step depends on the time.
            defaults: Values of ports that need not be connected.
        """
        ports = [(name, self.vector_in(name, inputs[name])) for name in inputs]
        self.DeclareDiscreteState(np.array(state, float))
        tickets = {port.ticket() for _, port in ports} | {self.xd_ticket()}
        spare = defaults or {}
        always = [port for name, port in ports if name not in spare]
        may_be = [(port, spare[name]) for name, port in ports if name in spare]
        if [name for name, _ in ports[len(always) :]] != [*spare]:
            raise ValueError("inputs with a default come last, in the same order")

        def calc(context: Any) -> np.ndarray:
            time = (context.get_time(),) if timed else ()
            told = [
                port.Eval(context) if port.HasValue(context) else value
                for port, value in may_be
            ]
            return step(
                context.get_discrete_state_vector().value(),
                *time,
                *[port.Eval(context) for port in always],
                *told,
            )

        shared = self.cached(
            "step", calc, tickets | ({self.time_ticket()} if timed else set())
        )
        first = len(state)
        for name, size in outputs.items():
            self._emit(shared, name, first, size)
            first += size
        self.update_every(period, lambda context: shared.Eval(context)[: len(state)])

    def _emit(self, shared: Any, name: str, first: int, size: int) -> None:
        last = first + size
        self.vector_out(
            name,
            size,
            lambda context: shared.Eval(context)[first:last],
            {shared.ticket()},
        )
