"""Tool load: a force on the tool that grows with time."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from plants.snake.signals import ToolForce
from systems.common.block import Block
from systems.common.parameter import Rules, check, parameter


@dataclass
class ToolLoadParams:
    """Parameters of `ToolLoad`."""

    force: list[float] = parameter(
        [0.0, 0.0, 0.0],
        "f_T_W at last",
        "N",
        least=-10.0,
        most=10.0,
        shape=(3,),
    )
    start: float = parameter(0.0, "when it begins to grow", "s", least=0.0, most=1e4)
    end: float = parameter(1.0, "when it has grown", "s", least=0.0, most=1e4)

    def rules(self) -> Rules:
        """It takes time to grow."""
        yield self.start < self.end, "end", f"> start={self.start:g} s"


class ToolLoad(Block):
    """A force on the tool, constant in W, that grows steadily.

    Port ``force`` emits the `ToolForce`.
    """

    def __init__(self, params: ToolLoadParams | None = None) -> None:
        """Makes the block."""
        super().__init__()
        self._params = check(params or ToolLoadParams())
        self.signal_out("force", ToolForce, self._calc_force, {self.time_ticket()})

    def _calc_force(self, context: Any) -> np.ndarray:
        p = self._params
        share = (context.get_time() - p.start) / (p.end - p.start)
        return np.clip(share, 0.0, 1.0) * np.array(p.force)
