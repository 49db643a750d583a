"""The passive wrist emulation as a block (paper section 3, Figures 2 and 3).

Stability. Let the arm follow with H e^(-s tau), the estimator low-pass with G, the
believed stiffness be K^, kappa = K / K^. Moving the shaft moves the force that the
estimate is made of; the estimator takes its own motion away again, so the loop is

    L(s) = H e^(-s tau) G (kappa e^(-s d) - 1),

d being how late the force is against the pose. With kappa = 1 and d = 0 it is open:
no delay can make it ring. With 0 < kappa < 2, d = 0 and |H G| <= 1 it is stable for
every delay (small gain). A stiffness believed too low is what rings, so K is learnt
from above, and force and pose are read at one instant.

The law stands in `wrist_law`.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from systems.common.block import Block
from systems.passive_wrist.wrist_law import (
    FROZEN,
    SCALE,
    TIME,
    WristParams,
    command,
    constants,
    initial,
    next_state,
)

__all__ = ["PassiveWristEmulation", "WristParams"]

FREE, LOADED, SENSOR_LOST, PROBING = 0.0, 8.0, 9.0, 10.0
"""Why the task must wait, as on port `permission`."""
_NOWHERE = np.zeros(6)


class PassiveWristEmulation(Block):
    """Turns the shaft as a free wrist would: through the fulcrum, unloading the wall.

    The tip stays where the navigation wants it; the shaft's direction comes from
    the fulcrum that the mode believes in (`pwe` estimated, `spring` first guess
    and force over a fixed stiffness, `off` first guess, `known` told). At an
    instant of its clock the output already holds that instant's inputs.

    Port ``tool_wanted`` accepts the navigation's p_WP [m], u_W, v_WP [m/s],
    du_W/dt [1/s] and the time [s] they hold at (13); u_W is not used.

    Port ``shaft`` accepts p_WS [m], u_W, v_WS [m/s], du_W/dt [1/s] (12).

    Port ``wrench`` accepts the wall's force on the shaft [N], its moment [N m], and
    1 if the sensor is alive (7).

    Port ``estimate`` accepts the fulcrum estimator's p_WI [m], v_WI [m/s], sigma
    across and along [m], stiffness [N/m], sigma of its logarithm, and four more (14).

    Port ``true_fulcrum`` accepts p_WI [m] and v_WI [m/s] (6); only `known` looks at
    it, and it need not be connected otherwise.

    Port ``tool`` emits the commanded p_WP [m], u_W, v_WP [m/s], du_W/dt [1/s] and
    the time [s] they hold at (13).

    Port ``permission`` emits the share of its speed that the task may use now and
    why it must wait: 0 it need not, 8 the wall is loaded, 9 the wrist's sensor is
    lost, 10 the wall is being probed (2).

    Port ``pivot`` emits the point the shaft is commanded through (3), in W [m].
    """

    def __init__(self, params: WristParams | None = None) -> None:
        """Makes the block."""
        super().__init__()
        p = self._p = params or WristParams()
        self._constants = constants(p)
        down = [0.0, 0.0, -1.0]
        self._wanted = self.vector_in(
            "tool_wanted", [0.0, 0.0, -0.18, *down, *[0.0] * 6, 0.0]
        )
        self._shaft = self.vector_in("shaft", [0.0, 0.0, 0.22, *down, *[0.0] * 6])
        self._wrench = self.vector_in("wrench", [0.1, 0.0, 0.0, 0.0, 0.02, 0.0, 1.0])
        self._estimate = self.vector_in(
            "estimate",
            [*[0.0] * 6, 1e-4, 1e-3, 500.0, 0.1, 0.0, 1.0, 0.0, 0.0],
        )
        self._truth = self.vector_in("true_fulcrum", [0.0] * 6)
        self._state = self.DeclareDiscreteState(initial(p))
        read = {
            self.xd_ticket(),
            self.time_ticket(),
            self._wanted.ticket(),
            self._shaft.ticket(),
            self._wrench.ticket(),
            self._estimate.ticket(),
        }
        if self._p.mode == "known":
            read.add(self._truth.ticket())
        self._next = self.cached("next", self._calc_next, read)
        self.vector_out(
            "tool",
            13,
            self._calc_tool,
            {self._next.ticket(), self._wanted.ticket(), self.time_ticket()},
        )
        self.vector_out("permission", 2, self._calc_permission, {self._next.ticket()})
        self.vector_out("pivot", 3, self._calc_pivot, {self._next.ticket()})
        self.update_every(self._p.period, self._next.Eval)

    def _calc_next(self, context: Any) -> np.ndarray:
        """The law's state with this instant's inputs, once and only once."""
        state: np.ndarray = context.get_discrete_state(self._state).value()
        time = context.get_time()
        if time - state[TIME] < 0.5 * self._p.period:
            return state.copy()
        told = self._p.mode == "known"
        after: np.ndarray = next_state(
            self._constants,
            state,
            self._wanted.Eval(context),
            self._shaft.Eval(context),
            self._wrench.Eval(context),
            self._estimate.Eval(context),
            self._truth.Eval(context) if told else _NOWHERE,
            time,
        )
        return after

    def _calc_tool(self, context: Any) -> Any:
        return command(self._next.Eval(context), self._wanted.Eval(context))

    def _calc_permission(self, context: Any) -> Sequence[float]:
        state = self._next.Eval(context)
        frozen, scale = state[FROZEN], state[SCALE]
        if frozen:
            return [0.0, LOADED if frozen == 1.0 else SENSOR_LOST]
        return [scale, FREE if scale > 0.0 else PROBING]

    def _calc_pivot(self, context: Any) -> Any:
        return self._next.Eval(context)[0:3]
