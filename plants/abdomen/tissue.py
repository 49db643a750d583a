"""What a trocar's tissue has beside one spring: a grain, and a memory.

**Grain.** The wall is stiffer along one direction n of it than across: a spring of
k_g more, so that the principal stiffnesses are K + k_g along n and K across. It is a
band of `BAND` metres from a far point of the wall to the sleeve, which so keeps its
direction however the tool spins.

**Memory.** A standard viscoelastic solid: parallel to the spring K a Maxwell branch, a
spring k_s in series with a damper c = k_s tau. A small body q slides on the wall
against the damper, and the spring ties the sleeve p to it:

    f = -k_s (p - q),    c dq/dt = k_s (p - q),

so that a quick push meets K + k_s, and exp(-t / tau) of the k_s is left after t.

Sources: in vivo, insufflated to 12 mmHg, 42.5 kPa transverse against 22.5 sagittal
(Song et al., Surgical Endoscopy 20, 2006, abstract); the linea alba 50 against 20 kPa
(Forces and deformations of the abdominal wall, abstract): a k_g as great as K. For
k_s and tau of a trocar none was found: both are assumed.
"""

from dataclasses import dataclass
from math import cos, pi, sin
from typing import Any

import numpy as np
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    LinearBushingRollPitchYaw,
    LinearSpringDamper,
    PrismaticJoint,
    SpatialInertia,
)

from plants.common.tree import pose_in
from systems.common.compiled import compiled
from systems.common.geometry import Vector, along, cross, norm, plus, scaled, sub, xyz
from systems.common.parameter import parameter

BAND = 1.0
"""Length of the band in m: a sleeve that is 5 mm aside turns it by 0.3 degrees."""
_MASS = 0.01  # of each of the small bodies, kg


@dataclass
class TissueParams:
    """Grain and memory of a trocar's tissue, none by default."""

    grain_stiffness: float = parameter(
        0.0, "k_g, beside K along the grain", "N/m", least=0, most=2e4
    )
    grain_direction: float = parameter(
        0.0, "of n in the wall, from x to y", "rad", least=-pi, most=pi
    )
    slow_stiffness: float = parameter(
        0.0, "k_s, of the branch that relaxes", "N/m", least=0, most=2e4
    )
    slow_time: float = parameter(
        2.0, "tau, in which it relaxes", "s", least=0.05, most=100
    )

    @property
    def grain(self) -> np.ndarray:
        """The direction n in the wall's frame (3)."""
        return np.array([cos(self.grain_direction), sin(self.grain_direction), 0.0])


def add_tissue(plant: Any, wall: Any, sleeve: Any, params: TissueParams) -> Any:
    """Adds grain and memory between wall and sleeve.

    Args:
        plant: A MultibodyPlant that is not yet finalized.
        wall: The wall's body, its origin at the fulcrum.
        sleeve: The sleeve's body, its origin on the shaft.
        params: What there is of them.

    Returns:
        The body of the branch that relaxes; None without one.
    """
    if params.grain_stiffness:
        anchor = -BAND * params.grain
        k, here = params.grain_stiffness, [0.0, 0.0, 0.0]
        band = LinearSpringDamper(wall, anchor, sleeve, here, BAND, k, 0.0)
        plant.AddForceElement(band)
    if not params.slow_stiffness:
        return None
    instance = plant.AddModelInstance("slow_tissue")
    damping = params.slow_stiffness * params.slow_time
    body = wall
    for name, axis in zip("xyz", np.eye(3), strict=True):
        frame = body.body_frame()
        inertia = SpatialInertia.SolidSphereWithMass(_MASS, 0.01)
        body = plant.AddRigidBody(f"slow_{name}", instance, inertia)
        child = body.body_frame()
        joint = PrismaticJoint(f"slow_{name}", frame, child, axis, damping=damping)
        plant.AddJoint(joint)
    turned = RigidTransform(RotationMatrix.MakeXRotation(pi), [0.0, 0.0, 0.0])
    slow = plant.AddFrame(FixedOffsetFrame("slow", body.body_frame(), turned, instance))
    free, spring = [0.0] * 3, [params.slow_stiffness] * 3
    plant.AddForceElement(
        LinearBushingRollPitchYaw(slow, sleeve.body_frame(), free, free, spring, free)
    )
    plant.set_gravity_enabled(instance, False)
    return body


def tissue_record(params: TissueParams, slow: Any) -> dict[str, Any]:
    """What `tissue_on_sleeve` is told of grain and memory: fields of its record."""
    return {
        "grain": params.grain,
        "grain_stiffness": float(params.grain_stiffness),
        "slow": int(slow.index()) if slow else 0,
        "slow_stiffness": float(params.slow_stiffness),
    }


@compiled
def tissue_on_sleeve(c: Any, X: np.ndarray, wall: Vector, sleeve: Vector) -> Any:
    """What grain and memory do to the sleeve, in W: torque about its origin, and force.

    Args:
        c: A record with the fields of `tissue_record`.
        X: Poses of the plant's bodies (n, 12).
        wall: The fulcrum, in m.
        sleeve: The sleeve's origin.
    """
    torque = force = (0.0, 0.0, 0.0)
    if c.grain_stiffness > 0.0:
        band = along(sub(sleeve, wall), BAND, xyz(c.grain, 0))
        long = norm(band)
        force = scaled(-c.grain_stiffness * (long - BAND) / long, band)
    if c.slow_stiffness > 0.0:
        p = sub(sleeve, pose_in(X, c.slow).p)
        pull = scaled(-c.slow_stiffness, p)
        # Drake's bushing acts half-way between its two frames.
        torque, force = scaled(-0.5, cross(p, pull)), plus(force, pull)
    return torque, force
