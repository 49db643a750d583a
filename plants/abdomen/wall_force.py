"""The truth about the trocar: the wall's force on the shaft and the fulcrum's error.

For metrics, plots and tests; no controller may look at it.
"""

from collections.abc import Callable
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity

from plants.abdomen.abdomen import Abdomen
from systems.common.block import Block
from systems.common.compiled import Numbers, compiled
from systems.common.geometry import across, along, norm, scaled, sub, xyz
from systems.common.signal import Field, Vector, writer
from systems.common.signals import Force, MovingPoint


class FulcrumError(NamedTuple):
    """How far the shaft passes the true fulcrum."""

    distance: Annotated[float, Field("m", "of its line from the fulcrum", 1e-3)]


write_force = writer(Force)


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
def _lever(p_WI: Numbers, p_WC: Numbers, R_WC: np.ndarray) -> tuple[Vector, Vector]:
    return sub(p_WI, p_WC), xyz(R_WC[:, 2], 0)


class WallForce(Block):
    """Reads the wall's force and the fulcrum's error from the plant's bodies.

    Port ``body_poses`` accepts the plant's `body_poses`, port
    ``body_spatial_velocities`` the plant's output of that name.
    Port ``force`` emits the true `Force` of the wall on the shaft, across the shaft.
    The sleeve's own inertia and the bushing's turning rate are left out (20 g, and D
    times millimetres per second).
    Port ``fulcrum_error`` emits the `FulcrumError`.
    Port ``fulcrum`` emits the true fulcrum p_WI, a `MovingPoint`.
    """

    def __init__(
        self, abdomen: Abdomen, factor: Callable[[float], float] = lambda time: 1.0
    ) -> None:
        """Makes the block.

        Args:
            abdomen: What `add_abdomen` returned.
            factor: The trocar's stiffness against the abdomen's, by time in s.
        """
        super().__init__()
        self._factor = factor
        self._wall = int(abdomen.wall.index())
        self._sleeve = int(abdomen.sleeve.index())
        self._stiffness = float(abdomen.params.stiffness)
        self._damping = float(abdomen.params.damping)
        self._poses = self.DeclareAbstractInputPort(
            "body_poses", Value([RigidTransform()])
        )
        self._velocities = self.DeclareAbstractInputPort(
            "body_spatial_velocities", Value([SpatialVelocity()])
        )
        standing = {self._poses.ticket()}
        moving = standing | {self._velocities.ticket()}
        self._lever = self.cached("lever", self._calc_lever, standing)
        self.signal_out("force", Force, self._calc_force, moving | {self.time_ticket()})
        self.signal_out("fulcrum_error", FulcrumError, self._calc_error, standing)
        self.signal_out("fulcrum", MovingPoint, self._calc_fulcrum, moving)

    def _calc_lever(self, context: Any) -> tuple[Vector, Vector]:
        """From the sleeve to the fulcrum, and the shaft's axis, in W."""
        poses = self._poses.Eval(context)
        wall, sleeve = poses[self._wall], poses[self._sleeve]
        return _lever(
            wall.translation(), sleeve.translation(), sleeve.rotation().matrix()
        )

    def _calc_force(self, context: Any) -> np.ndarray:
        velocities = self._velocities.Eval(context)
        wall, sleeve = velocities[self._wall], velocities[self._sleeve]
        v = wall.translational() - sleeve.translational()
        p, u = self._lever.Eval(context)
        stiffness = self._stiffness * self._factor(context.get_time())
        force, _ = lateral_force(p, u, v, stiffness, self._damping)
        return write_force(Force(force))

    def _calc_error(self, context: Any) -> list[float]:
        p, u = self._lever.Eval(context)
        _, error = lateral_force(p, u, np.zeros(3), 0.0, 0.0)
        return [error]

    def _calc_fulcrum(self, context: Any) -> np.ndarray:
        p_WI = self._poses.Eval(context)[self._wall].translation()
        v_WI = self._velocities.Eval(context)[self._wall].translational()
        return np.concatenate([p_WI, v_WI])


def add_wall_force(
    builder: Any,
    plant: Any,
    abdomen: Abdomen,
    factor: Callable[[float], float] = lambda time: 1.0,
) -> WallForce:
    """Adds the block as `wall_force` and wires it to the plant."""
    block = builder.AddNamedSystem("wall_force", WallForce(abdomen, factor))
    for name in ("body_poses", "body_spatial_velocities"):
        builder.Connect(plant.GetOutputPort(name), block.GetInputPort(name))
    return block
