"""Tools that a hand holds, as bodies with contact: what the robot does to them.

The hand leads the tool by springs. Its tip goes as deep and points where the hand wants
it, held by the grip through the lever outside; where it goes through the wall a trocar
of its own gives way sideways. All of it is native: joints with servos, and Drake's
point contact. The hand's wish is told at instants.

To touch, the shaft is a row of spheres. Drake 1.58 turns the normal of two capsules
that cross near an end of one; of a sphere and a capsule it is exact. Many springs side
by side are also what two rods are that cross: what they have in contact grows with the
force, which goes with depth to the power of 3/2, as Hertz has it.

A relaxed arm's hand has 100 to 500 N/m in the plane (Mussa-Ivaldi, Hogan and Bizzi
1985), one that grips firmly several times that; its damping is assumed.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial
from math import asin, atan2, cos, sin, sqrt
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydrake.common.value import Value
from pydrake.geometry import (
    AddContactMaterial,
    CollisionFilterDeclaration,
    GeometrySet,
    ProximityProperties,
    Sphere,
)
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import ContactModel, ContactResults, CoulombFriction
from pydrake.multibody.tree import (
    FixedOffsetFrame,
    PdControllerGains,
    PrismaticJoint,
    RevoluteJoint,
    SpatialInertia,
    UnitInertia,
)

from plants.instruments.wrist_sensor import Load
from systems.common.block import Block
from systems.common.compiled import compiled
from systems.common.geometry import across, along, dot, norm, plus, sub
from systems.common.parameter import check, parameter
from systems.common.signal import Field, Many, Vector, reader, size, vector, writer
from systems.common.signals import Shaft

DEGREES = 5
"""Of freedom of a tool: its trocar's x and y, its tilt about x and y, its depth."""
_LEAN = 0.02
"""Mass of a trocar that moves, kg."""
_PITCH = 2e-3
"""Between the spheres of a shaft, m: at 0.5 N one or two touch, at 5 N three."""
_INSIDE = 0.2
"""What can be inside the patient, from the tip, m: that much of a shaft can touch."""
_STILL = (0.0, 0.0, 0.0)
read_shaft, write_shaft = reader(Shaft), writer(Shaft)


class HandForce(NamedTuple):
    """What a surgeon's tool gets of the robot's, and the hand of it."""

    f: Annotated[Vector, Field("N", "of the robot on the tool", _STILL)]
    p: Annotated[Vector, Field("m", "where it acts, p_W", (0.0, 0.0, -0.08))]
    grip: Annotated[float, Field("N", "of it in the hand, by the lever", 0.0)]
    peak: Annotated[float, Field("N", "the greatest |f| so far", 0.0)]


@dataclass
class HeldToolsParams:
    """The surgeon's obstacle tools as bodies, and the hand that holds them."""

    active: bool = parameter(False, "whether they have contact with the robot's tool")
    grip_stiffness: float = parameter(
        300.0, "of the hand at the grip", "N/m", least=10, most=1e4
    )
    grip_damping: float = parameter(
        15.0, "of the hand at the grip", "N s/m", least=1, most=1e3
    )
    lever: float = parameter(
        0.25, "from the trocar out to the hand", "m", least=0.05, most=0.5
    )
    mass: float = parameter(0.15, "of a tool", "kg", least=0.02, most=1)
    trocar_stiffness: float = parameter(
        500.0, "lateral, of the tool's own trocar", "N/m", least=10, most=2e4
    )
    trocar_damping: float = parameter(5.0, "of it", "N s/m", least=0.5, most=100)
    # The bodies are rigid, so it stands for their bending: a steel tube of 5 mm
    # (3 E I / l^3) has 3e3 N/m 150 mm from its trocar and 1e4 at 100 mm.
    # With a stiffer one the grain of the row is felt.
    contact_stiffness: float = parameter(
        5e3, "force by depth of two shafts at 5 N", "N/m", least=2e3, most=1e4
    )
    dissipation: float = parameter(2.0, "Hunt and Crossley's", "s/m", least=0, most=50)
    friction: float = parameter(0.1, "of wet steel on steel", least=0, most=1)
    length: float = parameter(0.33, "of the shaft", "m", least=0.1, most=0.6)
    diameter: float = parameter(0.005, "of the shaft", "m", least=0.002, most=0.015)
    period: float = parameter(1 / 120, "of the hand's wish", "s", above=0, most=0.1)

    def gains(self) -> tuple[np.ndarray, np.ndarray]:
        """Stiffness and damping of the joints (5), (5)."""
        lever = self.lever**2
        k = [self.trocar_stiffness] * 2 + [lever * self.grip_stiffness] * 2
        d = [self.trocar_damping] * 2 + [lever * self.grip_damping] * 2
        return np.array([*k, self.grip_stiffness]), np.array([*d, self.grip_damping])

    def sphere_stiffness(self) -> float:
        """Of each of the spheres, N/m.

        Those at x along the shaft, from where another of its diameter D crosses it at
        a right angle, are in it by d - x^2 / (2 D). Together they have K d^(3/2) of
        force, K = 4/3 k / pitch sqrt(2 D).
        """
        K = self.contact_stiffness**1.5 / sqrt(5.0)
        return 0.75 * K * _PITCH / sqrt(2.0 * self.diameter)


