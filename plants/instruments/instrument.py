"""The robot's 5 mm laparoscopic instrument, with gauze at its tip.

It hangs on the arm by a weld joint whose reaction is what the wrist force/torque
sensor feels: force and moment of the arm on the instrument, at the mount frame and
expressed in it. Straight tools of 3 to 10 mm diameter and 200 to 450 mm length are
usual; shaft bending is left out.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from pydrake.geometry import Capsule, Cylinder, Ellipsoid
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    ModelInstanceIndex,
    SpatialInertia,
    UnitInertia,
    WeldJoint,
)

from plants.common.looks import DARK, GAUZE, STEEL, draw
from systems.common.parameter import check, parameter

GAUZE_RADIUS = 0.0045
"""Of the gauze in the jaw, the longest, m."""
DRY_GAUZE, WET_GAUZE = 0.002, 0.02
"""Its mass, kg."""


@dataclass
class InstrumentParams:
    """Dimensions and masses of the instrument."""

    length: float = parameter(
        0.40, "from the sensor to the tip", "m", least=0.2, most=0.45
    )
    diameter: float = parameter(0.005, "of the shaft", "m", least=0.003, most=0.01)
    mount_length: float = parameter(
        0.06, "of what the sensor carries the shaft with", "m", least=0.02, most=0.1
    )
    mount_mass: float = parameter(0.16, "of the mount", "kg", least=0.01, most=1)
    shaft_mass: float = parameter(0.04, "of the shaft", "kg", least=0.005, most=0.5)
    gauze_mass: float = parameter(
        0.0, "of the gauze at the tip: dry 0.002, wet 0.02", "kg", least=0, most=0.1
    )

    @property
    def mass(self) -> float:
        """All that hangs below the sensor, in kg."""
        return self.mount_mass + self.shaft_mass + self.gauze_mass

    @property
    def centre(self) -> float:
        """Distance of the centre of mass from the sensor, in m."""
        moment = (
            self.mount_mass * 0.5 * self.mount_length
            + self.shaft_mass * 0.5 * self.length
            + self.gauze_mass * self.length
        )
        return moment / self.mass


@dataclass
class Instrument:
    """What `add_instrument` added.

    Attributes:
        instance: The model instance.
        body: The rigid body, whose frame is the mount frame M: origin at the
            sensor, z along the shaft towards the tip.
        tip: The frame `instrument_tip`, axes as M's, origin at the tip.
        sensor: The weld joint, which the wrist's sensor sits in.
        shaft_geometry: The shaft's proximity geometry, None without SceneGraph.
        length: From the sensor to the tip, in m.
        params: What it was made from.
    """

    instance: ModelInstanceIndex
    body: Any
    tip: Any
    sensor: WeldJoint
    shaft_geometry: Any
    length: float
    params: InstrumentParams


def add_instrument(
    plant: Any,
    frame: Any,
    params: InstrumentParams | None = None,
    look: Callable[[Any, Any, Any], None] | None = None,
) -> Instrument:
    """Hangs the instrument on a frame of the plant through the wrist sensor.

    The shaft is a capsule for proximity, from the mount to the tip, the tip on its
    surface. The gauze is soft: it is drawn and weighed, and takes no part in
    clearances.

    Args:
        plant: A MultibodyPlant that is not yet finalized.
        frame: What carries the sensor, for example the arm's `flange`; z along the
            instrument.
        params: Dimensions and masses.
        look: Draws it, of plant, body and params; a gauze holder if None.

    Raises:
        ValueError: If a parameter cannot be.
    """
    params = params or InstrumentParams()
    check(params)
    instance = plant.AddModelInstance("instrument")
    body = plant.AddRigidBody("instrument", instance, _inertia(params))
    sensor = plant.AddJoint(
        WeldJoint("wrist_sensor", frame, body.body_frame(), RigidTransform())
    )
    tip = plant.AddFrame(
        FixedOffsetFrame(
            "instrument_tip",
            body.body_frame(),
            RigidTransform([0.0, 0.0, params.length]),
            instance,
        )
    )
    (look or _draw)(plant, body, params)
    geometry = None
    if plant.geometry_source_is_registered():
        length = params.length - params.mount_length
        geometry = plant.RegisterCollisionGeometry(
            body,
            RigidTransform([0.0, 0.0, params.mount_length + 0.5 * length]),
            Capsule(0.5 * params.diameter, length - params.diameter),
            "shaft",
            CoulombFriction(0.1, 0.1),
        )
    return Instrument(instance, body, tip, sensor, geometry, params.length, params)


def _inertia(params: InstrumentParams) -> SpatialInertia:
    """Mount and shaft as rods, the gauze as a ball of 4 mm radius, about M."""

    def rod(mass: float, radius: float, length: float) -> SpatialInertia:
        rod_inertia = UnitInertia.SolidCylinder(radius, length, [0.0, 0.0, 1.0])
        return SpatialInertia.MakeFromCentralInertia(
            mass, [0.0, 0.0, 0.5 * length], rod_inertia * mass
        )

    total = rod(params.mount_mass, 0.018, params.mount_length)
    total += rod(params.shaft_mass, 0.5 * params.diameter, params.length)
    if params.gauze_mass > 0.0:
        ball = UnitInertia.SolidSphere(0.004) * params.gauze_mass
        total += SpatialInertia.MakeFromCentralInertia(
            params.gauze_mass, [0.0, 0.0, params.length], ball
        )
    return total


def _draw(plant: Any, body: Any, params: InstrumentParams) -> None:
    """Sensor disc, mount, shaft, jaw and gauze."""

    def along(z: float) -> RigidTransform:
        return RigidTransform([0.0, 0.0, z])

    mount, length = params.mount_length, params.length
    radius = 0.5 * params.diameter
    draw(plant, body, Cylinder(0.034, 0.016), along(0.008), "sensor", STEEL)
    draw(
        plant,
        body,
        Cylinder(0.020, mount - 0.016),
        along(0.5 * mount + 0.008),
        "mount",
        DARK,
    )
    shaft = length - mount - 0.012
    draw(
        plant,
        body,
        Cylinder(radius, shaft),
        along(mount + 0.5 * shaft),
        "shaft_look",
        STEEL,
    )
    draw(plant, body, Capsule(0.6 * radius, 0.012), along(length - 0.006), "jaw", DARK)
    draw(
        plant,
        body,
        Ellipsoid(GAUZE_RADIUS, 0.004, 0.004),
        along(length),
        "gauze",
        GAUZE,
    )
