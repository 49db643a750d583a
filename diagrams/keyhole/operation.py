"""An operation's case: the plan in the organ's frame before anything moves."""

from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from diagrams.common.case import Case
from diagrams.common.progress import Progress
from diagrams.keyhole.scenario import KeyholeScenario, circle_postures
from diagrams.resection import operation
from diagrams.resection.operation import Operation
from systems.keyhole.snake_task import Plan, evenly, planned

LOG_PERIOD = 1.0 / 30.0
BEFORE = 30.0
"""Time in s that is reckoned for probe, approach and gate."""


@dataclass(kw_only=True)
class KeyholeCase(Case):
    """A keyhole operation's case.

    Attributes:
        plan: What the tool is to do.
        resection: The resection's own case; None for the circle.
    """

    plan: Plan
    resection: Operation | None = None

    @property
    def session(self) -> Any:
        """The resection's session; None for the circle."""
        return self.resection.session if self.resection else None


def circle(scenario: KeyholeScenario) -> Plan:
    """Turns of the circle, the first of which begins softly."""
    postures, times = circle_postures(scenario)
    ramp = scenario.circle.ramp
    # The clock's first turn: the angle grows as t^2 / 2 ramp, then at full speed.
    turn = scenario.circle.period
    angles = np.arange(0.0, 2.0 * turn + 1e-9, turn / 240.0)
    at = np.where(
        angles < ramp / 2.0, np.sqrt(2.0 * ramp * angles), angles + ramp / 2.0
    )
    x = np.array([np.interp(angles % turn, times, row) for row in postures.T]).T
    return evenly(x, at, float(at[np.searchsorted(angles, turn - 1e-9)]))


def case_of(scenario: KeyholeScenario, resection: Operation | None) -> KeyholeCase:
    """The case of a scenario and its resection."""
    if resection is None:
        return KeyholeCase(scenario, plan=circle(scenario))
    plan = planned(resection.session.postures, scenario.planned.player)
    return KeyholeCase(scenario, plan=plan, resection=resection)


def outline(scenario: KeyholeScenario) -> KeyholeCase:
    """A case of which nothing is planned."""
    wanted = scenario.task == "resect"
    return case_of(scenario, operation.outline(scenario.planned) if wanted else None)


def prepare(scenario: KeyholeScenario, progress: Progress) -> KeyholeCase:
    """Plans what is to be resected.

    Raises:
        ValueError: If tumour, access or session's files make no sense.
    """
    wanted = scenario.task == "resect"
    return case_of(
        scenario, operation.prepare(scenario.planned, progress) if wanted else None
    )


def length(case: KeyholeCase) -> float:
    """How long the run takes at most, in s."""
    whole: float = case.scenario.duration
    if np.isfinite(case.plan.end):
        extra = BEFORE + 12.0 + 60.0 * len(case.scenario.wall_motion.irregular.coughs)
        whole = min(whole, case.plan.end + extra)
    return math.ceil(whole / LOG_PERIOD - 1e-6) * LOG_PERIOD
