"""The robot's 5 mm laparoscopic instrument, with gauze at its tip.

It hangs on the arm by a weld joint whose reaction is what the wrist force/torque
sensor feels: force and moment of the arm on the instrument, at the mount frame and
expressed in it. Straight tools of 3 to 10 mm diameter and 200 to 450 mm length are
usual.

A shaft may bend. As a beam of length l, held in the mount and pushed at its tip, it
goes by F l^3 / 3EI there and turns by F l^2 / 2EI, and so does a rigid piece behind a
joint of stiffness 4EI / 3l, a third of l from the mount. Pushed elsewhere, at 0.4, 0.5
and 0.7 l, the tip goes by 48, 80 and 98 % of a beam's way. EI of steel (200 GPa) is
6.1 N m^2 for a rod of 5 mm and 5.3 for a tube with a wall of 1 mm.
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
    RevoluteJoint,
    RevoluteSpring,
    SpatialInertia,
    UnitInertia,
    WeldJoint,
)

from plants.common.looks import DARK, GAUZE, STEEL, draw
from systems.common.parameter import Rules, check, parameter

GAUZE_RADIUS = 0.0045
"""Of the gauze in the jaw, the longest, m."""
_LOSS = 2e-4
"""Damping of the bend over its stiffness, in s: 2 % of critical; assumed."""
_KNUCKLE = 5e-4  # of the body between the bend's two axes, kg
SOFTEST = 2.0
"""EI of a shaft that bends, at the least: nothing softer was tried, N m^2."""
DRY_GAUZE = 0.002
"""Its mass, kg; wet it is 0.02."""


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
    bending_stiffness: float = parameter(
        0.0, "EI of the shaft, 2 to 100; rigid if 0", "N m^2", least=0, most=100
    )

    def rules(self) -> Rules:
        """A softer shaft's own swing is slower than the wrist is sampled."""
        stiff = self.bending_stiffness == 0.0 or self.bending_stiffness >= SOFTEST
        yield stiff, "bending_stiffness", f"0 or >= {SOFTEST:g} N m^2"

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

    @property
    def bend_joint(self) -> float:
        """Distance of the bend's joint from the sensor, in m."""
        return self.mount_length + (self.length - self.mount_length) / 3.0

    @property
    def bend_stiffness(self) -> float:
        """Of that joint, in N m/rad."""
        free = self.length - self.mount_length
        return 4.0 * (self.bending_stiffness or 1e6) / (3.0 * free)

    @property
    def bent_mass(self) -> float:
        """Of what is behind the joint, in kg."""
        return self.shaft_mass * (1.0 - self.bend_joint / self.length) + self.gauze_mass

    @property
    def bent_centre(self) -> float:
        """Distance of its centre of mass from the sensor, in m."""
        rod = self.bent_mass - self.gauze_mass
        moment = 0.5 * rod * (self.length + self.bend_joint)
        return (moment + self.gauze_mass * self.length) / self.bent_mass


@dataclass
class Instrument:
    """What `add_instrument` added.

    Attributes:
        instance: The model instance.
        body: The rigid body, whose frame is the mount frame M: origin at the
            sensor, z along the shaft towards the tip.
        shaft: The body that goes through the wall: `body`, or where the shaft bends
            what is behind the bend, its frame M's as long as it is straight.
        tip: The frame `instrument_tip`, axes as the shaft's, origin at the tip.
        sensor: The weld joint, which the wrist's sensor sits in.
        shaft_geometry: The shaft's proximity geometry, None without SceneGraph.
        length: From the sensor to the tip, in m.
        params: What it was made from.
    """

    instance: ModelInstanceIndex
    body: Any
    shaft: Any
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
    shaft = _add_bent(plant, body, params) if params.bending_stiffness else body
    tip = plant.AddFrame(
        FixedOffsetFrame(
            "instrument_tip",
            shaft.body_frame(),
            RigidTransform([0.0, 0.0, params.length]),
            instance,
        )
    )
    (look or _draw)(plant, shaft, params)
    geometry = None
    if plant.geometry_source_is_registered():
        length = params.length - params.mount_length
        geometry = plant.RegisterCollisionGeometry(
            shaft,
            RigidTransform([0.0, 0.0, params.mount_length + 0.5 * length]),
            Capsule(0.5 * params.diameter, length - params.diameter),
            "shaft",
            CoulombFriction(0.1, 0.1),
        )
    return Instrument(
        instance, body, shaft, tip, sensor, geometry, params.length, params
    )


def _add_bent(plant: Any, body: Any, params: InstrumentParams) -> Any:
    """Adds what is behind the bend, on two axes with springs."""
    instance = body.model_instance()
    ball = SpatialInertia.SolidSphereWithMass(_KNUCKLE, 0.0025)
    knuckle = plant.AddRigidBody("bend", instance, ball)
    shaft = plant.AddRigidBody("shaft", instance, _bent_inertia(params))
    at = RigidTransform([0.0, 0.0, params.bend_joint])
    before, behind = (
        plant.AddFrame(FixedOffsetFrame(f"{name}_bend", of.body_frame(), at, instance))
        for name, of in (("before", body), ("behind", shaft))
    )
    k = params.bend_stiffness
    for name, parent, child, axis in (
        ("bend_x", before, knuckle.body_frame(), [1.0, 0.0, 0.0]),
        ("bend_y", knuckle.body_frame(), behind, [0.0, 1.0, 0.0]),
    ):
        joint = plant.AddJoint(RevoluteJoint(name, parent, child, axis, _LOSS * k))
        plant.AddForceElement(RevoluteSpring(joint, 0.0, k))
    return shaft


def _rod(mass: float, radius: float, start: float, end: float) -> SpatialInertia:
    """A rod along z from one distance to another, about M."""
    rod_inertia = UnitInertia.SolidCylinder(radius, end - start, [0.0, 0.0, 1.0])
    return SpatialInertia.MakeFromCentralInertia(
        mass, [0.0, 0.0, 0.5 * (start + end)], rod_inertia * mass
    )


def _bent_inertia(params: InstrumentParams) -> SpatialInertia:
    """Of what is behind the bend, the gauze a ball of 4 mm radius, about M."""
    radius, length = 0.5 * params.diameter, params.length
    rod = params.bent_mass - params.gauze_mass - _KNUCKLE
    total = _rod(rod, radius, params.bend_joint, length)
    return _with_gauze(total, params)


def _with_gauze(total: SpatialInertia, params: InstrumentParams) -> SpatialInertia:
    if params.gauze_mass > 0.0:
        ball = UnitInertia.SolidSphere(0.004) * params.gauze_mass
        total += SpatialInertia.MakeFromCentralInertia(
            params.gauze_mass, [0.0, 0.0, params.length], ball
        )
    return total


def _inertia(params: InstrumentParams) -> SpatialInertia:
    """Mount and shaft as rods, the gauze as a ball of 4 mm radius, about M.

    Where the shaft bends, of what is before the bend.
    """
    radius = 0.5 * params.diameter
    total = _rod(params.mount_mass, 0.018, 0.0, params.mount_length)
    if params.bending_stiffness:
        end = params.bend_joint
        mass = params.shaft_mass * end / params.length
        total += _rod(mass, radius, 0.0, end)
        return total
    total += _rod(params.shaft_mass, radius, 0.0, params.length)
    return _with_gauze(total, params)


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
