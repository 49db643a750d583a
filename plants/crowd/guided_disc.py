"""One obstacle of many that somebody drives while the simulation runs."""

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.crowd.signals import OBSTACLES
from systems.common.block import Block
from systems.common.parameter import check, parameter
from systems.common.signal import Field, example, view


class Place(NamedTuple):
    """A place on the floor."""

    x: Annotated[float, Field("m", "in W", 2.0)]
    y: Annotated[float, Field("m", "in W", 0.4)]


@dataclass
class GuidedDiscParams:
    """How a driven obstacle follows what is wanted of it."""

    rate: float = parameter(3.0, "speed per distance", "1/s", above=0, most=20)
    speed: float = parameter(0.8, "at the most", "m/s", above=0, most=5)
    period: float = parameter(0.05, "of the driver's reaction", "s", above=0, most=1)


class GuidedDisc(Block):
    """Drives one of the obstacles to where it is wanted, with bounded speed.

    Port ``others`` accepts all obstacles, rows of `Obstacle`.
    Port ``wanted`` accepts the `Place` where this one is wanted; not finite: it rests.
    Port ``obstacles`` emits all of them, this one where it has been driven.
    """

    def __init__(
        self,
        params: GuidedDiscParams | None = None,
        start: Place | None = None,
        row: int = 0,
    ) -> None:
        """Makes the block.

        Args:
            params: How it follows.
            start: Where it is at first; the example if None.
            row: Which of the obstacles it is.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        self._params = check(params or GuidedDiscParams())
        self._row = row
        self._others = self.signal_in("others", OBSTACLES)
        self._wanted = self.signal_in("wanted", Place)
        # Place and velocity since the last reaction, and its time.
        first = start or example(Place)
        self.DeclareDiscreteState([*first, 0.0, 0.0, 0.0])
        reads = {self._others.ticket(), self.xd_ticket(), self.time_ticket()}
        self.signal_out("obstacles", OBSTACLES, self._calc_obstacles, reads)
        self.update_every(self._params.period, self._react)

    def _now(self, context: Any) -> tuple[np.ndarray, np.ndarray]:
        """Place and velocity, (2) each."""
        x, y, v_x, v_y, since = context.get_discrete_state_vector().value()
        v = np.array([v_x, v_y])
        return np.array([x, y]) + (context.get_time() - since) * v, v

    def _calc_obstacles(self, context: Any) -> np.ndarray:
        rows = self._others.Eval(context).copy()
        mine = view(OBSTACLES, rows)
        (x, y), (v_x, v_y) = self._now(context)
        mine.x[self._row], mine.y[self._row] = x, y
        mine.v_x[self._row], mine.v_y[self._row] = v_x, v_y
        return rows

    def _react(self, context: Any) -> np.ndarray:
        place, _ = self._now(context)
        v = self._params.rate * (self._wanted.Eval(context) - place)
        speed = np.linalg.norm(v)
        v = v * min(1.0, self._params.speed / speed) if speed > 0.0 else v
        v = v if np.isfinite(v).all() else np.zeros(2)
        return np.array([*place, *v, context.get_time()])
