"""The scenario of a moving snake: every block's and part's parameters."""

from dataclasses import dataclass

from diagrams.common.scenario import Scenario, ScenarioError
from diagrams.snake.robot import FreeBallsParams
from diagrams.snake.sensing import SensingParams
from plants.snake.drive import SnakeDriveParams
from plants.snake.elastic_wires import ElasticWiresParams
from plants.snake.inverse_kinematics import tool_postures
from plants.snake.parameters import SnakeParams
from plants.snake.reachability import why_not
from plants.snake.signals import ToolTarget
from systems.common.parameter import Rules, parameter, part
from systems.resection.wires.resection_ik import ResectionIkParams
from systems.resection.wires.tip_reference import TipReferenceParams, reference
from systems.resection.wires.wire_drums import WireDrumsParams
from systems.resection.wires.wire_inverse_actuation import WireInverseActuationParams
from systems.resection.wires.wire_tension import WireTensionParams
from systems.resection.wires.wire_watch import WireWatchParams

WIRE_MODELS = ("drums", "elastic", "statics")

ELASTIC_STEP = 4e-4
"""Step in s of the elastic-wire variant: its springs are explicit. At 0.5 ms the
default snake still is stable, at 1 ms it is not."""


@dataclass
class SnakeScenario(SensingParams, FreeBallsParams, Scenario):
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
    watch: WireWatchParams = part(WireWatchParams)

    def rules(self) -> Rules:
        """Wires know what is asked of them, and the tool's way is within reach."""
        slack = not self.elastic.breaks or self.wires == "elastic"
        yield slack, "elastic.breaks", "none but of wires='elastic', that can go slack"
        yield from super().rules()
        yield from self.sensing_rules()
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
