"""The signals of the snake: poses of its tool, postures, wires.

World frame W is the channel's. A posture is s, a1, b1, ..., a3, b3
(`plants.snake.posture`); wires count from the base (`plants.snake.actuation`).
"""

from typing import Annotated, NamedTuple

from plants.snake.parameters import MODULES, WIRES, SnakeParams
from plants.snake.snake import BALL_POSITIONS, POSITIONS
from systems.common.signal import AXES, Field, Vector

type Numbers = tuple[float, ...]

MODULE_NUMBERS = range(1, MODULES + 1)
WIRE_NAMES = tuple(f"w{i}" for i in range(WIRES * MODULES))
ANGLE_NAMES = tuple(f"{angle}{k}" for k in MODULE_NUMBERS for angle in "ab")
STRAIGHT = tuple(
    k * SnakeParams().straight_module for k in MODULE_NUMBERS for _ in range(WIRES)
)
NO_RATES = (0.0,) * (WIRES * MODULES)
REST = (0.0,) * (1 + 2 * MODULES)
"""The posture of a straight snake at s = 0."""


class ToolTarget(NamedTuple):
    """A pose that the tool is to take; its axes need not be unit vectors."""

    p: Annotated[Vector, Field("m", "p_WT", (0.0, 0.0, 0.0414))]
    n: Annotated[Vector, Field("1", "n_WT, the tool's axis", (0.0, 0.0, 1.0))]
    n_I: Annotated[Vector, Field("1", "n_WI, the intermediate axis", (0.0, 0.0, 1.0))]


class ToolPose(NamedTuple):
    """Where the tool is, or is to be."""

    p: Annotated[Vector, Field("m", "p_WT", (0.0, 0.0, 0.0414), AXES)]
    n: Annotated[Vector, Field("1", "n_WT, the tool's axis", (0.0, 0.0, 1.0))]


class Posture(NamedTuple):
    """A posture of the whole robot."""

    x: Annotated[
        Numbers,
        Field(
            "m, rad",
            "s, a1, b1, ..., a3, b3",
            (0.0, -0.1, 0.3, -0.3, 0.2, -0.1, -0.05),
            ("s", *ANGLE_NAMES),
        ),
    ]


class BallPosture(NamedTuple):
    """As `Posture`, of a snake of free balls."""

    x: Annotated[
        Numbers,
        Field("m, rad", "s, then Rx, Ry, Rz a ball", (0.0,) * BALL_POSITIONS),
    ]


class Drums(NamedTuple):
    """Lengths of wires and the translation."""

    wires: Annotated[Numbers, Field("m", "of wires 0 to 8", STRAIGHT, WIRE_NAMES)]
    s: Annotated[float, Field("m", "the translation", 0.0)]


class DrumRates(NamedTuple):
    """How fast they change."""

    wires: Annotated[Numbers, Field("m/s", "of wires 0 to 8", NO_RATES, WIRE_NAMES)]
    s: Annotated[float, Field("m/s", "of the translation", 0.0)]


class Tensions(NamedTuple):
    """What the wires pull with."""

    T: Annotated[
        Numbers, Field("N", "of wires 0 to 8", (4.0,) * (WIRES * MODULES), WIRE_NAMES)
    ]


class Stopped(NamedTuple):
    """Whether the drums have to stand still."""

    flag: Annotated[float, Field("1", "0, or anything else to stop", 0.0)]


class SnakeState(NamedTuple):
    """The plant's positions and velocities, in the order of `plants.snake.snake`."""

    q: Annotated[Numbers, Field("m, rad", "positions", (0.0,) * POSITIONS)]
    v: Annotated[Numbers, Field("m/s, rad/s", "velocities", (0.0,) * POSITIONS)]


class BallState(NamedTuple):
    """As `SnakeState`, of a snake with spherical joints: s, then Rx, Ry, Rz a ball."""

    q: Annotated[Numbers, Field("m, rad", "positions", (0.0,) * BALL_POSITIONS)]
    v: Annotated[Numbers, Field("m/s, rad/s", "velocities", (0.0,) * BALL_POSITIONS)]


class ToolForce(NamedTuple):
    """What acts on the tool at its origin."""

    f: Annotated[Vector, Field("N", "f_T_W", (0.02, 0.0, 0.0), AXES)]


class Stability(NamedTuple):
    """Whether the snake stays where its wires hold it."""

    least_eigenvalue: Annotated[
        float, Field("N m/rad", "of the energy's Hessian", 0.005)
    ]
    lost: Annotated[
        float, Field("1", "1 without balance or stability, or having buckled", 0.0)
    ]
