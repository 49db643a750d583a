"""Snake load: where the snake's weight is along the tube, for the wrist's sensor.

What slides 50 mm in the tube changes the inertia about the sensor by a fifth. If the
model keeps it where it was, the wrist hears its own shaking and shakes the more.
"""

from typing import Any

from plants.instruments.tube import TubeParams
from plants.snake.drive import SnakeDriveParams
from plants.snake.parameters import MODULES, SnakeParams
from plants.snake.signals import Posture
from systems.common.compiled import compiled, packed
from systems.common.parameter import check
from systems.common.step_block import StepBlock
from systems.sensing.wrench_kernel import Load


def weight_of(snake: SnakeParams, drive: SnakeDriveParams) -> tuple[float, float]:
    """The straight snake's mass in kg, and its centre past O0 in m."""
    h, n = snake.half_pitch, 2 * MODULES
    tool = 2 * h * n + snake.tool_offset
    plates = drive.plate_mass * h * n * n  # h, 3 h, 5 h, ... past O0
    balls = drive.ball_mass * h * n * (n - 1)  # 0, 2 h, 4 h, ...
    mass = drive.carriage_mass + n * (drive.plate_mass + drive.ball_mass)
    mass += drive.tool_mass
    moment = plates + balls + drive.tool_mass * tool - drive.carriage_mass * h
    return mass, moment / mass


@compiled
def _load(c: Any, posture: Posture) -> tuple[Load]:
    return (Load(c.mass, c.first + posture.x[0]),)


class SnakeLoad(StepBlock):
    """The snake as a load on the tube.

    Port ``posture`` accepts the snake's `Posture`, its translation counted from C.

    Port ``load`` emits the `Load`.
    """

    def __init__(
        self,
        snake: SnakeParams | None = None,
        drive: SnakeDriveParams | None = None,
        tube: TubeParams | None = None,
    ) -> None:
        """Makes the block for a snake, its drive and its tube."""
        super().__init__()
        snake, drive = check(snake or SnakeParams()), check(drive or SnakeDriveParams())
        tube = check(tube or TubeParams())
        mass, centre = weight_of(snake, drive)
        first = tube.length + tube.gap + centre
        constants = [packed(mass=mass, first=first)]
        self.declare_map(_load, constants, {"posture": Posture}, "load", Load)
