"""What a snake of free balls may sense besides: tensions, slack, and contacts."""

from dataclasses import dataclass, replace
from typing import Any

from pydrake.common import RandomDistribution
from pydrake.systems.primitives import RandomSource

from diagrams.snake.robot import is_free
from plants.snake.signals import Drums, Tensions
from systems.common.parameter import Rules, parameter, part
from systems.common.signal import size
from systems.resection.wires.base_sensor import (
    BaseSensor,
    BaseSensorParams,
    SensorNoise,
)
from systems.resection.wires.contact_watch import (
    Contact,
    ContactWatch,
    ContactWatchParams,
)
from systems.resection.wires.pretension_control import (
    CellCode,
    CellNoise,
    PretensionControl,
    PretensionControlParams,
)
from systems.resection.wires.tension_estimator import (
    TensionEstimator,
    TensionEstimatorParams,
    TensionInterval,
)
from systems.resection.wires.wire_statics import WireStatics

WIRES_OF = {
    "estimate": (
        ("wire_statics.tension", "tension_estimator.tension"),
        ("resection_ik.posture", "tension_estimator.posture"),
    ),
    "control_pretension": (
        ("wire_inverse_actuation.drums", "pretension_control.command"),
        ("wire_statics.tension", "pretension_control.tension"),
        ("cell_noise.output", "pretension_control.noise"),
        ("pretension_control.drums", "wire_drums.command"),
    ),
    "feel": (
        ("plant.snake_state", "base_sensor.state"),
        ("tool_load.force", "base_sensor.force"),
        ("base_noise.output", "base_sensor.noise"),
        ("base_sensor.wrench", "contact_watch.wrench"),
        ("resection_ik.posture", "contact_watch.posture"),
    ),
}
"""By the key that adds the blocks; one that ends in another's port takes its place."""

EXPORTS_OF = {
    "estimate": {
        "wires.tip_tension": "wire_statics.tip_tension",
        "wires.interval": "tension_estimator.interval",
    },
    "control_pretension": {"cells.code": "pretension_control.cell"},
    "feel": {"base.contact": "contact_watch.contact"},
}

SIGNALS_OF: dict[str, dict[str, Any]] = {
    "estimate": {"wires.tip_tension": Tensions, "wires.interval": TensionInterval},
    "control_pretension": {"cells.code": CellCode},
    "feel": {"base.contact": Contact},
}


@dataclass
class SensingParams:
    """What a scenario's snake senses, by `wires=statics`."""

    estimate: bool = parameter(
        False, "whether bounds of the tensions at the tips are estimated"
    )
    estimator: TensionEstimatorParams = part(TensionEstimatorParams)
    control_pretension: bool = parameter(
        False, "whether load cells' controller takes slack up, not an ideal one"
    )
    pretension: PretensionControlParams = part(PretensionControlParams)
    feel: bool = parameter(
        False, "whether a sensor under the drive pack feels contacts"
    )
    base: BaseSensorParams = part(BaseSensorParams)
    contact: ContactWatchParams = part(ContactWatchParams)

    def sensing_rules(self) -> Rules:
        """Balls that do not turn freely have none of it."""
        for key in WIRES_OF:
            asked = is_free(self) or not getattr(self, key)
            yield asked, key, "none without wires='statics'"


def chosen(scenario: Any) -> list[str]:
    """The keys that are set."""
    return [key for key in WIRES_OF if getattr(scenario, key)]


def sensing_wires(
    scenario: Any, wires: tuple[tuple[str, str], ...]
) -> tuple[tuple[str, str], ...]:
    """The wires of a snake, with those of what it senses."""
    for key in chosen(scenario):
        sinks = {sink for _, sink in WIRES_OF[key]}
        kept = (wire for wire in wires if wire[1] not in sinks)
        wires = (*kept, *WIRES_OF[key])
    return wires


def sensing_blocks(
    scenario: Any, posture: list[float], wound: list[float]
) -> dict[str, Any]:
    """The blocks of `sensing_wires`.

    Args:
        scenario: A snake's.
        posture: Where it starts, (7,).
        wound: Lengths of wires and the translation there, m.
    """
    s, blocks = scenario, {}
    if s.control_pretension:
        *lengths, travel = wound
        # It stands in the ideal one's place.
        slack = replace(s.drive, pretension=0.0)
        blocks["wire_statics"] = WireStatics(
            s.snake, slack, s.core, s.period, posture, s.friction
        )
        blocks["pretension_control"] = PretensionControl(
            replace(s.pretension, period=s.period),
            s.drive,
            Drums(tuple(lengths), travel),
        )
        blocks["cell_noise"] = _noise(CellNoise, s.period)
    if s.feel:
        blocks["base_sensor"] = BaseSensor(s.base, s.snake, s.drive)
        blocks["base_noise"] = _noise(SensorNoise, s.period)
        blocks["contact_watch"] = ContactWatch(
            replace(s.contact, period=s.period), s.snake, s.drive
        )
    if s.estimate:
        blocks["tension_estimator"] = TensionEstimator(
            replace(s.estimator, period=s.period), s.snake
        )
    return blocks


def _noise(kind: Any, period: float) -> RandomSource:
    return RandomSource(RandomDistribution.kGaussian, size(kind), period)
