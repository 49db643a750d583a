"""Wire inverse actuation: the drums' positions for a posture."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.actuation import lengths, norm_rows
from plants.snake.core import SnakeCoreParams, core_torques
from plants.snake.drive import SnakeDriveParams
from plants.snake.jacobian import screws
from plants.snake.parameters import MODULES, SnakeParams
from plants.snake.signals import REST, Drums, Posture
from plants.snake.tension import tensions_of
from plants.snake.weight import GRAVITY, torques_of_weight, whole_mass
from systems.common.block import Block
from systems.common.compiled import compiled, packed
from systems.common.geometry import all_finite
from systems.common.parameter import check, parameter

PAPERS = SnakeCoreParams(kind="coupled")
"""The core of the paper's snake."""


@dataclass
class WireInverseActuationParams:
    """Parameters of `WireInverseActuation`."""

    period: float = parameter(0.02, "of the postures", "s", least=1e-3, most=0.1)
    # Wires are wound shorter by what they stretch.
    stiffness: float = parameter(
        0.0,
        "of one wire; 0 for drums whose servos give way instead",
        "N/m",
        least=0.0,
        most=1e6,
    )
    least_tension: float = parameter(
        2.0, "of the pretension in each module", "N", least=0.0, most=50.0
    )
    gravity: list[float] = parameter(
        list(GRAVITY),
        "in W, whose sag is made up for; zeros to let the snake sag",
        "m/s2",
        least=-20.0,
        most=20.0,
        shape=(3,),
    )


@compiled
def _wound(constants: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Drum positions of wires that do not stretch."""
    c, lifted = constants[0], np.empty((1, len(x)))
    lifted[0, 0] = x[0] - c.load / c.travel_kp
    h, g = c.half_pitch, c.gravity
    masses = (c.ball_mass, c.plate_mass, c.tool_mass)
    lifted[0, 1:] = x[1:] - torques_of_weight(x, h, c.tool_offset, *masses, g) / c.kp
    n = len(c.rows)
    L, wound = np.empty((1, n)), np.empty(n + 1)
    lengths(lifted, c.rows, c.ball_radius, c.plate_thickness, h, L)
    wound[:n], wound[n] = L[0], lifted[0, 0]
    return wound


@compiled
def stretched(c: Any, x: np.ndarray, force: np.ndarray) -> np.ndarray:
    """Drum positions (10,) of wires that stretch, and hold a force on the tool (3,)."""
    h, tool, R, e = c.half_pitch, c.tool_offset, c.ball_radius, c.plate_thickness
    n = len(c.rows)
    ab, tau, J, T = x[1:], np.zeros(2 * MODULES), np.empty((6, 7)), np.empty(n)
    core_torques(ab, c.bend, tau)
    masses = (c.ball_mass, c.plate_mass, c.tool_mass)
    tau -= torques_of_weight(x, h, tool, *masses, c.gravity)
    screws(x, h, tool, J)
    for i in range(2 * MODULES):
        for k in range(3):
            tau[i] -= J[3 + k, 1 + i] * force[k]
    tensions_of(ab, tau, c.rows, R, h, e, c.least_tension, T)
    L, wound = np.empty((1, n)), np.empty(n + 1)
    lengths(x.reshape((1, 7)), c.rows, R, e, h, L)
    wound[:n], wound[n] = L[0] - T / c.stiffness, x[0] - c.load / c.travel_kp
    return wound


@compiled
def _stretched(constants: np.ndarray, x: np.ndarray, force: np.ndarray) -> np.ndarray:
    wound: np.ndarray = stretched(constants[0], x, force)
    return wound


def winder(
    params: WireInverseActuationParams,
    snake: SnakeParams,
    drive: SnakeDriveParams,
    core: SnakeCoreParams = PAPERS,
) -> np.ndarray:
    """What `_wound` and `stretched` need to know, packed."""
    return packed(
        drive,
        rows=norm_rows(snake),
        load=whole_mass(drive) * params.gravity[2],
        gravity=np.array(params.gravity, float),
        half_pitch=snake.half_pitch,
        tool_offset=snake.tool_offset,
        ball_radius=snake.ball_radius,
        plate_thickness=snake.plate_thickness,
        bend=core.bend if core.kind == "elastic" else 0.0,
        least_tension=params.least_tension,
        stiffness=params.stiffness,
    )


def winding(
    params: WireInverseActuationParams,
    snake: SnakeParams,
    drive: SnakeDriveParams,
    core: SnakeCoreParams = PAPERS,
) -> Callable[[np.ndarray], np.ndarray]:
    """The map of a posture x (7) to drums (10): wires 0 to 8 and the translation [m].

    They hold the snake's weight as well, and bend its core: what gives way under it,
    wires or servos, is wound shorter by as much.
    """
    c, free = winder(params, snake, drive, core), np.zeros(3)
    if params.stiffness == 0.0:
        return lambda x: _wound(c, x)
    return lambda x: _stretched(c, x, free)


def wound_lengths(
    x: ArrayLike,
    params: WireInverseActuationParams,
    snake: SnakeParams,
    drive: SnakeDriveParams,
    core: SnakeCoreParams = PAPERS,
) -> np.ndarray:
    """Drum positions of a posture x (7), see `winding`."""
    return winding(params, snake, drive, core)(np.asarray(x, float))


class WireInverseActuation(Block):
    """Wire lengths for a posture, equations (2) and (3), distal wires included.

    The posture is the one that the snake takes under its own weight. One that is no
    numbers leaves the drums where they are.

    Port ``posture`` accepts the `Posture`.
    Port ``drums`` emits the `Drums`.
    """

    def __init__(
        self,
        params: WireInverseActuationParams | None = None,
        snake: SnakeParams | None = None,
        drive: SnakeDriveParams | None = None,
        posture: ArrayLike = REST,
        core: SnakeCoreParams = PAPERS,
    ) -> None:
        """Makes the block for a snake, its drive and core, starting at a posture."""
        super().__init__()
        params = check(params or WireInverseActuationParams())
        snake, drive = check(snake or SnakeParams()), check(drive or SnakeDriveParams())
        self._wound = winding(params, snake, drive, core)
        self._posture = self.signal_in("posture", Posture)
        # The last good drums.
        self.DeclareDiscreteState(self._wound(np.array(posture, float)))
        tickets = {self._posture.ticket(), self.xd_ticket()}
        self._drums = self.cached("drums", self._calc_drums, tickets)
        self.signal_out("drums", Drums, self._drums.Eval, {self._drums.ticket()})
        self.update_every(params.period, self._drums.Eval)

    def _calc_drums(self, context: Any) -> np.ndarray:
        x = self._posture.Eval(context)
        if all_finite(x):
            return self._wound(x)
        return np.array(context.get_discrete_state(0).value())
