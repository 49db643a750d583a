"""Wrench of the tool: what the wall does to the shaft, from the wrist's sensor.

The sensor is the weld that carries the instrument; it feels everything that hangs
below it. The instrument's weight and inertia are taken away with its model: an
axisymmetric body on the shaft's axis, of mass m, its centre at distance c from the
sensor M, transverse inertia I about M. With the sensor's acceleration a and the
axis u the wall's lateral wrench about M is

    f = m (a - g + c u'') - F,   m = u x (I u'' + m c (a - g)) - M,

(F, M) being what the arm does to the instrument, the sensor's reading. The trocar's
sleeve rides on the shaft; its inertia is taken away as well. The accelerations are
those of the plant's own model, as of an accelerometer that is built into the mount.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
import math
from typing import Any

import numpy as np
from pydrake.common.value import Value
from pydrake.math import RigidTransform
from pydrake.multibody.math import SpatialAcceleration, SpatialForce, SpatialVelocity
from pydrake.multibody.tree import ModelInstanceIndex

from plants.abdomen.abdomen import Abdomen
from plants.instruments.instrument import InstrumentParams
from systems.common.block import Block
from systems.sensing import sensor_noise
from systems.sensing.wrench_kernel import shaft_of, wall_wrench

_SILENCE = [0.0] * 7
_UPRIGHT = [0.0, 0.0, 0.22, 0.0, 0.0, -1.0, *[0.0] * 6]


@dataclass
class ToolWrenchParams:
    """Parameters of `ToolWrench`.

    Attributes:
        frame: The plant's frame that the sensor sits in: the instrument's body.
        force_noise: White noise of each force axis, in N.
        moment_noise: White noise of each moment axis, in N m.
        force_drift: Random walk of the force bias, in N/sqrt(s).
        moment_drift: Random walk of the moment bias, in N m/sqrt(s).
        tare_samples: Readings whose mean is taken for zero before the shaft enters
            the trocar; 0 leaves the offset of the sensor in.
        force_offset: Offset of each force axis before taring, in N.
        moment_offset: Offset of each moment axis before taring, in N m.
        mass_error: Relative error of the instrument's mass in the model.
        force_range: Beyond it a force axis is saturated, in N.
        moment_range: Beyond it a moment axis is saturated, in N m.
        delay: Samples that the wrench is late against the pose.
        aligned: Whether the shaft's pose is held back by as much, so that the two
            belong together; what is late is then predicted. A few milliseconds
            between force and pose cost more than the delay itself.
        lost: Times in s between which the sensor is silent: start, end, start, ...
        period: Of the readings, in s.
        seed: Of the noise.
    """

    frame: str = "instrument"
    force_noise: float = 0.05
    moment_noise: float = 0.005
    force_drift: float = 0.004
    moment_drift: float = 0.0004
    tare_samples: int = 240
    force_offset: float = 0.3
    moment_offset: float = 0.02
    mass_error: float = 0.0
    force_range: float = 60.0
    moment_range: float = 5.0
    delay: int = 0
    aligned: bool = True
    lost: list[float] = field(default_factory=list)
    period: float = 1.0 / 120.0
    seed: int = 0

    def check(self) -> None:
        """Raises ValueError for a value that makes no sense."""
        for name in ("force_range", "moment_range", "period"):
            if not getattr(self, name) > 0.0:
                raise ValueError(
                    f"tool_wrench.{name}={getattr(self, name)}: expected > 0"
                )
        for name in ("force_noise", "moment_noise", "force_drift", "moment_drift"):
            if not getattr(self, name) >= 0.0:
                raise ValueError(
                    f"tool_wrench.{name}={getattr(self, name)}: expected >= 0"
                )
        for name in ("delay", "tare_samples", "seed"):
            if getattr(self, name) < 0:
                raise ValueError(
                    f"tool_wrench.{name}={getattr(self, name)}: expected >= 0"
                )
        if self.delay > 12:
            raise ValueError(
                f"tool_wrench.delay={self.delay} samples: expected at most 12"
            )
        if abs(self.mass_error) > 0.5:
            raise ValueError(
                f"tool_wrench.mass_error={self.mass_error}: expected in [-0.5, 0.5]"
            )
        pairs = self.lost
        if len(pairs) % 2 or sorted(pairs) != pairs:
            raise ValueError(
                f"tool_wrench.lost={pairs}: expected rising times in pairs, "
                "e.g. [3.0, 4.5]"
            )


def transverse_inertia(params: InstrumentParams) -> float:
    """Inertia of the instrument across its axis, about the sensor, in kg m^2."""
    rods = (
        params.mount_mass * params.mount_length**2 / 3.0
        + params.shaft_mass * params.length**2 / 3.0
    )
    return rods + params.gauze_mass * params.length**2


def silent(lost: Sequence[float], time: float) -> bool:
    """Whether a time lies between the pairs of start and end times."""
    return any(a <= time < b for a, b in zip(lost[::2], lost[1::2], strict=True))


def sensor_indices(plant: Any, frame: str) -> tuple[int, int]:
    """Places of the sensor in `reaction_forces` and of its body in `body_poses`.

    Args:
        plant: A finalized MultibodyPlant.
        frame: Name of the body that hangs on the sensor's weld joint.

    Raises:
        ValueError: If there is no such body, or no weld carries it.
    """
    names = [
        plant.get_body(index).name()
        for instance in range(plant.num_model_instances())
        for index in plant.GetBodyIndices(ModelInstanceIndex(instance))
    ]
    if frame not in names:
        raise ValueError(
            f"tool_wrench.frame={frame!r} does not exist in the plant; "
            f"its bodies are {', '.join(sorted(names))}"
        )
    body = plant.GetBodyByName(frame)
    for index in plant.GetJointIndices():
        joint = plant.get_joint(index)
        if joint.child_body().index() == body.index():
            if joint.num_velocities():
                break
            return int(joint.index()), int(body.index())
    raise ValueError(
        f"tool_wrench.frame={frame!r} does not hang on a weld joint, "
        "whose reaction a wrist sensor could read"
    )


class ToolWrench(Block):
    """Reads the wrist's force/torque sensor and takes the instrument away.

    White noise, a drifting bias, taring before the shaft enters the trocar,
    saturation, silence and delay are parameters. All outputs are in W.

    Port ``reaction_forces`` accepts the plant's port of that name.

    Port ``body_poses`` accepts the plant's port of that name.

    Port ``body_spatial_velocities`` accepts the plant's port of that name.

    Port ``body_spatial_accelerations`` accepts the plant's port of that name.

    Port ``shaft`` emits the sensor's origin p_WS [m], the shaft's direction u_W
    towards the tip, v_WS [m/s] and du_W/dt [1/s] (12).

    Port ``wrench`` emits the wall's force on the shaft [N], its moment about the
    sensor's origin [N m], and 1, or 0 while the sensor is silent or saturated (7).
    """

    def __init__(
        self,
        params: ToolWrenchParams | None = None,
        instrument: InstrumentParams | None = None,
        joint: int = 0,
        body: int = 0,
        sleeve: int = -1,
        sleeve_mass: float = 0.0,
    ) -> None:
        """Makes the block for the sensor at a place of the plant's lists.

        Args:
            params: Noise, bias, range.
            instrument: What hangs below the sensor.
            joint: Place of the sensor's joint in `reaction_forces`.
            body: Place of the instrument in `body_poses`.
            sleeve: Place of the trocar's sleeve in it; negative for none.
            sleeve_mass: In kg.
        """
        super().__init__()
        p = self._params = params or ToolWrenchParams()
        p.check()
        instrument = instrument or InstrumentParams()
        share = 1.0 + p.mass_error
        self._instrument = np.array(
            [
                share * instrument.mass,
                instrument.centre,
                share * transverse_inertia(instrument),
            ]
        )
        self._joint, self._body = joint, body
        self._sleeve, self._sleeve_mass = sleeve, share * sleeve_mass
        self._limit = np.array([p.force_range, p.moment_range])
        step = math.sqrt(p.period)
        noise = (p.force_noise,) * 3 + (p.moment_noise,) * 3
        drift = (step * p.force_drift,) * 3 + (step * p.moment_drift,) * 3
        zero = np.array([p.force_offset] * 3 + [p.moment_offset] * 3)
        if p.tare_samples:
            before = sensor_noise.mean_before_start(p.seed, p.tare_samples)
            zero = -np.array(noise) * before
        self._faults = (noise, drift, tuple(zero.tolist()))
        self._forces = self.DeclareAbstractInputPort(
            "reaction_forces", Value([SpatialForce.Zero()])
        )
        self._poses = self.DeclareAbstractInputPort(
            "body_poses", Value([RigidTransform()])
        )
        self._velocities = self.DeclareAbstractInputPort(
            "body_spatial_velocities", Value([SpatialVelocity.Zero()])
        )
        self._accelerations = self.DeclareAbstractInputPort(
            "body_spatial_accelerations", Value([SpatialAcceleration.Zero()])
        )
        moving = {self._poses.ticket(), self._velocities.ticket()}
        self._shaft = self.cached("shaft", self._calc_shaft, moving)
        feeling = {
            self._shaft.ticket(),
            self._forces.ticket(),
            self._accelerations.ticket(),
            self.time_ticket(),
        }
        if p.delay:
            # Rows of shaft and wrench, the oldest first; silent before the start.
            start = np.tile([*_UPRIGHT, *_SILENCE], p.delay)
            self._late = self.DeclareDiscreteState(start)
            self.vector_out("wrench", 7, self._oldest_wrench, {self.xd_ticket()})
            self.update_every(p.period, self._push)
        else:
            self.vector_out("wrench", 7, self._calc_wrench, feeling)
        if p.delay and p.aligned:
            self.vector_out("shaft", 12, self._oldest_shaft, {self.xd_ticket()})
        else:
            self.vector_out("shaft", 12, self._shaft_vector, {self._shaft.ticket()})

    def _calc_shaft(self, context: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """The port's vector, angular velocity, and R_WM."""
        X_WM = self._poses.Eval(context)[self._body]
        V_WM = self._velocities.Eval(context)[self._body]
        R_WM, w = X_WM.rotation().matrix(), V_WM.rotational()
        shaft = shaft_of(R_WM, X_WM.translation(), V_WM.translational(), w)
        return shaft, w, R_WM

    def _shaft_vector(self, context: Any) -> Any:
        return self._shaft.Eval(context)[0]

    def _calc_wrench(self, context: Any) -> Any:
        p = self._params
        time = context.get_time()
        if p.lost and silent(p.lost, time):
            return _SILENCE
        shaft, w, R_WM = self._shaft.Eval(context)
        accelerations = self._accelerations.Eval(context)
        A_WM = accelerations[self._body]
        F = self._forces.Eval(context)[self._joint]
        sleeve = np.zeros(7)
        if self._sleeve >= 0:
            sleeve[0] = self._sleeve_mass
            sleeve[1:4] = self._poses.Eval(context)[self._sleeve].translation()
            sleeve[4:7] = accelerations[self._sleeve].translational()
        return wall_wrench(
            R_WM,
            shaft,
            w,
            A_WM.rotational(),
            A_WM.translational(),
            F.translational(),
            F.rotational(),
            sensor_noise.fault(p.seed, max(0, round(time / p.period)), self._faults),
            self._instrument,
            self._limit,
            sleeve,
        )

    def _oldest_shaft(self, context: Any) -> Any:
        return context.get_discrete_state(self._late).value()[:12]

    def _oldest_wrench(self, context: Any) -> Any:
        return context.get_discrete_state(self._late).value()[12:19]

    def _push(self, context: Any) -> Any:
        late = context.get_discrete_state(self._late).value()
        now = self._shaft_vector(context), self._calc_wrench(context)
        return np.concatenate([late[19:], *now])


def add_tool_wrench(
    builder: Any,
    plant: Any,
    params: ToolWrenchParams,
    instrument: InstrumentParams,
    abdomen: Abdomen,
) -> ToolWrench:
    """Adds the block as `tool_wrench` and wires it to the plant's sensor."""
    joint, body = sensor_indices(plant, params.frame)
    sleeve = int(abdomen.sleeve.index())
    mass = abdomen.params.sleeve_mass
    block = builder.AddNamedSystem(
        "tool_wrench", ToolWrench(params, instrument, joint, body, sleeve, mass)
    )
    for name in (
        "reaction_forces",
        "body_poses",
        "body_spatial_velocities",
        "body_spatial_accelerations",
    ):
        builder.Connect(plant.GetOutputPort(name), block.GetInputPort(name))
    return block
