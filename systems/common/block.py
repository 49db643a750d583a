"""The base of all blocks: a digital controller with named, documented ports."""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from pydrake.common import RandomDistribution
from pydrake.common.value import AbstractValue
from pydrake.systems.framework import BasicVector, LeafSystem, ValueProducer

from systems.common.compiled import Numbers
from systems.common.signal import example_array, size
from systems.common.stopwatch import STOPWATCH


class VectorInput:
    """A vector input port that is read without a copy.

    `port.Eval` copies the vector, which takes nearly twice as long as looking at it
    where it lies in the cache; a control instant has some fifty of these reads. A
    reader must not write into what it gets, nor keep it.
    """

    __slots__ = ("HasValue", "_port", "vector")

    def __init__(self, port: Any) -> None:
        self._port = port
        self.vector = port.EvalBasicVector
        self.HasValue = port.HasValue

    def Eval(self, context: Any) -> np.ndarray:
        """The port's value in a context."""
        return self.vector(context).value()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._port, name)


class Block(LeafSystem):
    """A digital controller.

    Physics is continuous and native to Drake; a block has its own period and
    keeps its state in the context. Its ports are declared with the signals they carry
    (`systems.common.signal`).

    Drake's callbacks are C++ objects, which Python's collector does not see: a block
    that they refer to would stay in memory for ever. They refer to boxes instead, and
    `let_go` empties these.

    Attributes:
        signals: Every vector port's signal, by the port's name.
    """

    def __init__(self) -> None:
        super().__init__()
        self.signals: dict[str, Any] = {}
        self._boxes: list[list[Any]] = []

    def boxed(self, what: Any) -> list[Any]:
        """A list of one thing, for a callback of Drake's to refer to."""
        self._boxes.append([what])
        return self._boxes[-1]

    def DoCalcTimeDerivatives(self, context: Any, derivatives: Any) -> None:
        """Nothing: no block has a continuous state.

        Drake asks every block of Python at every step of an integration, and where none
        answers it throws and catches, which takes five times as long.
        """

    def let_go(self) -> None:
        """Lets go of all that it refers to; it will not be asked again."""
        for box in self._boxes:
            box.clear()
        self.__dict__.clear()

    def signal_in(
        self, name: str, signal: Any, drawn: RandomDistribution | None = None
    ) -> Any:
        """Declares an input port of a signal and returns it.

        Args:
            name: The port's name.
            signal: What it accepts.
            drawn: How its elements are drawn if it is noise.
        """
        self.signals[name] = signal
        return self.vector_in(name, example_array(signal).tolist(), drawn)

    def signal_out(
        self,
        name: str,
        signal: Any,
        calc: Callable[[Any], Numbers],
        prerequisites: set[Any],
    ) -> Any:
        """Declares an output port of a signal computed by `calc(context)`.

        Args:
            name: The port's name.
            signal: What it emits.
            calc: Returns the elements for a context; an array is taken over several
                times faster than a list.
            prerequisites: Tickets of all that `calc` reads, so that the value
                is cached and feedthrough is known.
        """
        self.signals[name] = signal
        return self.vector_out(name, size(signal), calc, prerequisites)

    def vector_in(
        self,
        name: str,
        example: Sequence[float],
        drawn: RandomDistribution | None = None,
    ) -> Any:
        """Declares a vector input port and returns it.

        Args:
            name: The port's name.
            example: A sensible value; its length is the port's size.
            drawn: How its elements are drawn if it is noise.
        """
        model = BasicVector(np.asarray(example, float))
        return VectorInput(self.DeclareVectorInputPort(name, model, drawn))

    def vector_out(
        self,
        name: str,
        size: int,
        calc: Callable[[Any], Numbers],
        prerequisites: set[Any],
    ) -> Any:
        """Declares a vector output port computed by `calc(context)`.

        Args:
            name: The port's name.
            size: Number of elements.
            calc: Returns the value for a context; an array is taken over several
                times faster than a list.
            prerequisites: Tickets of all that `calc` reads, so that the value
                is cached and feedthrough is known.
        """
        block, calculates = self.boxed(self), self.boxed(calc)

        def set_output(context: Any, output: Any) -> None:
            outermost = not STOPWATCH.running and STOPWATCH.begin()
            output.SetFromVector(calculates[0](context))
            if outermost:
                STOPWATCH.end(block[0].get_name(), context.get_time())

        return self.DeclareVectorOutputPort(name, size, set_output, prerequisites)

    def value_out(
        self,
        name: str,
        allocate: Callable[[], Any],
        calc: Callable[[Any, Any], None],
        prerequisites: set[Any],
    ) -> Any:
        """Declares an output port of an object.

        Args:
            name: The port's name.
            allocate: Makes the `Value`; it must not refer to the block.
            calc: Sets it for a context.
            prerequisites: Tickets of all that `calc` reads.
        """
        sets = self.boxed(calc)

        def set_output(context: Any, output: Any) -> None:
            sets[0](context, output)

        return self.DeclareAbstractOutputPort(name, allocate, set_output, prerequisites)

    def state_out(self, name: str, signal: Any, initial: np.ndarray) -> Any:
        """Declares a group of discrete state that is an output port as well.

        Cheaper than a computed output, and never feedthrough.

        Args:
            name: The port's name.
            signal: What it emits.
            initial: The state's initial value.

        Returns:
            The group's index.
        """
        self.signals[name] = signal
        group = self.DeclareDiscreteState(np.array(initial, float))
        self.DeclareStateOutputPort(name, group)
        return group

    def cached(
        self, name: str, calc: Callable[[Any], Any], prerequisites: set[Any]
    ) -> Any:
        """Declares a value that several outputs or the update share.

        Args:
            name: The cache entry's name.
            calc: Returns the value, any object, for a context. Readers must
                not change it.
            prerequisites: Tickets of all that `calc` reads.

        Returns:
            The cache entry: `Eval(context)` gives the value, `ticket()` makes
            it a prerequisite.
        """
        calculates = self.boxed(calc)

        def store(context: Any, value: Any) -> None:
            value.set_value(calculates[0](context))

        producer = ValueProducer(allocate=lambda: AbstractValue.Make([]), calc=store)
        return self.DeclareCacheEntry(name, producer, prerequisites)

    def finite_or_kept(self, context: Any, group: int, new: Any) -> np.ndarray:
        """The next value of a group of discrete state: it stays if `new` is not finite.

        For what an input says at an instant and a step uses at the next: so a block
        may read what is made of its own output.
        """
        value = np.array(new, float)
        if np.isfinite(value).all():
            return value
        kept: np.ndarray = context.get_discrete_state(group).value().copy()
        return kept

    def update_every(
        self, period: float, update: Callable[[Any], Numbers | Sequence[Any]]
    ) -> None:
        """Declares `update(context)` as the next value of the discrete state.

        The update is timed by the stopwatch; it must read nothing but the
        context. Call this after the state has been declared.

        Args:
            period: In seconds, > 0; the first update is at time zero.
            update: Returns the new state vector; with several groups of discrete
                state, one vector for each.

        Raises:
            ValueError: If the period is not positive.
        """
        if not period > 0.0:
            raise ValueError(f"{type(self).__name__}: period={period} s must be > 0")
        groups = self.num_discrete_state_groups()
        block, updates = self.boxed(self), self.boxed(update)

        def timed(context: Any, state: Any) -> None:
            outermost = not STOPWATCH.running and STOPWATCH.begin()
            value: Any = updates[0](context)
            if groups == 1:
                state.set_value(value)
            else:
                for group, vector in enumerate(value):
                    state.set_value(group, vector)
            if outermost:
                STOPWATCH.end(block[0].get_name(), context.get_time(), True)

        self.DeclarePeriodicDiscreteUpdateEvent(period, 0.0, timed)
