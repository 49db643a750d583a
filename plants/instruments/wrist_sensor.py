"""The wrist's force/torque sensor: what the arm does to all that hangs below it.

The weld that carries the instrument transmits, by momentum balance about M,

    F = d/dt L - weights - F_wall - applied,

L being the momentum of all bodies below it: instrument, sleeve, a snake in its tube.
Its rate is the difference over the last period, as are the accelerations that an
accelerometer in the mount gives: what a model takes away of the one is what the other
has. (Drake 1.58 gives no reaction forces of a continuous plant with couplers, and under
CENIC they are reported wrong.)
"""

from collections.abc import Callable, Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydrake.common.value import Value
from pydrake.multibody.plant import ExternallyAppliedSpatialForce
from pydrake.multibody.tree import ModelInstanceIndex

from plants.abdomen.abdomen import Abdomen, spring_on_sleeve, turning_on_sleeve
from plants.abdomen.tissue import tissue_on_sleeve, tissue_record
from plants.common.tree import mass_centre, momentum, move_tree, pose_in, read_tree
from systems.common.compiled import compiled, packed
from systems.common.geometry import (
    Pose,
    along,
    cross,
    inwards,
    over,
    plus,
    scaled,
    sub,
    xyz,
)
from systems.common.signal import Field, Vector, flat, size
from systems.common.step_block import StepBlock, wired

_STILL = (0.0, 0.0, 0.0)


class Felt(NamedTuple):
    """A reading of the sensor, and of the accelerometers about it."""

    f: Annotated[Vector, Field("N", "force on what hangs below M, in M", _STILL)]
    m: Annotated[Vector, Field("N m", "moment about M, in M", _STILL)]
    alpha: Annotated[Vector, Field("rad/s^2", "angular, of M", _STILL)]
    a: Annotated[Vector, Field("m/s^2", "of M's origin", _STILL)]
    a_C: Annotated[Vector, Field("m/s^2", "of the sleeve's", _STILL)]


class Mount(NamedTuple):
    """The frame M of what the weld carries, and how it moves."""

    p: Annotated[Vector, Field("m", "p_WM", (0.0, 0.0, 0.3))]
    x: Annotated[Vector, Field("1", "x axis", (1.0, 0.0, 0.0))]
    y: Annotated[Vector, Field("1", "y axis", (0.0, -1.0, 0.0))]
    z: Annotated[Vector, Field("1", "z axis, along the shaft", (0.0, 0.0, -1.0))]
    w: Annotated[Vector, Field("rad/s", "w_WM", _STILL)]
    v: Annotated[Vector, Field("m/s", "v_WM", _STILL)]
    p_C: Annotated[Vector, Field("m", "p_WC of the sleeve", _STILL)]


class Moving(NamedTuple):
    """What the sensor compares with the instant before: all in W."""

    turning: Vector  # angular momentum about the world's origin
    pushing: Vector  # momentum
    w: Vector  # w_WM
    v: Vector  # v_WM
    v_C: Vector  # of the sleeve
    time: float  # of the last reading; negative before the first
    f: Vector  # that reading, as `Felt`
    m: Vector
    alpha: Vector
    a: Vector
    a_C: Vector


class Load(NamedTuple):
    """What else acts on all below: moment about the world's origin, and force."""

    m: Annotated[Vector, Field("N m", "moment", _STILL)]
    f: Annotated[Vector, Field("N", "force", _STILL)]


_START = Moving(
    _STILL, _STILL, _STILL, _STILL, _STILL, -1.0, _STILL, _STILL, _STILL, _STILL, _STILL
)


