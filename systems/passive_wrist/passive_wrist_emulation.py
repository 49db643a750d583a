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

from typing import Any

import numpy as np

from systems.common.compiled import compiled
from systems.common.geometry import xyz
from systems.common.signals import (
    UNHINDERED,
    Fulcrum,
    Leeway,
    MovingPoint,
    Permission,
    Point,
    ShaftMotion,
    ToolMotion,
    Wrench,
)
from systems.common.step_block import StepBlock
from systems.passive_wrist.wrist_law import (
    PIVOT,
    TIME,
    WristParams,
    command,
    constants,
    initial,
    next_state,
    permission,
)


@compiled
def _told_step(
    c: Any,
    state: np.ndarray,
    time: float,
    wanted: ToolMotion,
    shaft: ShaftMotion,
    wrench: Wrench,
    estimate: Fulcrum,
    leeway: Leeway,
    seen: MovingPoint,
) -> tuple[np.ndarray, ToolMotion, Permission, Point]:
    """The law's state with this instant's inputs, once and only once."""
    if time - state[TIME] >= 0.5 * c.period:
        known = (shaft, wrench, estimate, seen, leeway)
        state = next_state(c, state, time, wanted, *known)
    pivot = Point(xyz(state, PIVOT))
    return state, command(state, wanted), permission(state), pivot


@compiled
def _step(
    c: Any,
    state: np.ndarray,
    time: float,
    wanted: ToolMotion,
    shaft: ShaftMotion,
    wrench: Wrench,
    estimate: Fulcrum,
    leeway: Leeway,
) -> tuple[np.ndarray, ToolMotion, Permission, Point]:
    seen = MovingPoint(estimate.p, estimate.v)
    known = (shaft, wrench, estimate, leeway, seen)
    return _told_step(c, state, time, wanted, *known)


class PassiveWristEmulation(StepBlock):
    """Turns the shaft as a free wrist would: through the fulcrum, unloading the wall.

    The tip stays where the navigation wants it; the shaft's direction comes from
    the fulcrum that the mode believes in (`pwe` estimated, `spring` first guess
    and force over a fixed stiffness, `off` first guess, `known` told). At an
    instant of its clock the output already holds that instant's inputs.

    Port ``tool_wanted`` accepts the navigation's `ToolMotion`; its u is not used.

    Port ``shaft`` accepts the `ShaftMotion`.

    Port ``wrench`` accepts the `Wrench`.

    Port ``estimate`` accepts the fulcrum estimator's `Fulcrum`.

    Port ``leeway`` accepts the `Leeway` that other tools leave the probe; all of it
    without a wire.

    Port ``true_fulcrum`` accepts p_WI, a `MovingPoint`; only `known` looks at it, and
    it need not be connected otherwise.

    Port ``tool`` emits the commanded `ToolMotion`.

    Port ``permission`` emits the `Permission` of the task.

    Port ``pivot`` emits the `Point` the shaft is commanded through.
    """

    def __init__(self, params: WristParams | None = None) -> None:
        """Makes the block."""
        super().__init__()
        params = params or WristParams()
        told = params.mode == "known"
        inputs = {
            "tool_wanted": ToolMotion,
            "shaft": ShaftMotion,
            "wrench": Wrench,
            "estimate": Fulcrum,
            "leeway": Leeway,
        }
        truth = {"true_fulcrum": MovingPoint}
        self.declare_step(
            _told_step if told else _step,
            [constants(params)],
            inputs | truth if told else inputs,
            initial(params),
            {"tool": ToolMotion, "permission": Permission, "pivot": Point},
            params.period,
            defaults={"leeway": UNHINDERED},
        )
        if not told:
            self.signal_in("true_fulcrum", MovingPoint)