@dataclass
class HeldTool:
    """A tool in the plant: model instance, body, shaft's spheres and fulcrum [m]."""

    instance: Any
    body: Any
    shaft: list[Any]
    p_WG: list[float]


@compiled
def joints_of(p_WG: Vector, shaft: Shaft) -> np.ndarray:
    """The joints (5) of a tool whose shaft is that."""
    s = (shaft.tip[2] - p_WG[2]) / min(shaft.u[2], -0.1)
    at = along(shaft.tip, -s, shaft.u)
    tilt = atan2(shaft.u[1], -shaft.u[2])
    turn = asin(min(max(shaft.u[0], -1.0), 1.0))
    return np.array((at[0] - p_WG[0], at[1] - p_WG[1], tilt, turn, s))


@compiled
def shaft_of(p_WG: Vector, q: np.ndarray) -> Shaft:
    """The shaft of a tool whose joints (5) are those."""
    u = (sin(q[3]), sin(q[2]) * cos(q[3]), -cos(q[2]) * cos(q[3]))
    return Shaft(along(plus(p_WG, (q[0], q[1], 0.0)), q[4], u), u)


@compiled
def in_hand(p_WG: Vector, lever: float, f: Vector, p: Vector, u: Vector) -> float:
    """What of a force f at p on a tool comes to the hand that holds it, at rest.

    Args:
        p_WG: The tool's fulcrum, m.
        lever: From there to the hand, m.
        f: In N.
        p: In m.
        u: The shaft's direction.
    """
    share = dot(sub(p, p_WG), u) / lever
    side = across(f, u)
    return norm(along(sub(f, side), share, side))


