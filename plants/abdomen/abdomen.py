"""Abdominal wall, trocar sleeve and the spring between them.

The sleeve slides on the shaft, and a spring and damper pull its middle to the
fulcrum, a point of the wall. The spring is isotropic, but since the sleeve slides
freely only the part across the shaft is left at rest:

    f = -K (p_c - I)_perp - D d/dt (p_c - I)_perp

and, where the trocar resists tilting, a torque -k phi, phi from the wall's normal, is
what the wall does to the shaft, p_c being the shaft's point nearest the fulcrum
I. Along the shaft there is only the seal's friction, 0.25 to 3 N in the literature,
most of it dry. Lateral trocar stiffness was not found in vivo: sweep 100 to 3000 N/m.
What the tissue has beside the spring, a grain and a memory, stands in `tissue`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

from pydrake.geometry import Cylinder
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    LinearBushingRollPitchYaw,
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    SpatialInertia,
)

from plants.abdomen.skin import draw_skin
from plants.abdomen.tissue import TissueParams, add_tissue
from plants.common.looks import TROCAR, draw
from systems.common.compiled import compiled
from systems.common.geometry import Pose, Vector, along, cross, scaled
from systems.common.parameter import check, parameter, part

TURNING_DAMPING = 0.02
"""Of a trocar's resistance to tilting, for its stiffness, in s."""
_SEAL_VISCOSITY = 1e4
"""Slope of the seal's friction about zero speed, in N s/m: full friction is reached
at 0.1 mm/s per newton."""


@dataclass
class AbdomenParams:
    """Wall, sleeve and trocar spring."""

    stiffness: float = parameter(
        500.0, "K, lateral, of the trocar; 100 to 3000", "N/m", least=10, most=2e4
    )
    # Not found in vivo; a thick wall and a tight seal hold the cannula's direction.
    turning_stiffness: float = parameter(
        0.0, "of the trocar against tilting, 0 to 1", "N m/rad", least=0, most=5
    )
    # Over 10, CENIC needs more steps, or a heavier sleeve.
    damping: float = parameter(5.0, "D", "N s/m", least=0, most=100)
    seal_friction: float = parameter(
        0.5, "dry friction along the shaft; 0 for none", "N", least=0, most=20
    )
    seal_viscosity: float = parameter(
        2.0, "friction along the shaft with speed", "N s/m", least=0, most=100
    )
    # Light, for the sensor feels its inertia; below 20 g the sleeve on a stiff trocar
    # makes CENIC halve its steps.
    sleeve_mass: float = parameter(0.02, "of it alone", "kg", least=0.005, most=0.2)
    wall_mass: float = parameter(0.5, "that the servos move", "kg", least=0.05, most=10)
    wall_stiffness: float = parameter(
        2e5, "of the servos that place the wall", "N/m", least=1e3, most=1e6
    )
    tissue: TissueParams = part(TissueParams)


@dataclass
class Abdomen:
    """What `add_abdomen` added.

    Attributes:
        wall_instance: Model instance of the wall; its desired state is
            (x, y, z, and their rates) of the wall's displacement, in m and m/s. A
            servo that moves it sends positions alone (see `arm.SetPoint`).
        sleeve_instance: Model instance of the sleeve, whose one actuator is the
            seal's friction; hold it still.
        wall: The wall's body; its frame stands at the fulcrum at rest, axes as
            the parent frame's.
        sleeve: The sleeve's body, z along the shaft towards the tip.
        sleeve_joint: Its position is the distance from the sensor along the shaft.
        bushing: The spring, from the wall to the sleeve.
        slow: The body of the tissue's branch that relaxes; None without one.
        params: What it was made from.
    """

    wall_instance: ModelInstanceIndex
    sleeve_instance: ModelInstanceIndex
    wall: Any
    sleeve: Any
    sleeve_joint: PrismaticJoint
    bushing: LinearBushingRollPitchYaw
    slow: Any
    params: AbdomenParams


