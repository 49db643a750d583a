"""Hysteresis compensation: drums for a tool pose, by a model that has a friction too.

The model is the block's own, and so are its coefficients: they need not be the snake's.
It is wound as for the paper's snake; where its tool then is not where it is to be, the
posture that is wound for is moved (Gauss-Newton, by the paper's kinematics), and the
model remembers what slid. What a tracker sees of the tool, less what the model said of
that instant, is its bias, which is low-passed and aimed off by.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.balls import mean_bends, tool_pose, turns_of
from plants.snake.core import SnakeCoreParams
from plants.snake.drive import SnakeDriveParams
from plants.snake.friction import (
    SHAPES,
    SnakeFrictionParams,
    flat_grip,
    grip_of,
)
from plants.snake.parameters import SnakeParams
from plants.snake.posture import Array, posture_of
from plants.snake.signals import REST, Drums, Posture
from plants.snake.statics import Statics
from plants.snake.statics_kernels import Grip
from plants.snake.tool_target import target_of
from systems.common.block import Block
from systems.common.compiled import compiled
from systems.common.parameter import check, parameter, part
from systems.common.signal import view
from systems.resection.wires.tool_load import resisting
from systems.resection.wires.tool_tracker import TrackedTool
from systems.resection.wires.wire_inverse_actuation import (
    WireInverseActuationParams,
    winding,
)

LEVER = 5e-3
"""What an axis' error in rad counts as in m."""
SCALE = np.array([0.03, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0])
"""Of a posture's parts against each other, m and rad."""
DAMPING = 3e-4
"""Of the step, in m/rad: singular directions are left alone."""
MOST = np.array([0.01, 0.35, 0.35, 0.35, 0.35, 0.35, 0.35])
"""By which a posture is moved at most."""
FRAMES = 16
"""Instants whose prediction is kept for frames that come late."""


@dataclass
class HysteresisCompensationParams:
    """Parameters of `HysteresisCompensation`: what it takes the snake to be."""

    period: float = parameter(0.02, "of the postures", "s", least=1e-3, most=0.1)
    friction: SnakeFrictionParams = part(SnakeFrictionParams)
    cutting: float = parameter(
        0.0, "force that it takes to oppose the motion", "N", least=0.0, most=3.0
    )
    tissue: float = parameter(
        60.0, "stiffness that it takes what is cut to have", "N/m", above=0, most=1e5
    )
    dither: float = parameter(
        0.0,
        "by which all wires are wound shorter and longer in turn",
        "m",
        least=0.0,
        most=1e-3,
    )
    steps: int = parameter(2, "of Gauss-Newton in a period", least=1, most=10)
    time_constant: float = parameter(
        0.1, "of the bias' low-pass", "s", least=0.01, most=100.0
    )


@compiled
def _poses(x: Any, h: float, tool: float, step: float, J: Any) -> Array:
    """The tool's place and axis (6) of a posture, and J (6, 7) by differences."""
    rows = np.empty((8, 6))
    for i in range(8):
        y = x.copy()
        if i < 7:
            y[i] += step
        at = target_of(y, h, tool)
        for k in range(3):
            rows[i, k], rows[i, 3 + k] = at.p[k], at.n[k]
    for i in range(7):
        J[:, i] = (rows[i] - rows[7]) / step
    return rows[7]


def aimed(x: Array, off: Array, astray: Array, snake: SnakeParams) -> Array:
    """By how much to move a posture so that its tool's pose moves by `off`.

    The two freedoms that are left move the posture by `astray`: nothing else leads the
    body, and steps of the tool alone would add up in them.

    Args:
        x: The posture, (7,).
        off: Of the tool, place and axis, (6,).
        astray: Of the posture, (7,).
        snake: Geometry.
    """
    J, weight = np.empty((6, 7)), np.repeat([1.0, LEVER], 3)
    _poses(x, snake.half_pitch, snake.tool_offset, 1e-7, J)
    A = weight[:, None] * J * SCALE
    rest = astray / SCALE
    damped = A @ A.T + DAMPING**2 * np.eye(6)
    step: Array = SCALE * (
        rest + A.T @ np.linalg.solve(damped, weight * off - A @ rest)
    )
    return step


class Compensation(NamedTuple):
    """What is remembered from one period to the next.

    Attributes:
        grip: What the model's friction holds on to, flat, (204,).
        x: The last posture asked for, (7,).
        shift: What it is wound for besides, (7,).
        force: That the model takes the tool to feel, in N, (3,).
        bias: By which the tool is off the model, place and axis, (6,).
        said: The model's tool, of this instant and those before, (FRAMES, 6).
    """

    grip: Array
    x: Array
    shift: Array
    force: Array
    bias: Array
    said: Array


PARTS = np.cumsum([sum(map(math.prod, SHAPES)), 7, 7, 3, 6])
"""Where in the state a `Compensation`'s parts begin, but the first."""


