"""A wire that carries a signal wrongly for a while: sensors fail, an arm is slow."""

from collections.abc import Callable
from typing import Any

import numpy as np

from plants.faults.fault import Fault
from systems.common.block import Block
from systems.common.parameter import check
from systems.common.signal import view
from systems.common.signals import Fulcrum, TrackedShaft, Wrench
from systems.common.step_block import length

type Breaks = Callable[[np.ndarray, np.ndarray, float, float], None]
"""Spoils a signal's elements in place: these, those given before, size, period [s]."""


def _stuck(now: np.ndarray, before: np.ndarray, size: float, period: float) -> None:
    now[:] = before


def _flipped(now: np.ndarray, before: np.ndarray, size: float, period: float) -> None:
    wrench = view(Wrench, now)
    wrench.f[:], wrench.m[:] = -wrench.f, -wrench.m


def _biased(now: np.ndarray, before: np.ndarray, size: float, period: float) -> None:
    view(Wrench, now).f[0] += size


def _silent(now: np.ndarray, before: np.ndarray, size: float, period: float) -> None:
    now[:] = 0.0


def _in_future(now: np.ndarray, before: np.ndarray, size: float, period: float) -> None:
    view(TrackedShaft, now).time[...] += size


def _lost(now: np.ndarray, before: np.ndarray, size: float, period: float) -> None:
    view(TrackedShaft, now).valid[...] = 0.0


def _nan(now: np.ndarray, before: np.ndarray, size: float, period: float) -> None:
    now[:] = np.nan


def _slow(now: np.ndarray, before: np.ndarray, size: float, period: float) -> None:
    now[:] = before + np.clip(now - before, -size * period, size * period)


def _aside(now: np.ndarray, before: np.ndarray, size: float, period: float) -> None:
    view(Fulcrum, now).p[0] += size


def _deep(now: np.ndarray, before: np.ndarray, size: float, period: float) -> None:
    view(Fulcrum, now).p[2] += size


BREAKS: dict[str, Breaks] = {
    "force_stuck": _stuck,
    "force_flipped": _flipped,
    "force_bias": _biased,
    "force_silent": _silent,
    "frame_future": _in_future,
    "frame_lost": _lost,
    "estimate_nan": _nan,
    "tension_nan": _nan,
    "arm_slow": _slow,
    "fulcrum_aside": _aside,
    "fulcrum_deep": _deep,
}
"""How each kind of fault spoils a signal."""


class FaultyWire(Block):
    """Carries a signal; while its fault lasts it carries it wrongly.

    Port ``whole`` accepts the signal as it is.

    Port ``told`` emits what is told of it.
    """

    def __init__(
        self, fault: Fault | None = None, signal: Any = Wrench, period: float = 1 / 120
    ) -> None:
        """Makes the block.

        Args:
            fault: What fails; its kind has to suit the signal.
            signal: The signal's declaration, or its size.
            period: Of the signal's samples, in s.
        """
        super().__init__()
        self._fault = fault or Fault()
        check(self._fault, "faults")
        self._breaks, self._period = BREAKS[self._fault.kind], period
        size = length(signal)
        if isinstance(signal, int):
            self._whole = self.vector_in("whole", [0.0] * size)
        else:
            self._whole = self.signal_in("whole", signal)
            self.signals["told"] = signal
        # What was told at the last sample, whether the fault is on, and its start.
        start = self._fault.start
        first = [*np.zeros(size), self._is_on(0.0, start), start]
        self.DeclareDiscreteState(first)
        reads = {self._whole.ticket(), self.xd_ticket()}
        self.vector_out("told", size, self._calc_told, reads)
        self.update_every(period, self._update)

    def _calc_told(self, context: Any) -> np.ndarray:
        whole = self._whole.Eval(context).copy()
        state = context.get_discrete_state_vector().value()
        if state[-2]:
            self._breaks(whole, state[:-2], self._fault.size, self._period)
        return whole

    def strike(self, root: Any) -> float:
        """Lets the fault begin at the next sample but one; returns when that is, in s.

        A `Fault` that starts then is the same.
        """
        context = self.GetMyMutableContextFromRoot(root)
        start = float(context.get_time() + self._period)
        state = context.get_mutable_discrete_state_vector()
        state.SetAtIndex(state.size() - 1, start)
        return start

    def _is_on(self, time: float, start: float) -> float:
        """1 if a sample at a time is told wrongly, else 0."""
        since = time + 0.5 * self._period - start
        return float(0.0 < since <= self._fault.duration)

    def _update(self, context: Any) -> np.ndarray:
        start = context.get_discrete_state_vector().value()[-1]
        is_on = self._is_on(context.get_time() + self._period, start)
        return np.append(self._calc_told(context), (is_on, start))
