"""The base of blocks whose update is one compiled step."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache
import hashlib
from itertools import pairwise
from typing import Any

import numpy as np

from systems.common.block import Block
from systems.common.compiled import generated, inlined
from systems.common.signal import Many, elements, flat, reading, size

type Step = Callable[..., np.ndarray]


def length(signal: Any) -> int:
    """Number of elements of a signal, or of an array where its size stands for it."""
    return signal if isinstance(signal, int) else size(signal)


def _taken(signal: Any, array: str) -> str:
    if isinstance(signal, Many):
        return f"{array}.reshape(({len(signal.names)}, {size(signal.signal)}))"
    return array if isinstance(signal, int) else reading(signal, array)


def _given(signal: Any, value: str, first: int) -> list[str]:
    if isinstance(signal, int):
        return [f"array[{first}:{first + signal}] = {value}"]
    if isinstance(signal, Many):
        return [f"array[{first}:{first + size(signal)}] = {value}.ravel()"]
    parts = enumerate(elements(signal, value), first)
    return [f"array[{i}] = {part}" for i, part in parts]


def wired(
    step: Callable[..., Any],
    constants: int,
    states: Sequence[Any],
    inputs: Sequence[Any],
    gives: Sequence[Any],
    timed: bool,
) -> Step:
    """A compiled step on signals as a map of the arrays that ports and context have.

    Args:
        step: A compiled function of records of constants, states, the time in s if
            `timed`, and inputs; it returns a tuple.
        constants: Number of records.
        states: Signals of the states. Where a size stands instead of a signal, here
            and below, the step takes and gives an array.
        inputs: Signals of the inputs.
        gives: Signals of what it returns.
        timed: Whether the step takes the time.

    Returns:
        The map; it returns one array, what the step returns one after the other. All
        blocks of a kind share its code: compiled code is never freed.
    """
    kinds = tuple(states), tuple(inputs), tuple(gives)
    run, n = _wired(step, constants, *kinds, timed), sum(map(length, gives))

    def given(*arrays: Any) -> np.ndarray:
        array = np.empty(n)
        run(*arrays, array)
        return array

    return given


@cache
def _wired(
    step: Callable[..., Any],
    constants: int,
    states: tuple[Any, ...],
    inputs: tuple[Any, ...],
    gives: tuple[Any, ...],
    timed: bool,
) -> Callable[..., None]:
    """As `wired`, but the map writes into its last argument.

    To return an array of its own costs a compiled function two calls of Python.
    """
    kinds = [*states, *inputs]
    records = [f"k{i}" for i in range(constants)]
    arrays = [f"a{i}" for i in range(len(kinds))]
    values = [f"x{i}" for i in range(len(gives))]
    taken = [_taken(kind, array) for kind, array in zip(kinds, arrays, strict=True)]
    for names in (arrays, taken):
        names[len(states) : len(states)] = ["time"] if timed else []
    given = ", ".join([*(f"{record}[0]" for record in records), *taken])
    lines = [f"{', '.join(values)}, = step({given})"]
    first = 0
    for signal, value in zip(gives, values, strict=True):
        lines += _given(signal, value, first)
        first += length(signal)
    body = "".join(f"    {line}\n" for line in lines)
    # The cache knows a function by its name and the types of its arguments.
    mark = hashlib.sha256(body.encode()).hexdigest()[:8]
    name = f"{step.__name__.strip('_')}_{mark}"
    source = f"def {name}({', '.join([*records, *arrays])}, array):\n{body}"
    signals = [kind for kind in kinds if not isinstance(kind, int | Many)]
    known = {signal.__name__: signal for signal in signals}
    return generated(source, name, step, {**known, "step": inlined(step), "np": np})


class StepBlock(Block):
    """A block that computes its next state, and its outputs with it, in one step."""

    def declare_step(
        self,
        step: Callable[..., Any],
        constants: Sequence[np.ndarray],
        inputs: Mapping[str, Any],
        state: Any,
        outputs: Mapping[str, Any],
        period: float,
        timed: bool = True,
        defaults: Mapping[str, Any] | None = None,
        shared: bool = True,
    ) -> None:
        """Declares ports, state and update; outputs are those of the step.

        They are of the step from the last update to now: no sample of delay. Outputs
        and update share it, so it is computed once an instant; not so if an integrator
        asks for the output at all its stages, where to share costs more than to step.

        Args:
            step: Returns the next state and the outputs; see `wired`.
            constants: Records of constants, as `packed` makes them.
            inputs: Ports and their signals.
            state: The state at first: a signal's value, or an array.
            outputs: Ports and their signals.
            period: In s.
            timed: Whether the step depends on the time.
            defaults: Values of ports that need not be connected.
            shared: Whether outputs and update share a step.
        """
        kind = _kind(state)
        gives = [kind, *outputs.values()]
        run, tickets = self._runner(
            step, constants, [kind], inputs, gives, timed, defaults or {}
        )
        self.DeclareDiscreteState(_array(state))
        tickets, last = tickets | {self.xd_ticket()}, length(kind)
        if shared:
            once = self.cached("step", run, tickets)
            run, tickets = once.Eval, {once.ticket()}
        self._emit(run, tickets, outputs, last)
        self.update_every(period, lambda context: run(context)[:last])

    def declare_update(
        self,
        update: Callable[..., Any],
        constants: Sequence[np.ndarray],
        inputs: Mapping[str, Any],
        states: Mapping[str, Any],
        period: float,
        timed: bool = True,
        defaults: Mapping[str, Any] | None = None,
    ) -> None:
        """Declares ports and states that are outputs as well: a sample of delay.

        Args:
            update: Returns the next states; see `wired`.
            constants: Records of constants, as `packed` makes them.
            inputs: Ports and their signals.
            states: Their values at first, signals or arrays, by their ports' names; of
                a name that begins with `_` there is no port.
            period: In s.
            timed: Whether the update depends on the time.
            defaults: Values of ports that need not be connected.
        """
        kinds = [_kind(state) for state in states.values()]
        run, _ = self._runner(
            update, constants, kinds, inputs, kinds, timed, defaults or {}
        )
        for (name, state), kind in zip(states.items(), kinds, strict=True):
            if name.startswith("_"):
                self.DeclareDiscreteState(_array(state))
            else:
                self.state_out(name, kind, _array(state))
        ends = np.cumsum([length(kind) for kind in kinds]).tolist()
        parts = [slice(*pair) for pair in pairwise([0, *ends])]

        def of_context(context: Any) -> list[np.ndarray]:
            array = run(context)
            return [array[part] for part in parts]

        self.update_every(period, run if len(kinds) == 1 else of_context)

    def declare_map(
        self,
        function: Callable[..., Any],
        constants: Sequence[np.ndarray],
        inputs: Mapping[str, Any],
        output: str,
        signal: Any,
    ) -> None:
        """Declares ports, of which one is a map of the others: no state, no time.

        Args:
            function: Returns the output, as a tuple of one; see `wired`.
            constants: Records of constants, as `packed` makes them.
            inputs: Ports and their signals.
            output: The port of the output.
            signal: Its signal.
        """
        run, tickets = self._runner(
            function, constants, [], inputs, [signal], False, {}
        )
        self.signal_out(output, signal, run, tickets)

    def _runner(
        self,
        step: Callable[..., Any],
        constants: Sequence[np.ndarray],
        states: Sequence[Any],
        inputs: Mapping[str, Any],
        gives: Sequence[Any],
        timed: bool,
        defaults: Mapping[str, Any],
    ) -> tuple[Callable[[Any], np.ndarray], set[Any]]:
        """The step as a function of the context, and the tickets of what it reads."""
        kinds = tuple(states), tuple(inputs.values()), tuple(gives)
        run = _wired(step, len(constants), *kinds, timed)
        ports = {name: self.signal_in(name, inputs[name]) for name in inputs}
        tickets = {port.ticket() for port in ports.values()}
        if timed:
            tickets |= {self.time_ticket()}
        # One function, for a call costs as much as what it reads.
        names: dict[str, Any] = {"run": run, "empty": np.empty}
        names |= {f"k{i}": constant for i, constant in enumerate(constants)}
        taken = [f"k{i}" for i in range(len(constants))]
        taken += [
            f"context.get_discrete_state({i}).value()" for i in range(len(states))
        ]
        taken += ["context.get_time()"] if timed else []
        for i, (name, port) in enumerate(ports.items()):
            names |= {f"e{i}": port.vector, f"h{i}": port.HasValue}
            read = f"e{i}(context).value()"
            if name in defaults:
                names[f"d{i}"] = flat(defaults[name])
                read = f"({read} if h{i}(context) else d{i})"
            taken.append(read)
        source = (
            "def of_context(context):\n"
            f"    array = empty({sum(map(length, gives))})\n"
            f"    run({', '.join([*taken, 'array'])})\n"
            "    return array\n"
        )
        exec(source, names)
        return names["of_context"], tickets

    def _emit(
        self,
        run: Callable[[Any], np.ndarray],
        tickets: set[Any],
        outputs: Mapping[str, Any],
        first: int,
    ) -> None:
        """Declares outputs that are an array's parts from `first` on."""
        for name, signal in outputs.items():
            last = first + length(signal)

            def part(context: Any, first: int = first, last: int = last) -> np.ndarray:
                return run(context)[first:last]

            self.signal_out(name, signal, part, tickets)
            first = last


def _kind(state: Any) -> Any:
    return len(state) if isinstance(state, np.ndarray) else type(state)


def _array(state: Any) -> np.ndarray:
    return state if isinstance(state, np.ndarray) else flat(state)
