"""Base sensor: a six-axis force sensor under the whole drive pack.

Wires pull inside the pack, so it feels none of their tension and none of their
friction: what it reads is the pack's weight, the snake's through its posture, and what
touches it. The snake is slow: no inertia is in its statics, and none is here.
"""

from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.snake.balls import BALLS, times, turned_to
from plants.snake.drive import SnakeDriveParams
from plants.snake.parameters import SnakeParams
from plants.snake.signals import BallState, ToolForce
from plants.snake.weight import GRAVITY, whole_mass
from systems.common.compiled import compiled, packed
from systems.common.geometry import Vector, along, cross, plus, scaled
from systems.common.parameter import check, parameter
from systems.common.signal import AXES, Field
from systems.common.step_block import StepBlock


class BaseWrench(NamedTuple):
    """What the drive pack presses its sensor with, about W's origin."""

    f: Annotated[Vector, Field("N", "force", (0.0, 0.0, -0.5), AXES)]
    m: Annotated[Vector, Field("N m", "moment", (0.0, 0.0, 0.0), ("mx", "my", "mz"))]


class SensorNoise(NamedTuple):
    """What errs in a sample: independent standard normal numbers."""

    f: Annotated[Vector, Field("1", "of the force", (0.0, 0.0, 0.0), AXES)]
    m: Annotated[Vector, Field("1", "of the moment", (0.0, 0.0, 0.0), ("a", "b", "c"))]


@dataclass
class BaseSensorParams:
    """Parameters of `BaseSensor`; its noise is assumed, white and without drift."""

    force: float = parameter(
        0.02, "standard deviation, an axis", "N", least=0.0, most=10.0
    )
    moment: float = parameter(
        5e-4, "standard deviation, an axis", "N m", least=0.0, most=1.0
    )


@compiled
def weighed(c: Any, s: float, turns: Any) -> tuple[Vector, Vector, Vector]:
    """Weight and its moment about W's origin, and p_WT, of balls that turn by R_i.

    The carriage's mass hangs on the channel's axis, where it has no arm.
    """
    A, B = np.eye(3), np.empty((3, 3))
    n = (0.0, 0.0, 1.0)
    p = (0.0, 0.0, s)
    moment = (0.0, 0.0, 0.0)  # of mass times place
    for i in range(BALLS):
        times(A, turns[i], B)
        A, B = B, A
        moment = along(moment, c.ball_mass, p)
        n = (A[0, 2], A[1, 2], A[2, 2])
        moment = along(moment, c.plate_mass, along(p, c.half_pitch, n))
        p = along(p, 2 * c.half_pitch, n)
    tip = along(p, c.tool_offset, n)
    moment = along(moment, c.tool_mass, tip)
    g = (c.gravity[0], c.gravity[1], c.gravity[2])
    return scaled(c.mass, g), cross(moment, g), tip


def scale(snake: SnakeParams, drive: SnakeDriveParams, **more: Any) -> np.ndarray:
    """What `weighed` needs to know, packed, and more."""
    return packed(
        drive,
        half_pitch=snake.half_pitch,
        tool_offset=snake.tool_offset,
        mass=whole_mass(drive),
        gravity=np.array(GRAVITY),
        **more,
    )


@compiled
def _read(
    c: Any, state: BallState, force: ToolForce, noise: SensorNoise
) -> tuple[BaseWrench]:
    turns, q = np.empty((BALLS, 3, 3)), np.array(state.q)
    turned_to(q[1:], turns)
    f, m, tip = weighed(c, q[0], turns)
    f = along(plus(f, force.f), c.force_noise, noise.f)
    m = along(plus(m, cross(tip, force.f)), c.moment_noise, noise.m)
    return (BaseWrench(f, m),)


class BaseSensor(StepBlock):
    """Measures what the drive pack presses on its mount with.

    Port ``state`` accepts the plant's `BallState`.
    Port ``force`` accepts the `ToolForce`.
    Port ``noise`` accepts the `SensorNoise`.
    Port ``wrench`` emits the `BaseWrench`.
    """

    def __init__(
        self,
        params: BaseSensorParams | None = None,
        snake: SnakeParams | None = None,
        drive: SnakeDriveParams | None = None,
    ) -> None:
        """Makes the block."""
        super().__init__()
        params = check(params or BaseSensorParams())
        snake, drive = check(snake or SnakeParams()), check(drive or SnakeDriveParams())
        noise = {"force_noise": params.force, "moment_noise": params.moment}
        self.declare_map(
            _read,
            [scale(snake, drive, **noise)],
            {"state": BallState, "force": ToolForce, "noise": SensorNoise},
            "wrench",
            BaseWrench,
        )
