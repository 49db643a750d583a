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
from systems.common.signal import Field, Vector, size

_STILL = (0.0, 0.0, 0.0)


class Felt(NamedTuple):
    """A reading of the sensor, and of the accelerometers about it."""

    f: Annotated[Vector, Field("N", "force on what hangs below M, in M", _STILL)]
    m: Annotated[Vector, Field("N m", "moment about M, in M", _STILL)]
    alpha: Annotated[Vector, Field("rad/s^2", "angular, of M", _STILL)]
    a: Annotated[Vector, Field("m/s^2", "of M's origin", _STILL)]
    a_C: Annotated[Vector, Field("m/s^2", "of the sleeve's", _STILL)]


_MOMENTUM = 6
_MOVING = 6 + 6 + 3  # momentum, V_WM, v_WC
_FELT = size(Felt)


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
        ticket = {self._state.ticket()}
        self._context = self.cached("plant_context", self._calc_context, ticket)
        reads = {
            self._context.ticket(),
            self._applied.ticket(),
            self.time_ticket(),
            self.xd_ticket(),
        }
        self._next = self.cached("next", self._calc_next, reads)
        self.signal_out("felt", Felt, self._calc_felt, {self._next.ticket()})
        self.update_every(period, self._next.Eval)

    def _calc_context(self, context: Any) -> Any:
        own = self._plant.CreateDefaultContext()
        self._plant.SetPositionsAndVelocities(own, self._state.Eval(context))
        return own

    def _calc_next(self, context: Any) -> np.ndarray:
        """The state with this instant's reading, once and only once."""
        old, time = context.get_discrete_state_vector().value(), context.get_time()
        if time - old[_MOVING] < self._half and old[_MOVING] >= 0.0:
            return old.copy()
        own = self._context.Eval(context)
        V_WM = self._body.EvalSpatialVelocityInWorld(own).get_coeffs()
        v_WC = self._abdomen.sleeve.EvalSpatialVelocityInWorld(own).translational()
        L = self._plant.CalcSpatialMomentumInWorldAboutPoint(own, self._below, _STILL)
        moving = np.concatenate([L.get_coeffs(), V_WM, v_WC])
        rate = np.zeros(_MOVING)
        if old[_MOVING] >= 0.0:
            rate = (moving - old[:_MOVING]) / (time - old[_MOVING])
        m, f = rate[:3], rate[3:_MOMENTUM]
        for p, torque, force in self._loads(context, own):
            f = f - force
            m = m - torque - np.cross(p, force)
        X_WM = self._body.EvalPoseInWorld(own)
        R_MW = X_WM.rotation().matrix().T
        m = m - np.cross(X_WM.translation(), f)
        felt = [R_MW @ f, R_MW @ m, rate[6:]]  # as `Felt` has them
        return np.concatenate([moving, [time], *felt])

    def _loads(self, context: Any, own: Any) -> list[tuple[Any, Any, Any]]:
        """Place, torque and force in W of all that acts on the bodies below."""
        bushing, sleeve = self._abdomen.bushing, self._abdomen.sleeve
        K = self._abdomen.params.stiffness * self._factor(context.get_time())
        bushing.SetForceStiffnessConstants(own, [K] * 3)
        X_WC = sleeve.EvalPoseInWorld(own)
        F_C = bushing.CalcBushingSpatialForceOnFrameC(own)
        R_WC = X_WC.rotation()
        centre = self._plant.CalcCenterOfMassPositionInWorld(own, self._heavy)
        loads = [
            (centre, np.zeros(3), self._weight),
            (
                X_WC.translation(),
                R_WC.multiply(F_C.rotational()),
                R_WC.multiply(F_C.translational()),
            ),
        ]
        if self._applied.HasValue(context):
            for one in self._applied.Eval(context):
                if int(one.body_index) in self._bodies:
                    body = self._plant.get_body(one.body_index)
                    p = body.EvalPoseInWorld(own).multiply(one.p_BoBq_B)
                    F = one.F_Bq_W
                    loads.append((p, F.rotational(), F.translational()))
        return loads

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
