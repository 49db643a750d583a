"""A block whose output is what somebody outside the diagram has decided."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from pydrake.systems.framework import BasicVector

from systems.common.block import Block
from systems.common.signal import flat


class Command(Block):
    """Takes a planner's place: its action is a parameter of the context.

    Its ports are those of the block that it replaces; inputs are not read. The port
    that is commanded emits the action, the others their example.
    """

    def __init__(
        self,
        inputs: Mapping[str, Any],
        outputs: Mapping[str, Any],
        commanded: str,
        rest: Sequence[float],
    ) -> None:
        """Makes the block.

        Args:
            inputs: Ports and their signals.
            outputs: Ports and the values that they emit, signals.
            commanded: The port of the action.
            rest: The action at first.
        """
        super().__init__()
        for name, signal in inputs.items():
            self.signal_in(name, signal)
        self.DeclareNumericParameter(BasicVector(np.array(rest, float)))
        ticket = {self.all_parameters_ticket()}
        for name, value in outputs.items():
            told = flat(value)
            calc = self._action if name == commanded else lambda _, told=told: told
            self.signal_out(name, type(value), calc, ticket)

    def _action(self, context: Any) -> np.ndarray:
        action: np.ndarray = context.get_numeric_parameter(0).value()
        return action

    def set_action(self, root: Any, action: Sequence[float] | np.ndarray) -> None:
        """Sets the action in the root diagram's context."""
        context = self.GetMyMutableContextFromRoot(root)
        context.get_mutable_numeric_parameter(0).SetFromVector(np.asarray(action))
