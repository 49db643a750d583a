"""The scenario of a moving snake: every block's and part's parameters."""

from dataclasses import dataclass, field

from diagrams.common.scenario import Scenario, ScenarioError, nearest
from plants.snake.drive import SnakeDriveParams
from plants.snake.elastic_wires import ElasticWiresParams
from plants.snake.inverse_kinematics import tool_postures
from plants.snake.parameters import SnakeParams
from plants.snake.reachability import why_not
from systems.resection.wires.resection_ik import ResectionIkParams
from systems.resection.wires.tip_reference import TipReferenceParams, reference
from systems.resection.wires.wire_drums import WireDrumsParams
from systems.resection.wires.wire_inverse_actuation import WireInverseActuationParams
from systems.resection.wires.wire_tension import WireTensionParams
from systems.resection.wires.wire_watch import WireWatchParams

WIRE_MODELS = ("drums", "elastic")

ELASTIC_STEP = 4e-4
"""Step in s of the elastic-wire variant: its springs are explicit. At 0.5 ms the
default snake still is stable, at 1 ms it is not."""


@dataclass
class SnakeScenario(Scenario):
    """Martin et al., sections III and IV: the wire-driven snake in motion.

    Attributes:
        period: Of drums and inverse kinematics in s, and CENIC's longest step. It
            replaces `tip.lead` and the blocks' own periods.
        wires: "drums": wires as stiff as their drums; "elastic": springs that can
            go slack and snap.
    """

    period: float = 0.02
    wires: str = "drums"
    snake: SnakeParams = field(default_factory=SnakeParams)
    drive: SnakeDriveParams = field(default_factory=SnakeDriveParams)
    tip: TipReferenceParams = field(default_factory=TipReferenceParams)
    resection_ik: ResectionIkParams = field(default_factory=ResectionIkParams)
    inverse_actuation: WireInverseActuationParams = field(
        default_factory=WireInverseActuationParams
    )
    drums: WireDrumsParams = field(default_factory=WireDrumsParams)
    tension: WireTensionParams = field(default_factory=WireTensionParams)
    elastic: ElasticWiresParams = field(default_factory=ElasticWiresParams)
    watch: WireWatchParams = field(default_factory=WireWatchParams)


def check(scenario: SnakeScenario) -> None:
    """Raises ScenarioError for a scenario that cannot run."""
    if scenario.wires not in WIRE_MODELS:
        raise ScenarioError(
            f"wires={scenario.wires!r}: {nearest(scenario.wires, WIRE_MODELS)}"
        )
    if not scenario.period > 0.0:
        raise ScenarioError(f"period={scenario.period} s: expected > 0, e.g. 0.02")
    for part in vars(scenario).values():
        if hasattr(part, "check"):
            part.check()
    if scenario.elastic.breaks and scenario.wires != "elastic":
        raise ScenarioError(
            "elastic.breaks: wires of wires='drums' cannot go slack; "
            "expected wires='elastic'"
        )
    _check_reach(scenario)


def _check_reach(scenario: SnakeScenario) -> None:
    """Every pose, and a whole turn of the circle, must be within reach."""
    tip = scenario.tip
    if tip.poses:
        samples = [(f"tip.poses[{i}]", p.vector()) for i, p in enumerate(tip.poses)]
    else:
        turn = tip.circle.period
        times = [tip.circle.ramp + turn * k / 72 for k in range(72)]
        samples = [("tip.circle", reference(tip, t)) for t in times]
    for name, v in samples:
        if not tool_postures(v[:3], v[3:6], v[6:], scenario.snake).reached:
            reason = why_not(v[:3], v[3:6], v[6:], scenario.snake)
            raise ScenarioError(f"{name}: {reason}")
