"""What holds the two balls of a module alike: an elastic core, nothing, or gears."""

from dataclasses import dataclass
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from plants.snake.parameters import MODULES
from plants.snake.posture import Array
from systems.common.compiled import compiled
from systems.common.parameter import parameter

KINDS = ("none", "elastic", "coupled")


@dataclass
class SnakeCoreParams:
    """What stands between the balls besides wires.

    The paper takes both balls of a module to turn alike and without torsion. Wires
    alone do not do that (`statics`). An elastic core along the robot does, if it is
    stiff enough: a rod of bending stiffness EI has `bend` = EI/(2h) a ball, so that
    the default is a superelastic rod of 0.55 mm (E = 57 GPa), and GJ/EI = 1/(1 + nu)
    gives `twist`. Both are assumed, not measured.
    """

    kind: str = parameter(
        "elastic",
        "none (wires alone), elastic, or coupled: the balls of a module geared to "
        "turn alike, without torsion, the paper's ideal",
        choices=KINDS,
    )
    bend: float = parameter(
        0.040, "of an elastic core, a ball", "N m/rad", least=0.0, most=10.0
    )
    twist: float = parameter(
        0.031, "of an elastic core, a ball", "N m/rad", least=0.0, most=10.0
    )


@compiled
def core_torques(ab: Any, bend: float, tau: Any) -> None:
    """As `torques_against_core`, added to tau (6,); `bend` is the core's, a ball."""
    for k in range(MODULES):
        ca, sa = math.cos(ab[2 * k]), math.sin(ab[2 * k])
        cb, sb = math.cos(ab[2 * k + 1]), math.sin(ab[2 * k + 1])
        sine = math.hypot(sb, sa * cb)
        beta = math.atan2(sine, ca * cb)
        # Both balls of a module, 1/2 bend beta^2 each, and cos(beta) = cos(a) cos(b).
        torque = 2 * bend * beta / (sine if sine > 0.0 else 1.0)
        tau[2 * k] += torque * sa * cb
        tau[2 * k + 1] += torque * ca * sb


def torques_against_core(ab: ArrayLike, core: SnakeCoreParams) -> Array:
    """Torques on (a1, b1, ..., b3) that bend the core as the paper's snake bends.

    Args:
        ab: Angles in rad, (6,).
        core: Of which only an elastic one resists.

    Returns:
        tau in Nm, (6,), to be given to `tension.tensions`.
    """
    tau = np.zeros(2 * MODULES)
    bend = core.bend if core.kind == "elastic" else 0.0
    core_torques(np.asarray(ab, float), bend, tau)
    return tau
