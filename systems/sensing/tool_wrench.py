"""Wrench of the tool: what the wall does to the shaft, from the wrist's sensor.

The sensor is the weld that carries the instrument; it feels everything that hangs
below it. The instrument's weight and inertia are taken away with its model: an
axisymmetric body on the shaft's axis, of mass m, its centre at distance c from the
sensor M, transverse inertia I about M. With the sensor's acceleration a and the
axis u the wall's lateral wrench about M is

    f = m (a - g + c u'') - F,   m = u x (I u'' + m c (a - g)) - M,

(F, M) being what the arm does to the instrument, the sensor's reading. The trocar's
sleeve rides on the shaft; its inertia is taken away as well. The accelerations are
those of accelerometers (`plants.instruments.wrist_sensor`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
import math
from typing import Any

import numpy as np
from pydrake.multibody.tree import ModelInstanceIndex

from plants.abdomen.abdomen import Abdomen
from plants.instruments.instrument import InstrumentParams
from plants.instruments.wrist_sensor import Felt, Mount, add_wrist_sensor
from systems.common.block import Block
from systems.common.compiled import packed
from systems.common.parameter import Rules, check, parameter
from systems.common.signal import example, flat, size
from systems.common.signals import ShaftMotion, Wrench
from systems.common.step_block import wired
from systems.sensing import sensor_noise
from systems.sensing.wrench_kernel import (
    NO_LOAD,
    SILENCE,
    Fault,
    Load,
    shaft_motion,
    wall_wrench,
)

_UNLOADED = flat(NO_LOAD)
_SHAFT = size(ShaftMotion)
_ROW = _SHAFT + size(Wrench)


@dataclass
class ToolWrenchParams:
    """Parameters of `ToolWrench`."""

    frame: str = parameter("instrument", "of the plant, in which the sensor sits")
    # White noise, and the random walk of the bias.
    force_noise: float = parameter(
        0.05, "standard deviation of each force axis", "N", least=0, most=5
    )
    moment_noise: float = parameter(
        0.005, "standard deviation of each moment axis", "N m", least=0, most=0.5
    )
    force_drift: float = parameter(
        0.004, "random walk of the force bias", "N/sqrt(s)", least=0, most=1
    )
    moment_drift: float = parameter(
        0.0004, "random walk of the moment bias", "N m/sqrt(s)", least=0, most=0.1
    )
    tare_samples: int = parameter(
        240, "readings taken for zero before; 0 leaves the offset", least=0, most=10**5
    )
    force_offset: float = parameter(
        0.3, "of each force axis before taring", "N", least=-50, most=50
    )
    moment_offset: float = parameter(
        0.02, "of each moment axis before taring", "N m", least=-5, most=5
    )
    mass_error: float = parameter(
        0.0, "relative error of the instrument's known mass", least=-0.5, most=0.5
    )
    gauze_mass: float | None = parameter(
        None,
        "of the gauze, as wrist and arm are told; as it is if null",
        "kg",
        least=0,
        most=0.1,
    )
    force_range: float = parameter(
        60.0, "beyond it a force axis is saturated", "N", above=0, most=500
    )
    moment_range: float = parameter(
        5.0, "beyond it a moment axis is saturated", "N m", above=0, most=50
    )
    delay: int = parameter(
        0, "samples that the wrench is late against the pose", least=0, most=12
    )
    # So that the two belong together; what is late is then predicted. A few
    # milliseconds between force and pose cost more than the delay itself.
    aligned: bool = parameter(True, "whether the pose is held back by as much")
    lost: list[float] = parameter(
        [], "silence: its start, end, start, ...", "s", least=0, most=1e4, shape=(-1,)
    )
    period: float = parameter(1 / 120, "of the readings", "s", above=0, most=0.1)
    seed: int = parameter(0, "of the noise", least=0, most=2**63)

    def rules(self) -> Rules:
        """What must hold across fields."""
        paired = len(self.lost) % 2 == 0 and sorted(self.lost) == self.lost
        yield paired, "lost", "rising times in pairs, e.g. [3.0, 4.5]"


def transverse_inertia(params: InstrumentParams) -> float:
    """Inertia of the instrument across its axis, about the sensor, in kg m^2."""
    rods = (
        params.mount_mass * params.mount_length**2 / 3.0
        + params.shaft_mass * params.length**2 / 3.0
    )
    return rods + params.gauze_mass * params.length**2


def told_instrument[T: InstrumentParams](params: ToolWrenchParams, true: T) -> T:
    """The instrument with the weight of gauze that wrist and arm are told."""
    mass = params.gauze_mass
    return true if mass is None else replace(true, gauze_mass=mass)


def silent(lost: Sequence[float], time: float) -> bool:
    """Whether a time lies between the pairs of start and end times."""
    return any(a <= time < b for a, b in zip(lost[::2], lost[1::2], strict=True))


def sensed_body(plant: Any, frame: str) -> Any:
    """The body below the sensor.

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
            return body
    raise ValueError(
        f"tool_wrench.frame={frame!r} does not hang on a weld joint, "
        "whose reaction a wrist sensor could read"
    )


