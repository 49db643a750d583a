"""Hysteresis compensation: drums for a tool pose, by a model that has a friction too.

The model is the block's own, and so are its coefficients: they need not be the snake's.
It is wound as for the paper's snake; where its tool then is not where it is to be, the
posture that is wound for is moved (Gauss-Newton, by the paper's kinematics), and the
model remembers what slid. What a tracker sees of the tool, less what the model said of
that instant, is its bias, which is low-passed and aimed off by.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.balls import mean_posture, tool_of, tool_pose, turns_of
from plants.snake.core import SnakeCoreParams
from plants.snake.drive import SnakeDriveParams
from plants.snake.equilibrium import ahead, followed
from plants.snake.friction import GRIP, SnakeFrictionParams, flat_grip
from plants.snake.jacobian import screws
from plants.snake.parameters import DRUMS, SnakeParams
from plants.snake.signals import REST, Drums, Posture
from plants.snake.statics import Statics
from plants.snake.tool_target import target_of
from systems.common.compiled import compiled, packed
from systems.common.geometry import cross
from systems.common.parameter import check, parameter, part
from systems.common.signal import example
from systems.common.step_block import StepBlock
from systems.resection.wires.tool_load import resisting
from systems.resection.wires.tool_tracker import TrackedTool
from systems.resection.wires.wire_inverse_actuation import (
    WireInverseActuationParams,
    stretched,
    winder,
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
def _pose(x: np.ndarray, h: float, tool: float) -> np.ndarray:
    """The tool's place and axis (6,) of the paper's snake in a posture."""
    at = target_of(x, h, tool)
    return np.array((*at.p, *at.n))


@compiled
def aimed(
    x: np.ndarray, off: np.ndarray, astray: np.ndarray, h: float, tool: float
) -> np.ndarray:
    """By how much to move a posture so that its tool's pose moves by `off`.

    The two freedoms that are left move the posture by `astray`: nothing else leads the
    body, and steps of the tool alone would add up in them.

    Args:
        x: The posture, (7,).
        off: Of the tool, place and axis, (6,).
        astray: Of the posture, (7,).
        h: Half the pitch, m.
        tool: The tool's offset, m.
    """
    J, A = np.empty((6, 7)), np.empty((6, 7))
    screws(x, h, tool, J)
    axis = target_of(x, h, tool).n
    for i in range(7):
        A[:3, i] = SCALE[i] * J[3:, i]
        swung = cross((J[0, i], J[1, i], J[2, i]), axis)
        for k in range(3):
            A[3 + k, i] = SCALE[i] * LEVER * swung[k]
    goal = off.copy()
    goal[3:] *= LEVER
    rest = astray / SCALE
    damped = A @ A.T + DAMPING**2 * np.eye(6)
    return SCALE * (rest + A.T @ np.linalg.solve(damped, goal - A @ rest))


PARTS = np.cumsum(np.array([GRIP, 7, 7, 3, 6]))
"""Where in the state the parts after the first begin: what the model's friction holds
on to, flat (204,); the last posture asked for (7,); what it is wound for besides (7,);
the force that the model takes the tool to feel (3,); by which the tool is off the
model, place and axis (6,); and the model's tool, of this instant and those before
(FRAMES, 6)."""


@compiled
def _biased(
    c: Any, bias: np.ndarray, said: np.ndarray, time: float, frame: TrackedTool
) -> np.ndarray:
    """The bias (6,) with a frame that has come meanwhile."""
    age = (time - frame.time) / c.period
    seen = np.array((*frame.p, *frame.n))
    if not (frame.time >= 0.0 and age <= FRAMES - 0.5 and np.isfinite(seen).all()):
        return bias
    k = 6 * max(round(age), 0)
    share = 1.0 - np.exp(-c.period / c.time_constant)
    return bias + share * (seen - said[k : k + 6] - bias)


@compiled
def _step(
    c: Any,
    wound: Any,
    snake: Any,
    last: np.ndarray,
    time: float,
    posture: Posture,
    frame: TrackedTool,
) -> tuple[np.ndarray, Drums]:
    """The next state, and the drums."""
    i, j, k, m, n = PARTS
    grip, before, shift, said = last[:i], last[i:j], last[j:k], last[n:]
    bias, x = _biased(c, last[m:n], said, time, frame), np.array(posture.x)
    x = x if np.isfinite(x).all() else before
    h, tool = c.half_pitch, c.tool_offset
    wanted = _pose(x, h, tool)
    moved = wanted[:3] - _pose(before, h, tool)[:3]
    force = resisting(last[k:m], moved, c.tissue, c.cutting)
    load = np.append(force, np.zeros(3))
    shaken = c.dither * (1.0 if round(time / c.period) % 2 == 0 else -1.0)
    start = ahead(grip)
    tip, after = np.zeros(6), grip
    drums = np.zeros(DRUMS)
    for _ in range(int(c.steps)):
        drums = stretched(wound, x + shift, force)
        drums[: DRUMS - 1] += shaken
        start, after = followed(
            grip, start, wound.stiffness, drums[: DRUMS - 1], load, snake
        )
        p, axis = tool_of(start, x[0] + shift[0], h, tool)
        tip = np.array((*p, *axis))
        astray = x - mean_posture(start, x[0] + shift[0])
        step = aimed(x + shift, wanted - bias - tip, astray, h, tool)
        shift = np.minimum(np.maximum(shift + step, -MOST), MOST)
    state = np.concatenate((after, x, shift, force, bias, tip, said[:-6]))
    if not np.isfinite(state).all():
        state = last.copy()
        drums = stretched(wound, before + last[j:k], np.zeros(3))
    wires: Any = drums[: DRUMS - 1]
    return state, Drums(wires, drums[DRUMS - 1])


class HysteresisCompensation(StepBlock):
    """Drums for a posture of a snake with friction, an elastic core and a load.

    It stands in place of `WireInverseActuation`, of which it winds by `stretched`. A
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
        params = check(params or HysteresisCompensationParams())
        snake, drive = check(snake or SnakeParams()), check(drive or SnakeDriveParams())
        core = core or SnakeCoreParams()
        stiff = replace(
            wound or WireInverseActuationParams(), stiffness=drive.wire_stiffness
        )
        model = Statics(snake, drive, core, friction=params.friction)
        constants = packed(
            params, half_pitch=snake.half_pitch, tool_offset=snake.tool_offset
        )
        x = np.array(posture, float)
        grip = model.at_rest(turns_of(x))
        X_WT = tool_pose(grip.turns, x[0], snake)
        said = np.tile(np.append(X_WT[:3, 3], X_WT[:3, 2]), FRAMES)
        self.declare_step(
            _step,
            [constants, winder(check(stiff), snake, drive, core), model.record],
            {"posture": Posture, "measured": TrackedTool},
            np.concatenate([flat_grip(grip), x, np.zeros(7 + 3 + 6), said]),
            {"drums": Drums},
            params.period,
            defaults={"measured": example(TrackedTool)},
        )
