"""Where the robot stands before it works, and after."""

import numpy as np
from numpy.typing import NDArray

from plants.snake.parameters import SnakeParams
from plants.tissue.volume import Volume


def home_posture(volume: Volume, params: SnakeParams) -> NDArray[np.float64]:
    """Straight in the channel, the tool just within its end, (7,).

    Raises:
        ValueError: If the translation does not reach so far back.
    """
    straight = 3 * params.straight_module + params.tool_offset
    s = volume.depth - params.tool_radius - straight
    low, high = params.travel
    if not low <= s <= high:
        raise ValueError(
            f"home needs a translation of {s:.4f} m, outside travel [{low}, {high}] m"
        )
    return np.array([s, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