class ToolWrench(Block):
    """Reads the wrist's force/torque sensor and takes the instrument away.

    White noise, a drifting bias, taring before the shaft enters the trocar,
    saturation, silence and delay are parameters. All outputs are in W.

    Port ``felt`` accepts the reading, `Felt`.

    Port ``mount`` accepts the `Mount` that it sits on.

    Port ``load`` accepts the `Load` that slides along it; none without a wire.

    Port ``shaft`` emits the `ShaftMotion`.

    Port ``wrench`` emits the `Wrench`; silence while the sensor is lost or saturated.
    """

    def __init__(
        self,
        params: ToolWrenchParams | None = None,
        instrument: InstrumentParams | None = None,
        sleeve_mass: float = 0.0,
    ) -> None:
        """Makes the block.

        Args:
            params: Noise, bias, range.
            instrument: What hangs below the sensor.
            sleeve_mass: Of the trocar's sleeve in kg; 0 for none.
        """
        super().__init__()
        p = self._params = params or ToolWrenchParams()
        check(p)
        instrument = instrument or InstrumentParams()
        share = 1.0 + p.mass_error
        self._constants = packed(
            mass=share * instrument.mass,
            centre=instrument.centre,
            inertia=share * transverse_inertia(instrument),
            force_range=float(p.force_range),
            moment_range=float(p.moment_range),
            sleeve_mass=share * sleeve_mass,
        )
        self._move = wired(shaft_motion, 0, [], [Mount], [ShaftMotion], False)
        reading = [Mount, Felt, Fault, Load]
        self._read = wired(wall_wrench, 1, [], reading, [Wrench], False)
        self._silence = flat(SILENCE)
        step = math.sqrt(p.period)
        noise = (p.force_noise,) * 3 + (p.moment_noise,) * 3
        drift = (step * p.force_drift,) * 3 + (step * p.moment_drift,) * 3
        zero = np.array([p.force_offset] * 3 + [p.moment_offset] * 3)
        if p.tare_samples:
            before = sensor_noise.mean_before_start(p.seed, p.tare_samples)
            zero = -np.array(noise) * before
        self._faults = (noise, drift, tuple(zero.tolist()))
        self._felt = self.signal_in("felt", Felt)
        self._load = self.signal_in("load", Load)
        self._mount = self.signal_in("mount", Mount)
        late, moving = {self.xd_ticket()}, {self._mount.ticket()}
        feeling = {
            *moving,
            self._felt.ticket(),
            self._load.ticket(),
            self.time_ticket(),
        }
        if p.delay:
            # Rows of shaft and wrench, the oldest first; silent before the start.
            row = np.concatenate([flat(example(ShaftMotion)), self._silence])
            self.DeclareDiscreteState(np.tile(row, p.delay))
            self.signal_out(
                "wrench", Wrench, lambda context: _late(context)[_SHAFT:_ROW], late
            )
            self.update_every(p.period, self._push)
        else:
            self.signal_out("wrench", Wrench, self._calc_wrench, feeling)
        if p.delay and p.aligned:
            self.signal_out(
                "shaft", ShaftMotion, lambda context: _late(context)[:_SHAFT], late
            )
        else:
            self.signal_out("shaft", ShaftMotion, self._calc_shaft, moving)

    def _calc_shaft(self, context: Any) -> np.ndarray:
        return self._move(self._mount.Eval(context))

    def _calc_wrench(self, context: Any) -> np.ndarray:
        p = self._params
        time = context.get_time()
        if p.lost and silent(p.lost, time):
            return self._silence
        return self._read(
            self._constants,
            self._mount.Eval(context),
            self._felt.Eval(context),
            sensor_noise.fault(p.seed, max(0, round(time / p.period)), self._faults),
            self._load.Eval(context) if self._load.HasValue(context) else _UNLOADED,
        )

    def _push(self, context: Any) -> np.ndarray:
        late = context.get_discrete_state_vector().value()[_ROW:]
        return np.concatenate(
            [late, self._calc_shaft(context), self._calc_wrench(context)]
        )


def _late(context: Any) -> np.ndarray:
    """The oldest row of shaft and wrench."""
    row: np.ndarray = context.get_discrete_state_vector().value()[:_ROW]
    return row


def add_tool_wrench(
    builder: Any,
    plant: Any,
    params: ToolWrenchParams,
    instrument: InstrumentParams,
    abdomen: Abdomen,
    below: Sequence[ModelInstanceIndex],
    factor: Callable[[float], float] = lambda time: 1.0,
) -> ToolWrench:
    """Adds the block as `tool_wrench`, with the sensor, and wires it to the plant.

    Args:
        builder: The diagram's builder.
        plant: The finalized plant.
        params: Noise, bias, range.
        instrument: What is known to hang below the sensor.
        abdomen: What `add_abdomen` returned.
        below: Model instances of what really hangs there, the sleeve's too.
        factor: The trocar's stiffness against the abdomen's, by time in s.
    """
    body = sensed_body(plant, params.frame)
    sensor = add_wrist_sensor(
        builder, plant, body, abdomen, below, params.period, factor
    )
    block = builder.AddNamedSystem(
        "tool_wrench", ToolWrench(params, instrument, abdomen.params.sleeve_mass)
    )
    for name in ("felt", "mount"):
        builder.Connect(sensor.GetOutputPort(name), block.GetInputPort(name))
    return block