def add_held_tool(
    plant: Any, name: str, p_WG: list[float], params: HeldToolsParams
) -> HeldTool:
    """Adds a tool to a plant that is not yet finalized, on a trocar at p_WG [m]."""
    instance = plant.AddModelInstance(f"held_{name}")
    k, d = params.gains()
    frame = plant.AddFrame(
        FixedOffsetFrame(
            f"{name}_trocar", plant.world_frame(), RigidTransform(p_WG), instance
        )
    )
    steps = (
        ("x", PrismaticJoint, [1, 0, 0]),
        ("y", PrismaticJoint, [0, 1, 0]),
        ("tilt", RevoluteJoint, [1, 0, 0]),
        ("turn", RevoluteJoint, [0, 1, 0]),
        ("depth", PrismaticJoint, [0, 0, 1]),
    )
    light = SpatialInertia.SolidSphereWithMass(_LEAN, 0.01)
    body = None
    for (step, kind, axis), kp, kd in zip(steps, k, d, strict=True):
        inertia = _inertia(params) if step == "depth" else light
        body = plant.AddRigidBody(f"{name}_{step}", instance, inertia)
        joint = plant.AddJoint(kind(f"{name}_{step}", frame, body.body_frame(), axis))
        servo = plant.AddJointActuator(f"{name}_{step}", joint)
        servo.set_controller_gains(PdControllerGains(p=kp, d=kd))
        frame = body.body_frame()
        if step == "y":  # turned about x, so that z points inwards
            down = RigidTransform(RotationMatrix.MakeXRotation(np.pi), [0.0, 0.0, 0.0])
            frame = plant.AddFrame(
                FixedOffsetFrame(f"{name}_inwards", frame, down, instance)
            )
    plant.set_gravity_enabled(instance, False)  # the hand carries it
    material = ProximityProperties()
    friction = CoulombFriction(params.friction, params.friction)
    stiffness = params.sphere_stiffness()
    AddContactMaterial(params.dissipation, stiffness, friction, material)
    radius = 0.5 * params.diameter
    shaft = [
        plant.RegisterCollisionGeometry(
            body, RigidTransform([0.0, 0.0, -z]), Sphere(radius), f"held_{k}", material
        )
        for k, z in enumerate(np.arange(radius, min(params.length, _INSIDE), _PITCH))
    ]
    return HeldTool(instance, body, shaft, p_WG)


def _inertia(params: HeldToolsParams) -> SpatialInertia:
    """A rod whose tip is the origin."""
    rod = UnitInertia.SolidCylinder(
        0.5 * params.diameter, params.length, [0.0, 0.0, 1.0]
    )
    middle = [0.0, 0.0, -0.5 * params.length]
    return SpatialInertia.MakeFromCentralInertia(params.mass, middle, rod * params.mass)


def add_held_tools(
    plant: Any, scene_graph: Any, fulcrums: Mapping[str, list[float]], params: Any
) -> dict[str, HeldTool]:
    """Adds tools by name to a plant that is not yet finalized; they pass each other.

    Args:
        plant: The plant.
        scene_graph: Its SceneGraph.
        fulcrums: Where each goes through the wall [m].
        params: `HeldToolsParams`.
    """
    check(params)
    held = {name: add_held_tool(plant, name, p, params) for name, p in fulcrums.items()}
    plant.set_contact_model(ContactModel.kPoint)
    shafts = GeometrySet([sphere for tool in held.values() for sphere in tool.shaft])
    scene_graph.collision_filter_manager().Apply(
        CollisionFilterDeclaration().ExcludeWithin(shafts)
    )
    return held


