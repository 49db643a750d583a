"""Wire inverse actuation: the drums' positions for a posture."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.actuation import lengths, norm_rows, wire_lengths
from plants.snake.core import SnakeCoreParams, torques_against_core
from plants.snake.drive import SnakeDriveParams
from plants.snake.parameters import SnakeParams
from plants.snake.signals import REST, Drums, Posture
from plants.snake.tension import tensions, torques_against
from plants.snake.weight import GRAVITY, torques_of_weight, weight, whole_mass
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


def winding(
    params: WireInverseActuationParams,
    snake: SnakeParams,
    drive: SnakeDriveParams,
    core: SnakeCoreParams = PAPERS,
) -> Callable[..., np.ndarray]:
    """The map of a posture x (7) to drums (10): wires 0 to 8 and the translation [m].

    They hold the snake's weight as well, and bend its core: what gives way under it,
    wires or servos, is wound shorter by as much. Wires that stretch hold a force on the
    tool, too, the map's second argument (3,).
    """
    if params.stiffness == 0.0:
        c = packed(
            drive,
            rows=norm_rows(snake),
            load=whole_mass(drive) * params.gravity[2],
            gravity=np.array(params.gravity, float),
            half_pitch=snake.half_pitch,
            tool_offset=snake.tool_offset,
            ball_radius=snake.ball_radius,
            plate_thickness=snake.plate_thickness,
        )
        return lambda x: _wound(c, x)

    def stretched(x: np.ndarray, force: np.ndarray | None = None) -> np.ndarray:
        load = weight(x, snake, drive, params.gravity)
        tau = torques_against_core(x[1:], core) - load[1:]
        if force is not None and force.any():
            tau += torques_against(x, force, snake)
        T = tensions(x[1:], tau, snake, params.least_tension)
        s = x[0] - load[0] / drive.travel_kp
        return np.append(wire_lengths(x, snake) - T / params.stiffness, s)

    return stretched


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
