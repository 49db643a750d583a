"""The paper's forward actuation: two of a module's three wires (IV.B.2).

Two norms p_i leave a line in the half turn u of `actuation`, and |u| = 1 cuts it
twice: two solutions, where the dialytic elimination of the paper [18] has an octic
with spurious roots. Of the two, at most one is within the bend's limit as long as
tan(max_bend/2) < R/(2d), which `SnakeParams.rules` demand.
"""

import math

import numpy as np

from plants.snake.actuation import norm_of_length
from plants.snake.parameters import SnakeParams
from plants.snake.posture import Array


def all_solutions(
    lengths: tuple[float, float], azimuths: tuple[float, float], params: SnakeParams
) -> Array:
    """All (alpha, beta) in rad with two given wire lengths, (0 or 2, 2).

    Args:
        lengths: Of the two wires in one module, in m.
        azimuths: Of the two wires, in rad.
        params: The snake.

    Returns:
        Real solutions, by rising beta; beta may exceed its limit, up to pi.
    """
    R, d = params.ball_radius, params.face
    p = [
        norm_of_length(L, R, params.plate_thickness, params.half_pitch) for L in lengths
    ]
    rows = np.array(
        [[2 * d, -2 * R * math.cos(f), -2 * R * math.sin(f)] for f in azimuths]
    )
    nearest = np.linalg.pinv(rows) @ p
    along = np.cross(rows[0], rows[1])
    along /= np.linalg.norm(along)
    square = 1.0 - float(nearest @ nearest)
    if not square >= 0.0:
        return np.empty((0, 2))
    found = []
    for sign in (1.0, -1.0):
        c, xi, eta = nearest + sign * math.sqrt(square) * along
        found.append((math.atan2(eta, xi), 2 * math.atan2(math.hypot(xi, eta), c)))
    return np.array(sorted(found, key=lambda solution: solution[1]))


def solve(
    lengths: tuple[float, float], azimuths: tuple[float, float], params: SnakeParams
) -> tuple[float, float]:
    """The one solution (alpha, beta) within the bend's limit, in rad.

    Raises:
        ValueError: If there is none.
    """
    for alpha, beta in all_solutions(lengths, azimuths, params):
        if beta <= params.max_bend + 1e-9:
            return float(alpha), float(beta)
    raise ValueError(
        f"no posture with beta <= {params.max_bend:.4f} rad has wires of "
        f"{1e3 * lengths[0]:.3f} and {1e3 * lengths[1]:.3f} mm at azimuths "
        f"{azimuths[0]:.3f} and {azimuths[1]:.3f} rad"
    )
