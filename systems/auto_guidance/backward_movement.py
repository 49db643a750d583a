"""The "Backward Movement" behaviour: Bauzano et al., section 4.3, equation (5).

When the surgeon pushes the obstacle tool O at the robot's tool, the robot gives
way in the direction of O's velocity, as if a damper joined the two. v_O is
taken where the tools would touch, at O's material point M_O.

`corrected` (default): F_3 = B (v_O - v_3). v_3 reaches v_O with the time
constant 1/B and dies out when O stops, as the text says.
`printed`: F_3 = B v_O, integrated; v_3 grows as long as O moves and stays when
O stops.
"""

from dataclasses import dataclass
from functools import partial
from math import exp
from typing import Any

import numpy as np

from systems.common.compiled import Numbers, compiled, packed
from systems.common.geometry import (
    Vector,
    all_finite,
    along,
    shaft_point_velocity,
    sub,
    unit,
    xyz,
)
from systems.common.signals import (
    GUIDE_EXAMPLE,
    OBSTACLE_EXAMPLE,
    fulcrum,
    usable,
    velocity,
)
from systems.common.step_block import StepBlock

FORMS = ("corrected", "printed")


@dataclass
class BackwardMovementParams:
    """Parameters of `BackwardMovement`.

    Attributes:
        form: "corrected" or "printed".
        period: Of the update, s.
        gain: B, 1/s: how fast the robot takes up the obstacle's velocity.
    """

    form: str = "corrected"
    period: float = 1.0 / 60.0
    gain: float = 20.0

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: With the name, the value and what was expected.
        """
        if self.form not in FORMS:
            raise ValueError(f"form={self.form!r} must be one of {', '.join(FORMS)}")
        for name in ("period", "gain"):
            value = getattr(self, name)
            if not 0.0 < value < float("inf"):
                raise ValueError(f"{name}={value} must be finite and > 0")


@compiled
def contact_velocity(guide: Numbers, obstacle: Numbers) -> Vector:
    """v_O, the velocity of O's material point M_O, m/s.

    Args:
        guide: The guide signal (12).
        obstacle: A usable estimate (17) of O.
    """
    o = unit(sub(xyz(obstacle, 0), fulcrum(obstacle)))
    return shaft_point_velocity(guide[8], o, velocity(obstacle))


@compiled
def backward_movement(
    params: Any, v3: Numbers, dt: float, guide: Numbers, obstacle: Numbers
) -> Vector:
    """One step of the behaviour.

    Args:
        params: A record of `constants`.
        v3: v_3 before the step, m/s.
        dt: Length of the step, s.
        guide: The guide signal (12).
        obstacle: Estimate (17) of O; without a usable one v_O counts as zero.

    Returns:
        v_3 after the step, m/s.
    """
    v_o = (0.0, 0.0, 0.0)
    if usable(obstacle) and all_finite(guide):
        v_o = contact_velocity(guide, obstacle)
    if params.printed:
        return along(v3, params.gain * dt, v_o)
    # The exact solution for a v_O that is constant over the step.
    return along(v3, 1.0 - exp(-params.gain * dt), sub(v_o, v3))


def constants(params: BackwardMovementParams) -> np.ndarray:
    """The parameters as the compiled functions take them."""
    return packed(params, printed=params.form == "printed")


@compiled
def _step(
    record: np.ndarray,
    state: np.ndarray,
    time: float,
    guide: np.ndarray,
    obstacle: np.ndarray,
) -> np.ndarray:
    """The next state, v_3 and the time (4), and v_3 (3)."""
    dt = time - state[3]
    v3 = backward_movement(record[0], xyz(state, 0), dt, guide, obstacle)
    return np.array(v3 + (time,) + v3)


class BackwardMovement(StepBlock):
    """Makes the robot's tool give way to the obstacle tool that pushes it.

    Bauzano et al., section 4.3, equation (5); see the module.

    Port ``guide`` accepts the guide signal (12).
    Port ``obstacle`` accepts the estimate (17) of the obstacle tool O.
    Port ``v3`` emits v_3 (3), the retreat of the guide point, m/s, in W.

    The discrete state is v_3 (3) and the time of the last update. The output
    is that of the step from then to now: no sample of delay.
    """

    def __init__(self, params: BackwardMovementParams | None = None) -> None:
        """Builds the block.

        Args:
            params: Parameters; the defaults if None.

        Raises:
            ValueError: If a parameter is out of range.
        """
        super().__init__()
        params = params or BackwardMovementParams()
        params.check()
        self.declare_step(
            partial(_step, constants(params)),
            {"guide": GUIDE_EXAMPLE, "obstacle": OBSTACLE_EXAMPLE},
            [0.0, 0.0, 0.0, -params.period],
            {"v3": 3},
            params.period,
        )