class HysteresisCompensation(Block):
    """Drums for a posture of a snake with friction, an elastic core and a load.

    It stands in place of `WireInverseActuation`, of which it winds by `winding`. A
    posture that is no numbers is taken for the last one.

    Port ``posture`` accepts the `Posture`.
    Port ``measured`` accepts the `TrackedTool`; it need not be connected.
    Port ``drums`` emits the `Drums`.
    """

    def __init__(
        self,
        params: HysteresisCompensationParams | None = None,
        wound: WireInverseActuationParams | None = None,
        snake: SnakeParams | None = None,
        drive: SnakeDriveParams | None = None,
        core: SnakeCoreParams | None = None,
        posture: ArrayLike = REST,
    ) -> None:
        """Makes the block for a snake, its drive and core, starting at a posture."""
        super().__init__()
        self._params = check(params or HysteresisCompensationParams())
        self._snake = check(snake or SnakeParams())
        drive, core = check(drive or SnakeDriveParams()), core or SnakeCoreParams()
        stiff = replace(
            wound or WireInverseActuationParams(), stiffness=drive.wire_stiffness
        )
        self._wound: Callable[..., Array]
        self._wound = winding(check(stiff), self._snake, drive, core)
        self._model = Statics(self._snake, drive, core, friction=self._params.friction)
        self._posture = self.signal_in("posture", Posture)
        self._measured = self.signal_in("measured", TrackedTool)
        x = np.array(posture, float)
        grip = self._model.at_rest(turns_of(x))
        said = np.tile(self._pose(grip.turns, x[0]), (FRAMES, 1))
        start = Compensation(
            flat_grip(grip), x, np.zeros(7), np.zeros(3), np.zeros(6), said
        )
        self.DeclareDiscreteState(np.concatenate([np.ravel(part) for part in start]))
        tickets = {
            self._posture.ticket(),
            self._measured.ticket(),
            self.xd_ticket(),
            self.time_ticket(),
        }
        self._next = self.cached("next", self._calc_next, tickets)
        self.signal_out("drums", Drums, self._calc_drums, {self._next.ticket()})
        self.update_every(self._params.period, lambda c: self._next.Eval(c)[0])

    def _pose(self, turns: Array, s: float) -> Array:
        X_WT = tool_pose(turns, s, self._snake)
        return np.append(X_WT[:3, 3], X_WT[:3, 2])

    def _calc_drums(self, context: Any) -> Array:
        drums: Array = self._next.Eval(context)[1]
        return drums

    def _bias(self, context: Any, state: Compensation) -> Array:
        """The bias with a frame that has come meanwhile."""
        if not self._measured.HasValue(context):
            return state.bias
        values = self._measured.Eval(context)
        frame = view(TrackedTool, values)
        seen = np.append(frame.p, frame.n)
        age = (context.get_time() - frame.time) / self._params.period
        if frame.time < 0.0 or not np.isfinite(values).all() or age > FRAMES - 0.5:
            return state.bias
        share = 1.0 - np.exp(-self._params.period / self._params.time_constant)
        off: Array = seen - state.said[max(round(age), 0)] - state.bias
        return state.bias + share * off

    def _calc_next(self, context: Any) -> tuple[Array, Array]:
        """The next state, and the drums."""
        p, values = self._params, np.array(context.get_discrete_state(0).value())
        grip_, x_, shift_, force_, bias_, said_ = np.split(values, PARTS)
        said = said_.reshape(FRAMES, 6)
        state = Compensation(grip_, x_, shift_, force_, bias_, said)
        x = np.array(self._posture.Eval(context))
        x = x if np.isfinite(x).all() else state.x
        grip: Grip = grip_of(state.grip)
        bias, shift = self._bias(context, state), state.shift
        unused = np.empty((6, 7))
        h, tool = self._snake.half_pitch, self._snake.tool_offset
        wanted, last = (_poses(y, h, tool, 1e-7, unused) for y in (x, state.x))
        moved = wanted[:3] - last[:3]
        force = resisting(state.force, moved, p.tissue, p.cutting)
        turns = self._model.ahead(grip)
        shaken = p.dither * (-1.0) ** round(context.get_time() / p.period)
        for _ in range(p.steps):
            drums = self._wound(x + shift, force)
            wound = view(Drums, drums).wires
            wound += shaken
            found = self._model.equilibrium(turns, wound=wound, force=force, grip=grip)
            turns = found.turns
            said = self._pose(found.turns, x[0] + shift[0])
            bends = np.append(x[0] + shift[0], mean_bends(found.turns))
            off, astray = wanted - bias - said, x - posture_of(bends)
            step = aimed(x + shift, off, astray, self._snake)
            shift = np.clip(shift + step, -MOST, MOST)
        if not np.isfinite(flat_grip(found.grip)).all():
            return values, self._wound(state.x + state.shift)
        memory = np.vstack([said, state.said[:-1]])
        after = Compensation(flat_grip(found.grip), x, shift, force, bias, memory)
        return np.concatenate([np.ravel(part) for part in after]), drums
