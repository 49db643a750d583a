"""Elastic wires: springs along the wires that can go slack, and snap."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from plants.snake.actuation import wire_lengths
from plants.snake.drive import SnakeDriveParams
from plants.snake.elastic import elastic_pull
from plants.snake.parameters import SnakeParams
from plants.snake.snake import FAR, NEAR_ANGLES, POSITIONS
from systems.common.block import Block
from systems.common.parameter import check, parameter
from systems.resection.wires.wire_drums import AXES


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

    Port ``state`` accepts the plant's positions, then velocities, of the snake [m,
    rad, m/s, rad/s] (26).

    Port ``lengths`` accepts what the drums have wound out, wires 0 to 8, and the
    translation [m] (10).

    Port ``rates`` accepts their time derivatives [m/s] (10).

    Port ``generalized_force`` emits torques on the snake's velocities; none acts on
    the translation [N, Nm] (13).

    Port ``tension`` emits the tension of wires 0 to 8 [N] (9).

    Port ``measured`` emits the length of each wire's path as drums with load cells
    see it, wound out plus stretch T/k, and the translation [m] (10). A slack wire's
    is wrong, and does not fit its module's others.

    Port ``travel`` emits the set-point of the translation's servo: position [m],
    zero (2).
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
        straight = wire_lengths(np.zeros(7), self._snake)
        # Compiles now, so that no run pays for it.
        elastic_pull(
            np.zeros(6), np.zeros(6), straight, np.zeros(9), self._snake, self._drive
        )
        self._state = self.vector_in("state", [0.0] * (2 * POSITIONS))
        self._lengths = self.vector_in("lengths", [*(straight - 2e-4), 0.0])
        self._rates = self.vector_in("rates", [0.0] * AXES)
        drums = {self._lengths.ticket(), self._rates.ticket()}
        inputs = {self._state.ticket(), *drums}
        if self._params.breaks:
            inputs.add(self.time_ticket())
        self._pull = self.cached("pull", self._calc_pull, inputs)
        ticket = {self._pull.ticket()}
        self.vector_out("generalized_force", POSITIONS, self._calc_force, ticket)
        self.vector_out("tension", 9, self._calc_tension, ticket)
        measured = {self._lengths.ticket(), *ticket}
        self.vector_out("measured", AXES, self._calc_measured, measured)
        self.vector_out("travel", 2, self._calc_travel, drums)

    def _calc_pull(self, context: Any) -> tuple[np.ndarray, np.ndarray]:
        """Tensions (9) and torques on a1, b1, ..., b3 (6)."""
        state = self._state.Eval(context)
        velocity = state[POSITIONS:]
        whole = np.ones(9)
        for item in self._params.breaks:
            if context.get_time() >= item.time:
                whole[item.wire] = 0.0
        return elastic_pull(
            (state[NEAR_ANGLES] + state[FAR]) / 2,
            (velocity[NEAR_ANGLES] + velocity[FAR]) / 2,
            self._lengths.Eval(context)[:9],
            self._rates.Eval(context)[:9],
            self._snake,
            self._drive,
            whole,
        )

    def _calc_force(self, context: Any) -> Sequence[float]:
        tau = 0.5 * self._pull.Eval(context)[1]  # both balls of a module alike
        force = np.zeros(POSITIONS)
        force[NEAR_ANGLES] = tau
        force[FAR] = tau
        return force.tolist()

    def _calc_tension(self, context: Any) -> Sequence[float]:
        return self._pull.Eval(context)[0].tolist()

    def _calc_measured(self, context: Any) -> Sequence[float]:
        lengths = np.array(self._lengths.Eval(context))  # a copy: ports are shared
        lengths[:9] += self._pull.Eval(context)[0] / self._drive.wire_stiffness
        return lengths.tolist()

    def _calc_travel(self, context: Any) -> Sequence[float]:
        s, rate = self._lengths.Eval(context)[9], self._rates.Eval(context)[9]
        return [float(s + self._drive.travel_lead * rate), 0.0]