class HeldTools(Block):
    """Leads the held tools where their hands want them, and tells what becomes of it.

    Port ``obstacle``, or of whatever names the tools have, accepts the `Shaft` that
    its hand wants.
    Port ``obstacle_state``, likewise, accepts the plant's state of it.
    Port ``contact_results`` accepts the plant's.
    Port ``obstacle_desired``, likewise, emits what the plant's servos take.
    Port ``obstacle_shaft``, likewise, emits the tool's true `Shaft`.
    Port ``hand_force`` emits the `HandForce` of each tool.
    Port ``on_robot`` emits the `Load` of all of them on the robot's tool.
    """

    def __init__(
        self,
        held: Mapping[str, HeldTool],
        starts: Mapping[str, np.ndarray],
        params: HeldToolsParams,
    ) -> None:
        """Makes the block.

        Args:
            held: Tools by their names, in a plant.
            starts: Their joints at the start (5).
            params: The hand, and the tools.
        """
        super().__init__()
        self._params = check(params)
        stiffness, damping = params.gains()
        # As `SetPoint` has it: meant for the end of the hold, its speed in its place.
        self._lead = damping / stiffness + params.period
        self._p_WG = [vector(tool.p_WG) for tool in held.values()]
        self._bodies = [int(tool.body.index()) for tool in held.values()]
        self._wished = [self.signal_in(name, Shaft) for name in held]
        at = np.array([starts[name] for name in held])
        still = np.zeros(DEGREES)
        rest = [np.concatenate([q, still]).tolist() for q in at]
        self._states = [
            self.vector_in(f"{name}_state", state)
            for name, state in zip(held, rest, strict=True)
        ]
        self._results = self.DeclareAbstractInputPort(
            "contact_results", Value(ContactResults())
        )
        for name, state in zip(held, rest, strict=True):
            place = self.DeclareDiscreteState(state)
            self.DeclareStateOutputPort(f"{name}_desired", place)
        self.DeclareDiscreteState(at.ravel())  # where they were wished to be
        self.DeclareDiscreteState(len(held))  # the peaks
        for k, name in enumerate(held):
            calc = partial(self._shaft, k)
            self.signal_out(f"{name}_shaft", Shaft, calc, {self._states[k].ticket()})
        reads = {self._results.ticket(), *(p.ticket() for p in self._states)}
        self._felt = self.cached("felt", self._calc_felt, reads)
        n = len(held) * (size(HandForce) - 1)
        self.signal_out(
            "hand_force",
            Many(HandForce, tuple(held)),
            self._calc_hand_force,
            {self._felt.ticket(), self.xd_ticket()},
        )
        self.signal_out(
            "on_robot",
            Load,
            lambda context: self._felt.Eval(context)[n:],
            {self._felt.ticket()},
        )
        self.update_every(params.period, self._next)

    def _shaft(self, k: int, context: Any) -> np.ndarray:
        q = self._states[k].Eval(context)[:DEGREES]
        return write_shaft(shaft_of(self._p_WG[k], q))

    def _calc_felt(self, context: Any) -> np.ndarray:
        """Of each tool f, p and grip, and then the moment and force on the robot."""
        results = self._results.Eval(context)
        forces = np.zeros((len(self._bodies), 7))
        shafts = [read_shaft(self._shaft(k, context)) for k in range(len(forces))]
        load, pressed = np.zeros(6), np.zeros(len(forces))
        for i in range(results.num_point_pair_contacts()):
            info = results.point_pair_contact_info(i)
            pair = int(info.bodyA_index()), int(info.bodyB_index())
            sign = 1.0 if pair[1] in self._bodies else -1.0
            k = self._bodies.index(pair[1] if sign > 0.0 else pair[0])
            f, p = sign * info.contact_force(), info.contact_point()
            forces[k, :3] += f
            weight = max(float(np.linalg.norm(f)), 1e-12)
            pressed[k] += weight
            forces[k, 3:6] += weight * p
            load[:3] -= np.cross(p, f)
            load[3:] -= f
        forces[pressed > 0.0, 3:6] /= pressed[pressed > 0.0, None]
        forces[pressed == 0.0, 3:6] = np.array([s.tip for s in shafts])[pressed == 0.0]
        lever = self._params.lever
        for p_WG, shaft, row in zip(self._p_WG, shafts, forces, strict=True):
            f, p = vector(row[:3]), vector(row[3:6])
            row[6] = in_hand(p_WG, lever, f, p, shaft.u)
        return np.concatenate([forces.ravel(), load])

    def _calc_hand_force(self, context: Any) -> np.ndarray:
        rows = self._felt.Eval(context)[:-6].reshape(-1, 7)
        peaks = context.get_discrete_state(len(rows) + 1).value()
        now = np.linalg.norm(rows[:, :3], axis=1)
        return np.column_stack([rows, np.maximum(peaks, now)]).ravel()

    def _next(self, context: Any) -> list[np.ndarray]:
        n = len(self._bodies)
        before = context.get_discrete_state(n).value().reshape(n, DEGREES)
        peaks = self._calc_hand_force(context).reshape(n, -1)[:, -1]
        wished = np.array(
            [
                joints_of(p_WG, read_shaft(port.Eval(context)))
                for p_WG, port in zip(self._p_WG, self._wished, strict=True)
            ]
        )
        rates = (wished - before) / self._params.period
        sent = np.hstack([wished + self._lead * rates, np.zeros_like(wished)])
        return [*sent, wished.ravel(), peaks]
