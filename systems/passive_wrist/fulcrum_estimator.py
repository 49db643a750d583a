"""The fulcrum estimator as a block (paper section 3; Figure 3's I from F_a).

The algorithm stands in `fulcrum_tracker`, the filter in `fulcrum_filter`.
"""

from typing import Any

import numpy as np

from systems.common.block import Block
from systems.passive_wrist.fulcrum_filter import FulcrumParams
from systems.passive_wrist.fulcrum_tracker import FulcrumTracker

__all__ = ["FulcrumEstimator", "FulcrumParams"]


class FulcrumEstimator(Block):
    """Finds the fulcrum from the wall's force and the shaft's pose.

    Recursive estimate of the fulcrum with covariance; breathing is learnt and
    predicted, stiffness is learnt while it can be seen, a jump of the wall is
    followed. At an instant of its clock the outputs already hold that instant's
    reading (they are feedthrough), between instants the state's. Without a valid
    reading it goes on predicting.

    Port ``shaft`` accepts p_WS [m], u_W, v_WS [m/s], du_W/dt [1/s] (12).

    Port ``wrench`` accepts the wall's force on the shaft [N], its moment about the
    sensor's origin [N m], and 1 if the sensor is alive (7).

    Port ``estimate`` emits p_WI [m] and v_WI [m/s] now, sigma across the shaft and
    along it [m], stiffness [N/m], sigma of its logarithm, breathing rate [Hz, 0 if
    none is seen], phase (0 before the first reading, 1 following, 2 the wall's
    motion understood), jumps followed and estimates refused so far (14).

    Port ``covariance`` emits the covariance of p_WI, row by row (9), in m^2.
    """

    def __init__(self, params: FulcrumParams | None = None) -> None:
        """Makes the block."""
        super().__init__()
        self._p = params or FulcrumParams()
        self._tracker = FulcrumTracker(self._p)
        self._shaft = self.vector_in(
            "shaft", [0.0, 0.0, 0.22, 0.0, 0.0, -1.0, *[0.0] * 6]
        )
        self._wrench = self.vector_in("wrench", [0.1, 0.0, 0.0, 0.0, 0.02, 0.0, 1.0])
        self._state = self.DeclareDiscreteState(self._tracker.initial())
        self._time = self._tracker.at("time")
        read = {
            self.xd_ticket(),
            self.time_ticket(),
            self._shaft.ticket(),
            self._wrench.ticket(),
        }
        self._posterior = self.cached("posterior", self._calc_posterior, read)
        after = {self._posterior.ticket(), self.time_ticket()}
        self.vector_out("estimate", 14, self._calc_estimate, after)
        self.vector_out("covariance", 9, self._calc_covariance, after)
        self.update_every(self._p.period, self._posterior.Eval)

    def _calc_posterior(self, context: Any) -> np.ndarray:
        """The state with this instant's reading, once and only once."""
        state = context.get_discrete_state(self._state).value()
        time = context.get_time()
        if time - state[self._time] < 0.5 * self._p.period:
            return state.copy()
        shaft, wrench = self._shaft.Eval(context), self._wrench.Eval(context)
        return self._tracker.step(state, shaft, wrench, time)

    def _calc_estimate(self, context: Any) -> Any:
        z, u = self._posterior.Eval(context), self._shaft.Eval(context)[3:6]
        return self._tracker.report(z, u, context.get_time())

    def _calc_covariance(self, context: Any) -> Any:
        return self._tracker.covariance(self._posterior.Eval(context)).reshape(-1)