def add_abdomen(
    plant: Any,
    shaft: Any,
    p_PG: Sequence[float] = (0.0, 0.0, 0.0),
    params: AbdomenParams | None = None,
    parent: Any = None,
    bore: float = 0.0042,
) -> Abdomen:
    """Adds the wall, and a trocar that holds a shaft.

    Gravity is switched off for wall and sleeve: they are taken at their rest.

    Args:
        plant: A MultibodyPlant that is not yet finalized.
        shaft: The frame that the sleeve slides along, z towards the tip: an
            instrument's body frame.
        p_PG: The fulcrum G in the parent frame P (z out of the body), in m (3).
        params: Stiffness, friction, masses.
        parent: A frame of the plant; the world if None.
        bore: Radius in m that the trocar is drawn with.

    Raises:
        ValueError: If a parameter cannot be or the fulcrum is not finite.
    """
    params = params or AbdomenParams()
    check(params)
    if len(p_PG) != 3 or not all(math.isfinite(x) for x in p_PG):
        raise ValueError(f"abdomen: p_PG={list(p_PG)} must be three finite numbers")
    wall_instance = plant.AddModelInstance("wall")
    wall = _add_wall(plant, wall_instance, parent or plant.world_frame(), p_PG, params)
    draw_skin(plant, wall, p_PG)

    sleeve_instance = plant.AddModelInstance("sleeve")
    sleeve = plant.AddRigidBody(
        "sleeve",
        sleeve_instance,
        SpatialInertia.SolidSphereWithMass(params.sleeve_mass, 0.01),
    )
    joint = plant.AddJoint(
        PrismaticJoint(
            "sleeve",
            shaft,
            sleeve.body_frame(),
            [0.0, 0.0, 1.0],
            damping=params.seal_viscosity,
        )
    )
    if params.seal_friction > 0.0:
        # A servo of zero speed whose torque saturates is dry friction.
        seal = plant.AddJointActuator("seal", joint, params.seal_friction)
        seal.set_controller_gains(PdControllerGains(p=0.0, d=_SEAL_VISCOSITY))
    draw_trocar(plant, sleeve, bore)

    # Turned about x, so that the frames agree for a shaft straight down: the
    # bushing's angles stay far from their singularity at 90 degrees of pitch.
    fulcrum = plant.AddFrame(
        FixedOffsetFrame(
            "fulcrum",
            wall.body_frame(),
            RigidTransform(RotationMatrix.MakeXRotation(math.pi), [0.0, 0.0, 0.0]),
            wall_instance,
        )
    )
    bushing = plant.AddForceElement(
        LinearBushingRollPitchYaw(
            fulcrum,
            sleeve.body_frame(),
            [params.turning_stiffness, params.turning_stiffness, 0.0],
            [TURNING_DAMPING * params.turning_stiffness] * 2 + [0.0],
            [params.stiffness] * 3,
            [params.damping] * 3,
        )
    )
    slow = add_tissue(plant, wall, sleeve, params.tissue)
    for instance in (wall_instance, sleeve_instance):
        plant.set_gravity_enabled(instance, False)
    return Abdomen(
        wall_instance, sleeve_instance, wall, sleeve, joint, bushing, slow, params
    )


@compiled
def spring_on_sleeve(
    p: Vector, v: Vector, w: Vector, stiffness: float, damping: float
) -> tuple[Vector, Vector]:
    """What the bushing does to the sleeve, in W: torque about its origin, and force.

    Drake's bushing acts half-way between its two frames, and its damper does not count
    half of the frames' turning against each other.

    Args:
        p: From the fulcrum to the sleeve, in m.
        v: Velocity of the sleeve relative to the fulcrum, in m/s.
        w: Angular velocity of the sleeve; the wall does not turn.
        stiffness: K in N/m.
        damping: D in N s/m.
    """
    seen = along(v, -0.5, cross(w, p))
    force = along(scaled(-stiffness, p), -damping, seen)
    return scaled(-0.5, cross(p, force)), force


