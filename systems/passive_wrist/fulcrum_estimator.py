"""The fulcrum estimator as a block (paper section 3; Figure 3's I from F_a).

The algorithm stands in `fulcrum_tracker`, the filter in `fulcrum_filter`.
"""

from typing import Annotated, Any, NamedTuple

import numpy as np

from systems.common.block import Block
from systems.common.signal import Field
from systems.common.signals import Fulcrum, ShaftMotion, Wrench
from systems.passive_wrist.fulcrum_filter import FulcrumParams
from systems.passive_wrist.fulcrum_tracker import FulcrumTracker

type Matrix = tuple[float, float, float, float, float, float, float, float, float]

_ENTRIES = tuple(f"{a}{b}" for a in "xyz" for b in "xyz")
_EXAMPLE = (1e-8, 0.0, 0.0, 0.0, 1e-8, 0.0, 0.0, 0.0, 1e-6)


class Covariance(NamedTuple):
    """Of the fulcrum."""

    P: Annotated[Matrix, Field("m^2", "of p_WI, row by row", _EXAMPLE, _ENTRIES)]


class FulcrumEstimator(Block):
    """Finds the fulcrum from the wall's force and the shaft's pose.

    Recursive estimate of the fulcrum with covariance; breathing is learnt and
    predicted, stiffness is learnt while it can be seen, a jump of the wall is
    followed. At an instant of its clock the outputs already hold that instant's
    reading (they are feedthrough), between instants the state's. Without a valid
    reading it goes on predicting.

    Port ``shaft`` accepts the `ShaftMotion`.

    Port ``wrench`` accepts the `Wrench`.

    Port ``estimate`` emits the `Fulcrum` now; its phase is 0 before the first reading,
    1 while it follows, 2 once the wall's motion is understood.

    Port ``covariance`` emits the `Covariance`.
    """

    def __init__(self, params: FulcrumParams | None = None) -> None:
        """Makes the block."""
        super().__init__()
        self._p = params or FulcrumParams()
        self._tracker = FulcrumTracker(self._p)
        self._shaft = self.signal_in("shaft", ShaftMotion)
        self._wrench = self.signal_in("wrench", Wrench)
        self.DeclareDiscreteState(self._tracker.initial())
        self._time = self._tracker.at("time")
        read = {
            self.xd_ticket(),
            self.time_ticket(),
            self._shaft.ticket(),
            self._wrench.ticket(),
        }
        self._posterior = self.cached("posterior", self._calc_posterior, read)
        after = {self._posterior.ticket(), self.time_ticket(), self._shaft.ticket()}
        self.signal_out("estimate", Fulcrum, self._calc_estimate, after)
        self.signal_out("covariance", Covariance, self._calc_covariance, after)
        self.update_every(self._p.period, self._posterior.Eval)

    def _calc_posterior(self, context: Any) -> np.ndarray:
        """The state with this instant's reading, once and only once."""
        state = context.get_discrete_state_vector().value()
        time = context.get_time()
        if time - state[self._time] < 0.5 * self._p.period:
            return state.copy()
        shaft, wrench = self._shaft.Eval(context), self._wrench.Eval(context)
        return self._tracker.step(state, shaft, wrench, time)

    def _calc_estimate(self, context: Any) -> np.ndarray:
        z, shaft = self._posterior.Eval(context), self._shaft.Eval(context)
        return self._tracker.report(z, context.get_time(), shaft)

    def _calc_covariance(self, context: Any) -> np.ndarray:
        return self._tracker.covariance(self._posterior.Eval(context))
