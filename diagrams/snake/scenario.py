"""The scenario of a moving snake: every block's and part's parameters."""

from dataclasses import dataclass

from diagrams.common.scenario import Scenario, ScenarioError
from plants.snake.core import SnakeCoreParams
from plants.snake.drive import SnakeDriveParams
from plants.snake.elastic_wires import ElasticWiresParams
from plants.snake.friction import SnakeFrictionParams
from plants.snake.inverse_kinematics import tool_postures
from plants.snake.parameters import SnakeParams
from plants.snake.reachability import why_not
from plants.snake.signals import ToolTarget
from systems.common.parameter import Rules, parameter, part
from systems.resection.wires.base_sensor import BaseSensorParams
from systems.resection.wires.contact_watch import ContactWatchParams
from systems.resection.wires.hysteresis_compensation import (
    HysteresisCompensationParams,
)
from systems.resection.wires.pretension_control import PretensionControlParams
from systems.resection.wires.resection_ik import ResectionIkParams
from systems.resection.wires.tension_estimator import TensionEstimatorParams
from systems.resection.wires.tip_reference import TipReferenceParams, reference
from systems.resection.wires.tool_load import ToolLoadParams
from systems.resection.wires.tool_tracker import ToolTrackerParams
from systems.resection.wires.wire_drums import WireDrumsParams
from systems.resection.wires.wire_inverse_actuation import WireInverseActuationParams
from systems.resection.wires.wire_tension import WireTensionParams
from systems.resection.wires.wire_watch import WireWatchParams

WIRE_MODELS = ("drums", "elastic", "statics")
COMPENSATIONS = ("none", "model", "tracked")

ELASTIC_STEP = 4e-4
"""Step in s of the elastic-wire variant: its springs are explicit. At 0.5 ms the
default snake still is stable, at 1 ms it is not."""


@dataclass
class SnakeScenario(Scenario):
    """Martin et al., sections III and IV: the wire-driven snake in motion."""

    # It replaces `tip.lead` and the blocks' own periods.
    period: float = parameter(
        0.02,
        "of drums and inverse kinematics, and CENIC's longest step",
        "s",
        least=1e-3,
        most=0.1,
    )
    wires: str = parameter(
        "drums",
        "as stiff as their drums; elastic, which can go slack and snap; or statics, "
        "in which each ball turns as wires, core and load have it",
        choices=WIRE_MODELS,
    )
    guided: str | None = parameter(
        None, "tape of the drums' commands, wound by hand; '': live", file=True
    )
    snake: SnakeParams = part(SnakeParams)
    drive: SnakeDriveParams = part(SnakeDriveParams)
    tip: TipReferenceParams = part(TipReferenceParams)
    resection_ik: ResectionIkParams = part(ResectionIkParams)
    inverse_actuation: WireInverseActuationParams = part(WireInverseActuationParams)
    drums: WireDrumsParams = part(WireDrumsParams)
    tension: WireTensionParams = part(WireTensionParams)
    elastic: ElasticWiresParams = part(ElasticWiresParams)
    core: SnakeCoreParams = part(SnakeCoreParams)
    friction: SnakeFrictionParams = part(SnakeFrictionParams)
    compensation: str = parameter(
        "none",
        "of friction and load: none, by a model, or by a model and a tracked tool",
        choices=COMPENSATIONS,
    )
    hysteresis: HysteresisCompensationParams = part(HysteresisCompensationParams)
    tracker: ToolTrackerParams = part(ToolTrackerParams)
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
    load: ToolLoadParams = part(ToolLoadParams)
    watch: WireWatchParams = part(WireWatchParams)

    def rules(self) -> Rules:
        """Wires know what is asked of them, and the tool's way is within reach."""
        slack = not self.elastic.breaks or self.wires == "elastic"
        yield slack, "elastic.breaks", "none but of wires='elastic', that can go slack"
        free, told = self.wires == "statics", "without wires='statics'"
        yield free or not any(self.load.force), "load.force", f"zero {told}"
        yield free or not self.load.cutting, "load.cutting", f"zero {told}"
        smooth = not (self.friction.wire or self.friction.socket)
        yield free or smooth, "friction", f"none {told}, that know it"
        plain = self.compensation == "none"
        yield free or plain, "compensation", f"none {told}, that know friction"
        for key in ("estimate", "control_pretension", "feel"):
            yield free or not getattr(self, key), key, f"none {told}"
        for name, target in _targets(self.tip, self.snake):
            if not tool_postures(*target, self.snake).reached:
                raise ScenarioError(f"{name}: {why_not(*target, self.snake)}")


def _targets(
    tip: TipReferenceParams, snake: SnakeParams
) -> list[tuple[str, ToolTarget]]:
    """Every pose, or a whole turn of the way, by its key."""
    if tip.poses:
        return [(f"tip.poses[{i}]", p.target()) for i, p in enumerate(tip.poses)]
    turn = tip.circle.period
    times = [tip.circle.ramp + turn * k / 72 for k in range(72)]
    return [(f"tip.{tip.way}", reference(tip, t, snake)) for t in times]