@compiled
def turning_on_sleeve(sleeve: Pose, w: Vector, k: Any, d: Any) -> Vector:
    """The torque in W of a bushing that resists turning, as Drake has it.

    It goes with roll, pitch and yaw of the sleeve in the fulcrum's frame, which is W's
    turned about x by half a turn.

    Args:
        sleeve: Its frame.
        w: Its angular velocity.
        k: The bushing's torque stiffness (3).
        d: Its torque damping (3).
    """
    x, y, z = sleeve.x, sleeve.y, sleeve.z
    roll, yaw = math.atan2(-y[2], -z[2]), math.atan2(-x[1], x[0])
    pitch = math.asin(min(max(x[2], -1.0), 1.0))
    c, s, cp, tp = math.cos(yaw), math.sin(yaw), math.cos(pitch), math.tan(pitch)
    # Their rates are N times the angular velocity, the torque N^T times theirs.
    across, along_ = c * w[0] - s * w[1], -s * w[0] - c * w[1]
    t0 = -k[0] * roll - d[0] * across / cp
    t1 = -k[1] * pitch - d[1] * along_
    t2 = -k[2] * yaw - d[2] * (tp * across - w[2])
    out = t0 / cp + tp * t2
    return c * out - s * t1, -(s * out + c * t1), -t2


def seat_sleeve(plant: Any, context: Any, abdomen: Abdomen) -> None:
    """Puts the sleeve on the shaft's point nearest the fulcrum.

    Args:
        plant: The finalized plant.
        context: Its context, with the arm already in its posture.
        abdomen: What `add_abdomen` returned.
    """
    X_WI = abdomen.wall.EvalPoseInWorld(context)
    X_WM = abdomen.sleeve_joint.frame_on_parent().CalcPoseInWorld(context)
    distance = (X_WM.inverse() @ X_WI.translation())[2]
    abdomen.sleeve_joint.set_translation(context, distance)


def draw_trocar(plant: Any, body: Any, bore: float = 0.0042) -> None:
    """Draws a cannula and its head around a body's z axis, which points inwards."""
    for name, radius, length, z, rgba in (
        ("cannula", bore, 0.056, 0.012, TROCAR),
        ("collar", 0.0085, 0.006, -0.010, TROCAR),
        ("head", 0.0115, 0.022, -0.024, TROCAR),
    ):
        draw(
            plant,
            body,
            Cylinder(radius, length),
            RigidTransform([0.0, 0.0, z]),
            name,
            rgba,
        )


def _add_wall(
    plant: Any,
    instance: ModelInstanceIndex,
    parent: Any,
    p_PG: Sequence[float],
    params: AbdomenParams,
) -> Any:
    """Three stiff prismatic servos in a row; the last body is the wall."""
    frame = plant.AddFrame(
        FixedOffsetFrame("wall_rest", parent, RigidTransform(p_PG), instance)
    )
    damping = 2.0 * math.sqrt(params.wall_stiffness * params.wall_mass)
    body = None
    for name, axis in zip("xyz", ([1, 0, 0], [0, 1, 0], [0, 0, 1]), strict=True):
        last = name == "z"
        mass = params.wall_mass if last else 0.02
        body = plant.AddRigidBody(
            "wall" if last else f"wall_{name}",
            instance,
            SpatialInertia.SolidSphereWithMass(mass, 0.05),
        )
        joint = plant.AddJoint(
            PrismaticJoint(f"wall_{name}", frame, body.body_frame(), axis)
        )
        servo = plant.AddJointActuator(f"wall_{name}", joint)
        servo.set_controller_gains(
            PdControllerGains(p=params.wall_stiffness, d=damping)
        )
        frame = body.body_frame()
    return body
