"""The truth about the trocar: the wall's force on the shaft and the fulcrum's error.

For metrics, plots and tests; no controller may look at it.
"""

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.abdomen.abdomen import Abdomen
from plants.abdomen.tissue import tissue_on_sleeve, tissue_record
from plants.common.tree import move_tree, pose_in, read_tree
from systems.common.compiled import Numbers, compiled, packed
from systems.common.geometry import across, along, norm, plus, scaled, sub, xyz
from systems.common.signal import Field, Vector
from systems.common.signals import Force, MovingPoint
from systems.common.step_block import StepBlock, wired


class FulcrumError(NamedTuple):
    """How far the shaft passes the true fulcrum."""

    distance: Annotated[float, Field("m", "of its line from the fulcrum", 1e-3)]


@compiled
def lateral_force(
    p: Numbers, u: Numbers, v: Numbers, stiffness: float, damping: float
) -> tuple[Vector, float]:
    """Force of the wall on a shaft, across the shaft.

    Args:
        p: From the sleeve to the fulcrum, in m.
        u: Unit vector along the shaft.
        v: Velocity of the fulcrum relative to the sleeve, in m/s.
        stiffness: K in N/m.
        damping: D in N s/m.

    Returns:
        K p_perp + D v_perp in N, and |p_perp|, the distance of the shaft's line
        from the fulcrum, in m.
    """
    p_perp = across(p, u)
    return along(scaled(stiffness, p_perp), damping, across(v, u)), norm(p_perp)


@compiled
def _truth(
    c: Any, tree: Any, state: np.ndarray, stiffness: np.ndarray
) -> tuple[Force, FulcrumError, MovingPoint]:
    n, bodies = len(state) // 2, len(tree.parent)
    X, V = np.zeros((bodies, 12)), np.zeros((bodies, 6))
    move_tree(tree, state[:n], state[n:], X, V)
    wall, sleeve = pose_in(X, c.wall), pose_in(X, c.sleeve)
    v_WI = xyz(V[c.wall], 3)
    v = sub(v_WI, xyz(V[c.sleeve], 3))
    force, away = lateral_force(
        sub(wall.p, sleeve.p), sleeve.z, v, stiffness[0], c.damping
    )
    if c.grain_stiffness + c.slow_stiffness > 0.0:
        _, pull = tissue_on_sleeve(c, X, wall.p, sleeve.p)
        force = plus(force, across(pull, sleeve.z))
    return Force(force), FulcrumError(away), MovingPoint(wall.p, v_WI)


class WallForce(StepBlock):
    """Reads the wall's force and the fulcrum's error from the plant's state.

    Port ``state`` accepts the plant's state.
    Port ``force`` emits the true `Force` of the wall on the shaft, across the shaft.
    The sleeve's own inertia and the bushing's turning rate are left out (20 g, and D
    times millimetres per second).
    Port ``fulcrum_error`` emits the `FulcrumError`.
    Port ``fulcrum`` emits the true fulcrum p_WI, a `MovingPoint`.
    """

    def __init__(
        self,
        plant: Any,
        abdomen: Abdomen,
        factor: Callable[[float], float] = lambda time: 1.0,
    ) -> None:
        """Makes the block.

        Args:
            plant: The finalized plant.
            abdomen: What `add_abdomen` returned.
            factor: The trocar's stiffness against the abdomen's, by time in s.
        """
        super().__init__()
        self._factor, self._stiffness = factor, abdomen.params.stiffness
        self._constants = packed(
            wall=int(abdomen.wall.index()),
            sleeve=int(abdomen.sleeve.index()),
            damping=float(abdomen.params.damping),
            **tissue_record(abdomen.params.tissue, abdomen.slow),
        )
        self._tree = read_tree(plant)
        start = plant.GetPositionsAndVelocities(plant.CreateDefaultContext())
        gives = [Force, FulcrumError, MovingPoint]
        self._read = wired(_truth, 2, [], [len(start), 1], gives, False)
        self._state = self.vector_in("state", start.tolist())
        truth = self.cached(
            "truth", self._calc_truth, {self._state.ticket(), self.time_ticket()}
        )
        outputs = dict(zip(("force", "fulcrum_error", "fulcrum"), gives, strict=True))
        self._emit(truth, outputs, 0)

    def _calc_truth(self, context: Any) -> np.ndarray:
        stiffness = np.array([self._stiffness * self._factor(context.get_time())])
        state = self._state.Eval(context)
        return self._read(self._constants, self._tree, state, stiffness)


def add_wall_force(
    builder: Any,
    plant: Any,
    abdomen: Abdomen,
    factor: Callable[[float], float] = lambda time: 1.0,
) -> WallForce:
    """Adds the block as `wall_force` and wires it to the plant."""
    block = builder.AddNamedSystem("wall_force", WallForce(plant, abdomen, factor))
    builder.Connect(plant.get_state_output_port(), block.GetInputPort("state"))
    return block
