"""The snake as a multibody plant: three modules on a translation.

The paper's model of a module (Figure 4) is singular at beta = 0, where alpha turns
freely. The same motion without that singularity is a chain of four revolute joints,

    Rx(a) Ry(b) at the first ball,  Ry(b) Rx(a) at the second,

in which two couplers make the second ball do what the first does; this is equation
(1) to rounding. The balls are the bodies between the two joints of each universal
pair. The plate between the balls rolls by up to 10 deg against the paper's
torsion-free plate, which moves nothing that the wires or the next module see;
wires are drawn from the torsion-free pose (`wire_path`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.math import RigidTransform
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    ModelInstanceIndex,
    PdControllerGains,
    PrismaticJoint,
    RevoluteJoint,
    SpatialInertia,
    UnitInertia,
)

from plants.snake.balls import ball_posture
from plants.snake.drive import SnakeDriveParams
from plants.snake.looks import draw_ball, draw_carriage, draw_plate, draw_tool
from plants.snake.parameters import MODULES, STOP, SnakeParams
from systems.common.parameter import check

POSITIONS = 1 + 4 * MODULES
"""Generalised positions, and velocities: s, then a, b, b_far, a_far a module."""

BALL_POSITIONS = 1 + 6 * MODULES
"""With spherical joints: s, then Rx, Ry, Rz of each ball."""

NEAR_ANGLES = np.array([i for k in range(MODULES) for i in (1 + 4 * k, 2 + 4 * k)])
"""Where a1, b1, a2, ... stand among them."""

NEAR = np.array([0, *NEAR_ANGLES])
"""Where s, a1, b1, a2, ... stand."""

FAR = np.array([i for k in range(MODULES) for i in (4 + 4 * k, 3 + 4 * k)])
"""Where the coupled angles a1_far, b1_far, ... stand."""


@dataclass
class Snake:
    """What `add_snake` added.

    Attributes:
        instance: The model instance; its state is `POSITIONS` positions, then as
            many velocities, and its actuators are s, a1, b1, a2, b2, a3, b3.
        tool: Frame T of the tool: `tool_offset` past O3, z along the axis.
        params: Geometry.
        drive: Masses and gains.
    """

    instance: ModelInstanceIndex
    tool: Any
    params: SnakeParams
    drive: SnakeDriveParams


def add_snake(
    plant: Any,
    frame: Any,
    params: SnakeParams | None = None,
    drive: SnakeDriveParams | None = None,
    elastic: bool = False,
    joints: str = "coupled",
) -> Snake:
    """Adds the snake to a plant, its channel's z axis along that of a frame.

    Args:
        plant: A MultibodyPlant that is not yet finalized.
        frame: The channel's frame W of `kinematics`: O0 lies on its z axis, at
            the height s of the translation.
        params: Geometry.
        drive: Masses and gains.
        elastic: Without springs on the modules' angles: wires of their own
            (`plants.snake.elastic_wires`) hold them.
        joints: "coupled", as in the paper, or "spherical": each ball turns as its
            servos are told (`plants.snake.statics`), which knows the weight; so
            nothing of the snake weighs here.

    Returns:
        Instance, tool frame and parameters.

    Raises:
        ValueError: If a parameter makes no sense.
    """
    params = check(params or SnakeParams())
    drive = check(drive or SnakeDriveParams())
    instance = plant.AddModelInstance("snake")
    chain = _Chain(plant, instance, params, drive, elastic)
    chain.add_carriage(frame)
    if joints == "spherical":
        for i in range(1, 2 * MODULES + 1):
            chain.add_ball(i)
        plant.set_gravity_enabled(instance, False)
    elif joints == "coupled":
        for k in range(1, MODULES + 1):
            chain.add_module(k)
    else:
        raise ValueError(f"joints={joints!r}: expected 'coupled' or 'spherical'")
    return Snake(instance, chain.add_tool(), params, drive)


def set_default_posture(plant: Any, snake: Snake, x: Sequence[float]) -> None:
    """Makes a posture the one that a plant's new contexts begin with.

    Of a snake with spherical joints the balls begin alike, and without torsion.

    Args:
        plant: The finalized plant.
        snake: What `add_snake` added to it.
        x: The posture as s, a1, b1, ..., b3, (7,).
    """
    q = np.zeros(plant.num_positions(snake.instance))
    if len(q) == BALL_POSITIONS:
        q[:] = ball_posture(x)
    else:
        q[NEAR], q[FAR] = x, x[1:]
    plant.SetDefaultPositions(snake.instance, q)


class _Chain:
    """The growing chain; its end is a frame at the next ball's centre."""

    def __init__(
        self,
        plant: Any,
        instance: ModelInstanceIndex,
        params: SnakeParams,
        drive: SnakeDriveParams,
        elastic: bool,
    ) -> None:
        self.plant = plant
        self.instance = instance
        self.params = params
        self.drive = drive
        self.elastic = elastic
        self.body: Any = None
        self.end: Any = None

    def _body(self, name: str, mass: float, centre: float, inertia: Any) -> Any:
        about_centre = SpatialInertia.MakeFromCentralInertia(
            mass, [0.0, 0.0, centre], inertia * mass
        )
        return self.plant.AddRigidBody(name, self.instance, about_centre)

    def _disc(self) -> UnitInertia:
        # A plate's sockets embrace half a ball each: a cylinder of length h.
        return UnitInertia.SolidCylinder(
            self.params.body_radius, self.params.half_pitch, [0.0, 0.0, 1.0]
        )

    def _frame(self, name: str, body: Any, z: float) -> Any:
        return self.plant.AddFrame(
            FixedOffsetFrame(name, body.body_frame(), RigidTransform([0, 0, z]))
        )

    def add_carriage(self, frame: Any) -> None:
        """The base plate on the translation; the body's origin is O0."""
        h = self.params.half_pitch
        carriage = self._body("carriage", self.drive.carriage_mass, -h, self._disc())
        joint = self.plant.AddJoint(
            PrismaticJoint("s", frame, carriage.body_frame(), [0.0, 0.0, 1.0])
        )
        self._servo(joint, self.drive.travel_kp, self.drive.travel_kd)
        hosted = frame.body().index() != self.plant.world_body().index()
        draw_carriage(self.plant, carriage, self.params, hosted)
        self.body, self.end = carriage, carriage.body_frame()

    def add_module(self, k: int) -> None:
        """Ball, plate, ball, plate, and the couplers between the balls."""
        a = self._turn(f"a{k}", 0, f"ball{2 * k - 1}", True)
        b = self._turn(f"b{k}", 1, f"plate{2 * k - 1}", False)
        b_far = self._turn(f"b{k}_far", 1, f"ball{2 * k}", True)
        a_far = self._turn(f"a{k}_far", 0, f"plate{2 * k}", False)
        for near, far in ((a, a_far), (b, b_far)):
            self.plant.AddCouplerConstraint(far, near, 1.0)
            if not self.elastic:
                self._servo(near, self.drive.kp, self.drive.kd)

    def add_ball(self, i: int) -> None:
        """A ball in two halves, one an axis, the plate beyond it, and three servos."""
        p, d = self.params, self.drive
        half = UnitInertia.SolidSphere(p.ball_radius)
        for axis, name in enumerate((f"ball{i}", f"ball{i}_half", f"plate{i}")):
            if axis < 2:
                link = self._body(name, d.ball_mass / 2, 0.0, half)
            else:
                link = self._body(name, d.plate_mass, p.half_pitch, self._disc())
            unit = [float(k == axis) for k in range(3)]
            joint = self.plant.AddJoint(
                RevoluteJoint(
                    f"{'xyz'[axis]}{i}", self.end, link.body_frame(), unit, d.friction
                )
            )
            self._servo(joint, d.kp, d.kd)
            if axis == 0:
                draw_ball(self.plant, link, p)
            self.body, self.end = link, link.body_frame()
        draw_plate(self.plant, self.body, p)
        self.end = self._frame(f"plate{i}_end", self.body, 2 * p.half_pitch)

    def _turn(self, name: str, axis: int, body: str, is_ball: bool) -> Any:
        """One revolute joint about x or y at the end's ball centre."""
        p, d = self.params, self.drive
        if is_ball:
            link = self._body(
                body, d.ball_mass, 0.0, UnitInertia.SolidSphere(p.ball_radius)
            )
            draw_ball(self.plant, link, p)
        else:
            link = self._body(body, d.plate_mass, p.half_pitch, self._disc())
            draw_plate(self.plant, link, p)
        unit = [float(i == axis) for i in range(3)]
        stop = p.max_bend + STOP
        joint = self.plant.AddJoint(
            RevoluteJoint(
                name, self.end, link.body_frame(), unit, -stop, stop, d.friction
            )
        )
        self.body = link
        if is_ball:
            self.end = link.body_frame()
        else:
            self.end = self._frame(f"{body}_end", link, 2 * p.half_pitch)
        return joint

    def add_tool(self) -> Any:
        """The wire ring on the last plate; returns frame T."""
        p = self.params
        z = 2 * p.half_pitch + p.tool_offset
        ring = self._body(
            "tool", self.drive.tool_mass, 0.0, UnitInertia.SolidSphere(p.tool_radius)
        )
        tool = self._frame("tool_mount", self.body, z)
        self.plant.WeldFrames(tool, ring.body_frame())
        draw_tool(self.plant, ring, p)
        return ring.body_frame()

    def _servo(self, joint: Any, kp: float, kd: float) -> None:
        actuator = self.plant.AddJointActuator(joint.name(), joint)
        actuator.set_controller_gains(PdControllerGains(p=kp, d=kd))
