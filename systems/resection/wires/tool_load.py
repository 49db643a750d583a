"""Tool load: a force on the tool that grows with time, and what cutting resists."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from plants.snake.signals import ToolForce, ToolPose
from systems.common.block import Block
from systems.common.compiled import compiled
from systems.common.parameter import Rules, check, parameter
from systems.common.signal import view


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
    cutting: float = parameter(
        0.0, "that opposes the tool's motion besides", "N", least=0.0, most=3.0
    )
    tissue: float = parameter(
        60.0, "stiffness of what is cut, until it gives way", "N/m", above=0, most=1e5
    )
    period: float = parameter(
        0.02, "over which its motion is taken", "s", least=1e-3, most=0.1
    )

    def rules(self) -> Rules:
        """It takes time to grow."""
        yield self.start < self.end, "end", f"> start={self.start:g} s"


@compiled
def resisting(
    before: np.ndarray, moved: np.ndarray, stiffness: float, most: float
) -> np.ndarray:
    """What tissue does to a tool in N (3,): it is drawn along until it gives way.

    A force that followed the sign of the last motion at once would have a tool that is
    slow chatter, a sample to and a sample fro.

    Args:
        before: What it did before, (3,).
        moved: The tool's way since, (3,) in m.
        stiffness: Of tissue, in N/m.
        most: At which it gives way, in N.
    """
    f = before - stiffness * moved
    return f * min(1.0, most / max(np.sqrt((f * f).sum()), 1e-300))


@compiled
def cut(last: np.ndarray, p: np.ndarray, stiffness: float, most: float) -> np.ndarray:
    """Where the tool is, and what resists it, (6,), from its place p_WT (3,).

    A place that is no number leaves the last; before the first there is no motion.
    """
    if not np.isfinite(p).all():
        return last.copy()
    moved = p - last[:3] if np.isfinite(last).all() else np.zeros(3)
    return np.append(p, resisting(last[3:], moved, stiffness, most))


class ToolLoad(Block):
    """A force on the tool, constant in W, that grows steadily, and one against motion.

    Port ``tool`` accepts the `ToolPose`, of which the last period's motion counts; it
    need not be connected.
    Port ``force`` emits the `ToolForce`.
    """

    def __init__(self, params: ToolLoadParams | None = None) -> None:
        """Makes the block."""
        super().__init__()
        self._params = check(params or ToolLoadParams())
        self._force = np.array(self._params.force)
        self._tool = self.signal_in("tool", ToolPose)
        # Where the tool was at the last update, and what opposed its motion.
        self.DeclareDiscreteState(np.append([np.nan] * 3, [0.0] * 3))
        tickets = {self.time_ticket(), self.xd_ticket()}
        self.signal_out("force", ToolForce, self._calc_force, tickets)
        self.update_every(self._params.period, self._calc_next)

    def _calc_next(self, context: Any) -> np.ndarray:
        last = context.get_discrete_state(0).value()
        if not self._tool.HasValue(context):
            return np.array(last)
        c, tool = self._params, view(ToolPose, self._tool.Eval(context))
        return cut(last, np.array(tool.p), c.tissue, c.cutting)

    def _calc_force(self, context: Any) -> np.ndarray:
        p = self._params
        share = (context.get_time() - p.start) / (p.end - p.start)
        f: np.ndarray = context.get_discrete_state(0).value()[3:]
        return f + min(max(share, 0.0), 1.0) * self._force