@compiled
def _sense(
    c: Any,
    tree: Any,
    old: Moving,
    time: float,
    state: np.ndarray,
    stiffness: np.ndarray,
    load: Load,
) -> tuple[Moving, Mount]:
    """The state with this instant's reading, once and only once, and the mount."""
    n, bodies = len(state) // 2, len(tree.parent)
    X, V = np.zeros((bodies, 12)), np.zeros((bodies, 6))
    move_tree(tree, state[:n], state[n:], X, V)
    M, C = pose_in(X, c.mount), pose_in(X, c.sleeve)
    w, v, v_C = xyz(V[c.mount], 0), xyz(V[c.mount], 3), xyz(V[c.sleeve], 3)
    mount = Mount(M.p, M.x, M.y, M.z, w, v, C.p)
    dt = time - old.time
    if dt < c.half and old.time >= 0.0:
        return old, mount
    turning = pushing = centre = _STILL
    for i in c.below:
        h, p = momentum(tree, i, X, V)
        turning, pushing = plus(turning, h), plus(pushing, p)
    for i in c.heavy:
        centre = along(centre, tree.mass[i] / c.mass, mass_centre(tree, i, X))
    dh = dp = alpha = a = a_C = _STILL
    if old.time >= 0.0:
        dh, dp = (
            over(sub(turning, old.turning), dt),
            over(sub(pushing, old.pushing), dt),
        )
        alpha, a = over(sub(w, old.w), dt), over(sub(v, old.v), dt)
        a_C = over(sub(v_C, old.v_C), dt)
    torque, push = spring_on_sleeve(
        sub(C.p, pose_in(X, c.wall).p),
        sub(v_C, xyz(V[c.wall], 3)),
        xyz(V[c.sleeve], 0),
        stiffness[0],
        c.damping,
    )
    if c.turns:
        turn = turning_on_sleeve(C, xyz(V[c.sleeve], 0), c.turning, c.turning_damping)
        torque = plus(torque, turn)
    if c.grain_stiffness + c.slow_stiffness > 0.0:
        turn, pull = tissue_on_sleeve(c, X, pose_in(X, c.wall).p, C.p)
        torque, push = plus(torque, turn), plus(push, pull)
    weight = scaled(c.mass, xyz(c.gravity, 0))
    f, m = balance(dh, dp, load, centre, weight, C.p, torque, push, M)
    return Moving(turning, pushing, w, v, v_C, time, f, m, alpha, a, a_C), mount


@compiled
def balance(
    dh: Vector,
    dp: Vector,
    load: Load,
    centre: Vector,
    weight: Vector,
    p_WC: Vector,
    torque: Vector,
    push: Vector,
    M: Pose,
) -> tuple[Vector, Vector]:
    """Force and moment about M of the weld on what hangs below it, in M.

    Args:
        dh: Rate of angular momentum about the world's origin.
        dp: Rate of momentum.
        load: What else acts.
        centre: Of all mass that has weight, in W.
        weight: Its weight in N.
        p_WC: Of the sleeve.
        torque: Of the wall's spring on the sleeve, in W.
        push: Its force.
        M: The mount.
    """
    f = sub(sub(dp, load.f), plus(weight, push))
    m = sub(sub(dh, load.m), plus(torque, cross(p_WC, push)))
    m = sub(sub(m, cross(centre, weight)), cross(M.p, f))
    return inwards(M, f), inwards(M, m)


