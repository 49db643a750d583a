"""The "Backward Movement" behaviour: Bauzano et al., section 4.3, equation (5).

When the surgeon pushes the obstacle tool O at the robot's tool, the robot gives
way in the direction of O's velocity, as if a damper joined the two. v_O is
taken where the tools would touch, at O's material point M_O.

`corrected` (default): F_3 = B (v_O - v_3). v_3 reaches v_O with the time
constant 1/B and dies out when O stops, as the text says.
`printed`: F_3 = B v_O, integrated; v_3 grows as long as O moves and stays when
O stops.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp
from typing import Any, NamedTuple

import numpy as np

from systems.auto_guidance.nearest import obstacle_at
from systems.common.compiled import compiled, packed
from systems.common.geometry import along, shaft_point_velocity, sub, unit
from systems.common.parameter import check, parameter
from systems.common.signal import Many, Vector
from systems.common.signals import Estimate, Guide, Velocity, finite_guide, usable
from systems.common.step_block import StepBlock

FORMS = ("corrected", "printed")


@dataclass
class BackwardMovementParams:
    """Parameters of `BackwardMovement`."""

    form: str = parameter("corrected", "of equation (5)", choices=FORMS)
    period: float = parameter(1 / 60, "of the update", "s", above=0.0, most=1.0)
    gain: float = parameter(
        20.0, "B: how fast R takes up O's velocity", "1/s", above=0.0, most=1e3
    )


class State(NamedTuple):
    """v_3 in m/s, and the time of the last update in s."""

    v3: Vector
    time: float


@compiled
def contact_velocity(guide: Guide, obstacle: Estimate) -> Vector:
    """v_O, the velocity of O's material point M_O, m/s; of a usable estimate."""
    o = unit(sub(obstacle.p, obstacle.fulcrum))
    return shaft_point_velocity(guide.l_over_L, o, obstacle.v)


@compiled
def backward_movement(
    params: Any, v3: Vector, dt: float, guide: Guide, obstacle: Estimate
) -> Vector:
    """One step of the behaviour.

    Args:
        params: A record of `constants`.
        v3: v_3 before the step, m/s.
        dt: Length of the step, s.
        guide: The guide point.
        obstacle: Of O; without a usable estimate v_O counts as zero.

    Returns:
        v_3 after the step, m/s.
    """
    v_o = (0.0, 0.0, 0.0)
    if usable(obstacle) and finite_guide(guide):
        v_o = contact_velocity(guide, obstacle)
    if params.printed:
        return along(v3, params.gain * dt, v_o)
    # The exact solution for a v_O that is constant over the step.
    return along(v3, 1.0 - exp(-params.gain * dt), sub(v_o, v3))


def constants(params: BackwardMovementParams) -> np.ndarray:
    """The parameters as the compiled functions take them."""
    check(params)
    return packed(params, printed=params.form == "printed")


@compiled
def _step(
    params: Any, state: State, time: float, guide: Guide, obstacles: np.ndarray
) -> tuple[State, Velocity]:
    obstacle = obstacle_at(guide, obstacles)
    v3 = backward_movement(params, state.v3, time - state.time, guide, obstacle)
    return State(v3, time), Velocity(v3)


class BackwardMovement(StepBlock):
    """Makes the robot's tool give way to the obstacle tool that pushes it.

    Bauzano et al., section 4.3, equation (5); see the module.

    Port ``guide`` accepts the `Guide`.
    Port ``obstacles`` accepts the `Estimate` of every obstacle tool; O is the nearest.
    Port ``v3`` emits v_3, the retreat of the guide point, a `Velocity`.
    """

    def __init__(
        self,
        params: BackwardMovementParams | None = None,
        obstacles: Sequence[str] = ("obstacle",),
    ) -> None:
        """Builds the block.

        Args:
            params: Parameters; the defaults if None.
            obstacles: Names of the obstacle tools.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        params = params or BackwardMovementParams()
        self.declare_step(
            _step,
            [constants(params)],
            {"guide": Guide, "obstacles": Many(Estimate, tuple(obstacles))},
            State((0.0, 0.0, 0.0), -params.period),
            {"v3": Velocity},
            params.period,
        )
