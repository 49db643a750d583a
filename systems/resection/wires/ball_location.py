"""Ball location: tool pose, mean posture and gaps from the turns of six balls."""

from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.snake.balls import BALLS, gaps_of, mean_bends, tool_of, turned_to
from plants.snake.parameters import MODULES, SnakeParams
from plants.snake.signals import (
    MODULE_NUMBERS,
    BallPosture,
    BallState,
    Numbers,
    ToolPose,
)
from systems.common.compiled import compiled, packed
from systems.common.parameter import check
from systems.common.signal import Field
from systems.common.step_block import StepBlock
from systems.resection.wires.snake_location import Bends


class BallAngles(NamedTuple):
    """How far each ball turns."""

    q: Annotated[
        Numbers,
        Field(
            "rad",
            "Rx, Ry, Rz a ball",
            (0.0,) * (3 * BALLS),
            tuple(f"{axis}{i}" for i in range(1, BALLS + 1) for axis in "xyz"),
        ),
    ]


class Gaps(NamedTuple):
    """What the paper takes to be zero."""

    split: Annotated[
        Numbers,
        Field(
            "rad",
            "between the bends of a module's two balls",
            (0.0,) * len(MODULE_NUMBERS),
            tuple(f"split{k}" for k in MODULE_NUMBERS),
        ),
    ]
    torsion: Annotated[
        Numbers,
        Field(
            "rad",
            "of each ball",
            (0.0,) * BALLS,
            tuple(f"torsion{i}" for i in range(1, BALLS + 1)),
        ),
    ]


@compiled
def _located(
    c: Any, state: BallState
) -> tuple[BallPosture, Bends, ToolPose, BallAngles, Gaps]:
    """All of the outputs."""
    turns: Any = np.empty((BALLS, 3, 3))
    posture: Any = np.array(state.q)
    angles: Any = posture[1:].copy()
    turned_to(angles, turns)
    split: Any = np.empty(MODULES)
    torsion: Any = np.empty(BALLS)
    gaps_of(turns, split, torsion)
    bends: Any = np.append(posture[:1], mean_bends(turns))
    p, n = tool_of(turns, state.q[0], c.half_pitch, c.tool_offset)
    pose = ToolPose(p, n)
    gaps = Gaps(split, torsion)
    return BallPosture(posture), Bends(bends), pose, BallAngles(angles), gaps


class BallLocation(StepBlock):
    """Where a snake of free balls truly is.

    Port ``state`` accepts the plant's `BallState`.
    Port ``posture`` emits the `BallPosture`.
    Port ``bends`` emits the mean bend of each module's balls, `Bends`.
    Port ``tool`` emits the `ToolPose`.
    Port ``balls`` emits their `BallAngles`.
    Port ``gaps`` emits the `Gaps`.
    """

    def __init__(self, snake: SnakeParams | None = None) -> None:
        """Makes the block."""
        super().__init__()
        snake = check(snake or SnakeParams())
        constants = packed(half_pitch=snake.half_pitch, tool_offset=snake.tool_offset)
        outputs = {
            "posture": BallPosture,
            "bends": Bends,
            "tool": ToolPose,
            "balls": BallAngles,
            "gaps": Gaps,
        }
        run, tickets = self._runner(
            _located,
            [constants],
            [],
            {"state": BallState},
            [*outputs.values()],
            False,
            {},
        )
        self._emit(self.cached("located", run, tickets), outputs, 0)