class WristSensor(StepBlock):
    """Reads what the arm does to all below the weld at the mount M.

    Port ``state`` accepts the plant's state.

    Port ``applied_spatial_force`` accepts what else acts on those bodies, as the
    plant's port of that name does; it need not be connected.

    Port ``touching`` accepts a `Load` more, of tools that touch; none without a wire.

    Port ``felt`` emits what is `Felt`, of the last instant of its clock.

    Port ``mount`` emits the `Mount` as it is now.
    """

    def __init__(
        self,
        plant: Any,
        body: Any,
        abdomen: Abdomen,
        below: Sequence[ModelInstanceIndex],
        period: float,
        factor: Callable[[float], float] = lambda time: 1.0,
    ) -> None:
        """Makes the block.

        Args:
            plant: The finalized plant.
            body: The body that the weld carries; its frame is M.
            abdomen: What `add_abdomen` returned.
            below: Model instances of all that hangs on the weld, the sleeve's too.
            period: Of the readings in s.
            factor: The trocar's stiffness against the abdomen's, by time in s.
        """
        super().__init__()
        self._plant, self._factor = plant, factor
        self._stiffness = abdomen.params.stiffness
        bodies = [int(b) for i in below for b in plant.GetBodyIndices(i)]
        self._bodies = set(bodies)
        heavy = [i for i in below if plant.is_gravity_enabled(i)]
        self._own = plant.CreateDefaultContext()  # for what else acts; always written
        self._constants = packed(
            mount=int(body.index()),
            sleeve=int(abdomen.sleeve.index()),
            wall=int(abdomen.wall.index()),
            below=np.array(bodies),
            heavy=np.array([int(b) for i in heavy for b in plant.GetBodyIndices(i)]),
            mass=plant.CalcTotalMass(self._own, heavy),
            gravity=plant.gravity_field().gravity_vector(),
            damping=float(abdomen.params.damping),
            turns=any(abdomen.bushing.torque_stiffness_constants()),
            turning=np.array(abdomen.bushing.torque_stiffness_constants()),
            turning_damping=np.array(abdomen.bushing.torque_damping_constants()),
            half=0.5 * period,
            **tissue_record(abdomen.params.tissue, abdomen.slow),
        )
        self._tree = read_tree(plant)
        start = plant.GetPositionsAndVelocities(self._own)
        told = [len(start), 1, Load]
        self._sense = wired(_sense, 2, [Moving], told, [Moving, Mount], True)
        self._state = self.vector_in("state", start.tolist())
        self._applied = self.DeclareAbstractInputPort(
            "applied_spatial_force", Value([ExternallyAppliedSpatialForce()])
        )
        self._touching = self.signal_in("touching", Load)
        self.DeclareDiscreteState(flat(_START))
        reads = {
            self._state.ticket(),
            self._applied.ticket(),
            self._touching.ticket(),
            self.time_ticket(),
            self.xd_ticket(),
        }
        self._next = self.cached("next", self._calc_next, reads)
        last = size(Moving)
        self._emit(self._next, {"felt": Felt, "mount": Mount}, last - size(Felt))
        self.update_every(period, lambda context: self._next.Eval(context)[:last])

    def _calc_next(self, context: Any) -> np.ndarray:
        time, state = context.get_time(), self._state.Eval(context)
        load = np.zeros(6)
        if self._applied.HasValue(context):
            load = self._applied_load(context, state)
        if self._touching.HasValue(context):
            load = load + self._touching.Eval(context)
        stiffness = np.array([self._stiffness * self._factor(time)])
        old = context.get_discrete_state_vector().value()
        return self._sense(
            self._constants, self._tree, old, time, state, stiffness, load
        )

    def _applied_load(self, context: Any, state: np.ndarray) -> np.ndarray:
        """The elements of the `Load`."""
        load = np.zeros(6)
        self._plant.SetPositionsAndVelocities(self._own, state)
        for one in self._applied.Eval(context):
            if int(one.body_index) in self._bodies:
                body = self._plant.get_body(one.body_index)
                p = body.EvalPoseInWorld(self._own).multiply(one.p_BoBq_B)
                load += one.F_Bq_W.Shift(-p).get_coeffs()
        return load


def add_wrist_sensor(
    builder: Any,
    plant: Any,
    body: Any,
    abdomen: Abdomen,
    below: Sequence[ModelInstanceIndex],
    period: float,
    factor: Callable[[float], float] = lambda time: 1.0,
) -> WristSensor:
    """Adds the block as `wrist_sensor` and wires it to the plant."""
    block = builder.AddNamedSystem(
        "wrist_sensor", WristSensor(plant, body, abdomen, below, period, factor)
    )
    builder.Connect(plant.get_state_output_port(), block.GetInputPort("state"))
    return block
