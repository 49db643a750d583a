"""The truth about the trocar: the wall's force on the shaft and the fulcrum's error.

For metrics, plots and tests; no controller may look at it.
"""

from collections.abc import Callable
import math
from typing import Any

from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialVelocity
from pydrake.systems.framework import LeafSystem, ValueProducer

from plants.abdomen.abdomen import Abdomen

Vector = tuple[float, float, float]


def lateral_force(
    p: Vector, u: Vector, v: Vector, stiffness: float, damping: float
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
    along_p = p[0] * u[0] + p[1] * u[1] + p[2] * u[2]
    along_v = v[0] * u[0] + v[1] * u[1] + v[2] * u[2]
    px, py, pz = (a - along_p * b for a, b in zip(p, u, strict=True))
    vx, vy, vz = (a - along_v * b for a, b in zip(v, u, strict=True))
    force = (
        stiffness * px + damping * vx,
        stiffness * py + damping * vy,
        stiffness * pz + damping * vz,
    )
    return force, math.sqrt(px * px + py * py + pz * pz)


class WallForce(LeafSystem):
    """Reads the wall's force and the fulcrum's error from the plant's bodies.

    Port ``body_poses`` accepts the plant's `body_poses`, port
    ``body_spatial_velocities`` the plant's output of that name.
    Port ``force`` emits the true force of the wall on the shaft, across the shaft,
    in N, world frame (3). The sleeve's own inertia and the bushing's turning rate
    are left out (20 g, and D times millimetres per second).
    Port ``fulcrum_error`` emits the distance of the shaft's line from the true
    fulcrum in m (1).
    Port ``fulcrum`` emits the true fulcrum p_WI in m and its velocity in m/s (6).
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
        self._stiffness = abdomen.params.stiffness
        self._damping = abdomen.params.damping
        self._poses = self.DeclareAbstractInputPort(
            "body_poses", Value([RigidTransform()])
        )
        self._velocities = self.DeclareAbstractInputPort(
            "body_spatial_velocities", Value([SpatialVelocity()])
        )
        self._lever = self.DeclareCacheEntry(
            "lever",
            ValueProducer(
                allocate=lambda: Value(object()),
                calc=lambda context, value: value.set_value(self._calc_lever(context)),
            ),
            {self._poses.ticket()},
        )
        self.DeclareVectorOutputPort(
            "force",
            3,
            self._calc_force,
            {self._poses.ticket(), self._velocities.ticket(), self.time_ticket()},
        )
        self.DeclareVectorOutputPort(
            "fulcrum_error", 1, self._calc_error, {self._poses.ticket()}
        )
        self.DeclareVectorOutputPort(
            "fulcrum",
            6,
            self._calc_fulcrum,
            {self._poses.ticket(), self._velocities.ticket()},
        )

    def _calc_lever(self, context: Any) -> tuple[Vector, Vector]:
        """From the sleeve to the fulcrum, and the shaft's axis, in W."""
        poses = self._poses.Eval(context)
        sleeve = poses[self._sleeve]
        p = poses[self._wall].translation() - sleeve.translation()
        return p.tolist(), sleeve.rotation().col(2).tolist()

    def _calc_force(self, context: Any, output: Any) -> None:
        velocities = self._velocities.Eval(context)
        v = (
            velocities[self._wall].translational()
            - velocities[self._sleeve].translational()
        )
        p, u = self._lever.Eval(context)
        stiffness = self._stiffness * self._factor(context.get_time())
        force, _ = lateral_force(p, u, v.tolist(), stiffness, self._damping)
        output.SetFromVector(force)

    def _calc_error(self, context: Any, output: Any) -> None:
        p, u = self._lever.Eval(context)
        _, error = lateral_force(p, u, (0.0, 0.0, 0.0), 0.0, 0.0)
        output.SetFromVector([error])

    def _calc_fulcrum(self, context: Any, output: Any) -> None:
        p_WI = self._poses.Eval(context)[self._wall].translation()
        v_WI = self._velocities.Eval(context)[self._wall].translational()
        output.SetFromVector([*p_WI, *v_WI])


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
