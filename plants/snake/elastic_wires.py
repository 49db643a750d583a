"""Elastic wires: springs along the wires that can go slack, and snap."""

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.snake.drive import SnakeDriveParams
from plants.snake.elastic import elastic_pull
from plants.snake.parameters import MODULES, WIRES, SnakeParams
from plants.snake.signals import DrumRates, Drums, Numbers, SnakeState, Tensions
from plants.snake.snake import FAR, NEAR_ANGLES, POSITIONS
from systems.common.block import Block
from systems.common.parameter import check, parameter
from systems.common.signal import Field, example, flat, view

WHOLE = np.ones(WIRES * MODULES)
"""1 for each wire that is whole."""


class JointForces(NamedTuple):
    """Forces on the snake's velocities."""

    tau: Annotated[Numbers, Field("N, N m", "none on s", (0.0,) * POSITIONS)]


class TravelSetPoint(NamedTuple):
    """What the translation's servo is told."""

    s: Annotated[float, Field("m", "where it is to be", 0.0)]
    v: Annotated[float, Field("m/s", "its rate, always zero", 0.0)]


@dataclass
class WireBreak:
    """A wire that snaps."""

    wire: int = parameter(0, "which", least=0, most=8)
    time: float = parameter(0.0, "when", "s", least=0.0, most=1e5)


@dataclass
class ElasticWiresParams:
    """Parameters of `ElasticWires`."""

    breaks: list[WireBreak] = parameter([], "wires that snap", shape=(-1,))


class ElasticWires(Block):
    """Tensions of elastic wires and the joint torques that they exert.

    With the drums at length L_d and the wire's path L(q), a wire pulls with

        T = max(0, k (L - L_d) + c (dL/dt - dL_d/dt)),   tau = -(dL/dq)^T T,

    and a broken one not at all. It stands beside the drum model as its validation;
    explicit in the integrator, it needs short steps, 0.4 ms at most.

    Port ``state`` accepts the plant's `SnakeState`.
    Port ``lengths`` accepts what the drums have wound out, `Drums`.
    Port ``rates`` accepts their `DrumRates`.
    Port ``generalized_force`` emits the `JointForces`; none acts on the translation.
    Port ``tension`` emits the `Tensions`.
    Port ``measured`` emits the length of each wire's path as drums with load cells see
    it, wound out plus stretch T/k, as `Drums`. A slack wire's is wrong, and does not
    fit its module's others.
    Port ``travel`` emits the `TravelSetPoint`.
    """

    def __init__(
        self,
        params: ElasticWiresParams | None = None,
        snake: SnakeParams | None = None,
        drive: SnakeDriveParams | None = None,
    ) -> None:
        """Makes the block."""
        super().__init__()
        self._params = check(params or ElasticWiresParams())
        self._snake = check(snake or SnakeParams())
        self._drive = check(drive or SnakeDriveParams())
        self._state = self.signal_in("state", SnakeState)
        self._lengths = self.signal_in("lengths", Drums)
        self._rates = self.signal_in("rates", DrumRates)
        # Compiles now, so that no run pays for it.
        still = np.zeros(2 * MODULES)
        self._pulled(still, still, example(Drums), example(DrumRates), WHOLE)
        drums = {self._lengths.ticket(), self._rates.ticket()}
        inputs = {self._state.ticket(), *drums}
        if self._params.breaks:
            inputs.add(self.time_ticket())
        self._pull = self.cached("pull", self._calc_pull, inputs)
        ticket = {self._pull.ticket()}
        self.signal_out("generalized_force", JointForces, self._calc_force, ticket)
        self.signal_out("tension", Tensions, self._calc_tension, ticket)
        measured = {self._lengths.ticket(), *ticket}
        self.signal_out("measured", Drums, self._calc_measured, measured)
        self.signal_out("travel", TravelSetPoint, self._calc_travel, drums)

    def _pulled(
        self, ab: Any, ab_rate: Any, drums: Drums, rates: DrumRates, whole: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        return elastic_pull(
            ab, ab_rate, drums.wires, rates.wires, self._snake, self._drive, whole
        )

    def _calc_pull(self, context: Any) -> tuple[np.ndarray, np.ndarray]:
        """Tensions (9) and torques on a1, b1, ..., b3 (6)."""
        state = view(SnakeState, self._state.Eval(context))
        whole = WHOLE.copy()
        for item in self._params.breaks:
            if context.get_time() >= item.time:
                whole[item.wire] = 0.0
        return self._pulled(
            (state.q[NEAR_ANGLES] + state.q[FAR]) / 2,
            (state.v[NEAR_ANGLES] + state.v[FAR]) / 2,
            view(Drums, self._lengths.Eval(context)),
            view(DrumRates, self._rates.Eval(context)),
            whole,
        )

    def _calc_force(self, context: Any) -> np.ndarray:
        _, tau = self._pull.Eval(context)
        force = np.zeros(POSITIONS)
        force[NEAR_ANGLES] = force[FAR] = 0.5 * tau  # both balls of a module alike
        return force

    def _calc_tension(self, context: Any) -> np.ndarray:
        tension: np.ndarray
        tension, _ = self._pull.Eval(context)
        return tension

    def _calc_measured(self, context: Any) -> np.ndarray:
        drums = view(Drums, self._lengths.Eval(context))
        tension, _ = self._pull.Eval(context)
        return np.append(drums.wires + tension / self._drive.wire_stiffness, drums.s)

    def _calc_travel(self, context: Any) -> np.ndarray:
        drums = view(Drums, self._lengths.Eval(context))
        rates = view(DrumRates, self._rates.Eval(context))
        return flat(TravelSetPoint(drums.s + self._drive.travel_lead * rates.s, 0.0))
