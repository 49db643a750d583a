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

from plants.abdomen.abdomen import Abdomen
from systems.common.block import Block
from systems.common.compiled import compiled
from systems.common.geometry import cross, plus, sub, xyz
from systems.common.signal import Field, Vector, size

_STILL = (0.0, 0.0, 0.0)


class Felt(NamedTuple):
    """A reading of the sensor, and of the accelerometers about it."""

    f: Annotated[Vector, Field("N", "force on what hangs below M, in M", _STILL)]
    m: Annotated[Vector, Field("N m", "moment about M, in M", _STILL)]
    alpha: Annotated[Vector, Field("rad/s^2", "angular, of M", _STILL)]
    a: Annotated[Vector, Field("m/s^2", "of M's origin", _STILL)]
    a_C: Annotated[Vector, Field("m/s^2", "of the sleeve's", _STILL)]


_MOVING = 6 + 6 + 3  # momentum, V_WM, v_WC
_FELT = size(Felt)


@compiled
def balance(
    rate: np.ndarray,
    load: np.ndarray,
    centre: np.ndarray,
    weight: np.ndarray,
    p_WC: np.ndarray,
    F_C: np.ndarray,
    p_WM: np.ndarray,
    R_WM: np.ndarray,
) -> np.ndarray:
    """What is `Felt`, element by element.

    Args:
        rate: Of momentum about the world's origin, of V_WM and of v_WC, (15,).
        load: Moment about the world's origin, and force, that are applied, (6,).
        centre: Of all mass that has weight, in W.
        weight: Its weight in N.
        p_WC: Of the sleeve.
        F_C: The bushing's torque and force on it in W, the columns of (3, 2).
        p_WM: Of the mount.
        R_WM: Its orientation.
    """
    torque, push = xyz(F_C[:, 0], 0), xyz(F_C[:, 1], 0)
    f = sub(sub(xyz(rate, 3), xyz(load, 3)), plus(xyz(weight, 0), push))
    m = sub(sub(xyz(rate, 0), xyz(load, 0)), plus(torque, cross(p_WC, push)))
    m = sub(sub(m, cross(centre, weight)), cross(p_WM, f))
    out = np.zeros(15)
    for i in range(3):
        for k in range(3):
            out[i] += R_WM[k, i] * f[k]
            out[3 + i] += R_WM[k, i] * m[k]
    out[6:] = rate[6:]
    return out


class WristSensor(Block):
    """Reads what the arm does to all below the weld at the mount M.

    Port ``state`` accepts the plant's state.

    Port ``applied_spatial_force`` accepts what else acts on those bodies, as the
    plant's port of that name does; it need not be connected.

    Port ``felt`` emits what is `Felt`, of the last instant of its clock.
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
        self._plant, self._body, self._abdomen = plant, body, abdomen
        self._below, self._factor = list(below), factor
        self._heavy = [i for i in below if plant.is_gravity_enabled(i)]
        self._bodies = {int(b) for i in below for b in plant.GetBodyIndices(i)}
        context = plant.CreateDefaultContext()
        self._weight = plant.gravity_field().gravity_vector() * plant.CalcTotalMass(
            context, self._heavy
        )
        self._half = 0.5 * period
        start = plant.GetPositionsAndVelocities(context)
        self._state = self.vector_in("state", start.tolist())
        self._applied = self.DeclareAbstractInputPort(
            "applied_spatial_force", Value([ExternallyAppliedSpatialForce()])
        )
        # Momentum and velocities at the last instant, its time, and what was felt.
        initial = np.zeros(_MOVING + 1 + _FELT)
        initial[_MOVING] = -1.0
        self.DeclareDiscreteState(initial)
        self._own = context  # to calculate in: all of it is written before it is read
        reads = {
            self._state.ticket(),
            self._applied.ticket(),
            self.time_ticket(),
            self.xd_ticket(),
        }
        self._next = self.cached("next", self._calc_next, reads)
        self.signal_out("felt", Felt, self._calc_felt, {self._next.ticket()})
        self.update_every(period, self._next.Eval)

    def _calc_next(self, context: Any) -> np.ndarray:
        """The state with this instant's reading, once and only once."""
        old, time = context.get_discrete_state_vector().value(), context.get_time()
        if time - old[_MOVING] < self._half and old[_MOVING] >= 0.0:
            return old.copy()
        plant, own, sleeve = self._plant, self._own, self._abdomen.sleeve
        plant.SetPositionsAndVelocities(own, self._state.Eval(context))
        V_WM = self._body.EvalSpatialVelocityInWorld(own).get_coeffs()
        v_WC = sleeve.EvalSpatialVelocityInWorld(own).translational()
        L = plant.CalcSpatialMomentumInWorldAboutPoint(own, self._below, _STILL)
        moving = np.concatenate([L.get_coeffs(), V_WM, v_WC])
        rate = np.zeros(_MOVING)
        if old[_MOVING] >= 0.0:
            rate = (moving - old[:_MOVING]) / (time - old[_MOVING])
        K = self._abdomen.params.stiffness * self._factor(time)
        self._abdomen.bushing.SetForceStiffnessConstants(own, [K] * 3)
        F_C = self._abdomen.bushing.CalcBushingSpatialForceOnFrameC(own).get_coeffs()
        X_WC, X_WM = sleeve.EvalPoseInWorld(own), self._body.EvalPoseInWorld(own)
        centre = plant.CalcCenterOfMassPositionInWorld(own, self._heavy)
        load = np.zeros(6)  # moment about the world's origin, and force
        if self._applied.HasValue(context):
            load = self._applied_load(context)
        felt = balance(
            rate,
            load,
            centre,
            self._weight,
            X_WC.translation(),
            X_WC.rotation().matrix() @ F_C.reshape(2, 3).T,
            X_WM.translation(),
            X_WM.rotation().matrix(),
        )
        return np.concatenate([moving, [time], felt])

    def _applied_load(self, context: Any) -> np.ndarray:
        """Moment about the world's origin and force of all that is applied, (6,)."""
        load = np.zeros(6)
        for one in self._applied.Eval(context):
            if int(one.body_index) in self._bodies:
                body = self._plant.get_body(one.body_index)
                p = body.EvalPoseInWorld(self._own).multiply(one.p_BoBq_B)
                load += one.F_Bq_W.Shift(-p).get_coeffs()
        return load

    def _calc_felt(self, context: Any) -> np.ndarray:
        felt: np.ndarray = self._next.Eval(context)[_MOVING + 1 :]
        return felt


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
