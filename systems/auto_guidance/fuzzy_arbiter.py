"""The fuzzy decision: Bauzano et al., section 4, Table I and equation (6).

v_R = c_1 v_1 + c_2 v_2 + c_3 v_3. The directions of the robot's and the
obstacle's velocity, as quadrants, give a label of Table I: A (go away), FA (far
away), C (get closer), HC (high close). Label and distance give the weights.

Axes of the quadrants (the paper names none; this reading fits all 16 cells): y
points from M_R to M_O, x across y to the goal's side, quadrants 1 to 4
counter-clockwise. Then A: both in the same quadrant, FA: they differ in x only,
C: in y only, HC: in both. The memberships are cos^2 humps at 45, 135, 225 and
315 degrees. Figure 4 decides on the current v_R (`velocity=v_R`); by default it is
v_1, where the robot wants to go: with v_R itself, a robot that gives way looks like
one that goes along with the obstacle, and turns back. A robot at rest has no
direction: it belongs to all quadrants. v_O is that of O's material point M_O.

The printed table cannot tell an opposed pair that closes from one that parts
(turn both velocities round). `literal` takes it as it is; `gated` lets it count
only as far as the tools close. The paper's own decision is `literal` on `v_R`.

Weights: far off, and with A and FA, the field alone, (1, 0, 0). Nearer, C and HC
add the corrections, (1, 1, 0), and next to the obstacle the backward movement,
(1, 1, 1): then the field acts relative to the obstacle and the robot follows it.
An obstacle at rest has no direction, and is left to the field.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import sqrt
from typing import Annotated, Any, NamedTuple

import numpy as np

from systems.auto_guidance.backward_movement import contact_velocity
from systems.auto_guidance.nearest import obstacle_at
from systems.common.compiled import compiled, packed
from systems.common.fuzzy import RuleTable, activations, degrees, weighted_mean
from systems.common.geometry import (
    across,
    all_finite,
    along,
    any_perpendicular,
    dot,
    limited,
    norm,
    over,
    plus,
    scaled,
    sub,
    unit,
)
from systems.common.parameter import Rules, check, parameter
from systems.common.signal import Field, Many, Vector, reader
from systems.common.signals import (
    Estimate,
    Guide,
    RobotTool,
    Velocity,
    finite_guide,
    finite_tool,
    usable,
)
from systems.common.step_block import StepBlock


class Weights(NamedTuple):
    """What the behaviours count in equation (6)."""

    c1: Annotated[float, Field("1", "of go to target", 1.0)]
    c2: Annotated[float, Field("1", "of the velocity corrections", 0.0)]
    c3: Annotated[float, Field("1", "of the backward movement", 0.0)]


read_weights = reader(Weights)


class State(NamedTuple):
    """v_R / s in m/s, and the time of the last update in s."""

    v_tip: Vector
    time: float


TABLE_I = [
    ["A", "FA", "HC", "C"],
    ["FA", "A", "C", "HC"],
    ["HC", "C", "A", "FA"],
    ["C", "HC", "FA", "A"],
]
"""Rows: quadrant of v_O; columns: quadrant of v_R."""

DECISIONS = ["A", "FA", "C", "HC"]
DISTANCES = ["close", "near", "far"]
WEIGHT_TABLE = [
    ["go", "go", "go"],
    ["go", "go", "go"],
    ["follow", "correct", "go"],
    ["follow", "correct", "go"],
]
"""Rows: DECISIONS; columns: DISTANCES."""

WEIGHTS = {
    "go": Weights(1.0, 0.0, 0.0),
    "correct": Weights(1.0, 1.0, 0.0),
    "follow": Weights(1.0, 1.0, 1.0),
}

TABLES = ("literal", "gated")
VELOCITIES = ("v_1", "v_R")


@dataclass
class FuzzyArbiterParams:
    """Parameters of `FuzzyArbiter`."""

    table: str = parameter("gated", "how Table I is read", choices=TABLES)
    velocity: str = parameter(
        "v_1", "the robot's velocity that Table I reads", choices=VELOCITIES
    )
    period: float = parameter(1 / 60, "of the update", "s", above=0.0, most=1.0)
    distances: list[float] = parameter(
        [0.01, 0.025, 0.05],
        f"centers of {', '.join(DISTANCES)}, in rho less the contact distance",
        "m",
        least=0.0,
        most=0.5,
        shape=(3,),
    )
    contact_distance: float = parameter(
        0.005, "rho at contact: the sum of both tools' radii", "m", least=0.0, most=0.02
    )
    moving_speed: float = parameter(
        0.01,
        "speed from which on a direction counts in full: of the tip for the robot, in "
        "proportion below; of M_O for the obstacle, not at all below half of it",
        "m/s",
        above=0.0,
        most=0.1,
    )
    closing_speed: float = parameter(
        0.01,
        "closing speed at which the gated table counts in full",
        "m/s",
        above=0.0,
        most=0.1,
    )
    max_speed: float = parameter(0.06, "v_max of the tip", "m/s", above=0.0, most=0.5)
    max_acceleration: float = parameter(
        1.0, "of the tip's commanded velocity", "m/s^2", above=0.0, most=10.0
    )

    def rules(self) -> Rules:
        """What must hold across the parameters."""
        is_rising = all(a < b for a, b in pairwise(self.distances))
        yield is_rising, "distances", "increasing numbers"


@compiled
def quadrants(x: float, y: float, moving_speed: float) -> np.ndarray:
    """Membership of a velocity in the quadrants 1 to 4.

    cos^2 of the angle to a quadrant's diagonal, within 90 degrees. Below
    `moving_speed` the direction counts less and less: every quadrant gains.
    """
    speed = sqrt(x * x + y * y)
    if speed < 1e-9:
        return np.ones(4)
    # Components along the diagonals of quadrants 1 and 2.
    c1 = (x + y) / speed
    c2 = (y - x) / speed
    unsure = max(0.0, 1.0 - speed / moving_speed)
    degree = 0.5 * np.array((c1 * c1, c2 * c2, c1 * c1, c2 * c2))
    degree[2 if c1 > 0.0 else 0] = 0.0
    degree[3 if c2 > 0.0 else 1] = 0.0
    return np.maximum(degree, unsure)


@compiled
def axes(guide: Guide) -> tuple[Vector, Vector]:
    """The quadrants' axes x, y (unit vectors); see the module.

    Where the tools' axes touch or the goal lies along y, a fixed perpendicular
    stands in for the direction that is missing.
    """
    goal = sub(guide.M_Rf, guide.M_R)
    y = unit(sub(guide.M_O, guide.M_R), any_perpendicular(goal))
    sideways = across(goal, y)
    if norm(sideways) < 1e-6:
        return any_perpendicular(y), y
    return unit(sideways), y


def constants(params: FuzzyArbiterParams) -> np.ndarray:
    """The parameters and both tables as the compiled functions take them."""
    check(params)
    # Table I concludes with a label, not with a number.
    table_i = RuleTable(TABLE_I, {label: [] for label in DECISIONS})
    weights = RuleTable(WEIGHT_TABLE, WEIGHTS)
    return packed(
        params,
        gated=params.table == "gated",
        current=params.velocity == "v_R",
        table_i=table_i.cells,
        weight_table=weights.cells,
        weights=weights.values,
    )


@compiled
def decision_labels(
    params: Any, v_r: tuple[float, float], v_o: tuple[float, float]
) -> np.ndarray:
    """Table I: degrees of DECISIONS for two velocities on the axes x, y, m/s."""
    slow = params.moving_speed
    return activations(params.table_i, 4, quadrants(*v_o, slow), quadrants(*v_r, slow))


@compiled
def label_weights(params: Any, labels: np.ndarray, distance: float) -> Weights:
    """The weights for degrees of DECISIONS at a distance in m."""
    near = degrees(params.distances, distance)
    weight = activations(params.weight_table, len(params.weights), labels, near)
    return read_weights(weighted_mean(weight, params.weights))


@compiled
def decision(params: Any, v: Vector, guide: Guide, obstacle: Estimate) -> Weights:
    """The weights for finite inputs and a known obstacle.

    Args:
        params: A record of `constants`.
        v: The guide point's velocity that Table I reads, v_1 or v_R, m/s.
        guide: The guide point.
        obstacle: Of O.
    """
    v_o = contact_velocity(guide, obstacle)
    # The tremor and the estimate's noise of a tool at rest do not count.
    alert = min(1.0, 2.0 * norm(v_o) / params.moving_speed - 1.0)
    if alert <= 0.0:
        return Weights(1.0, 0.0, 0.0)
    x, y = axes(guide)
    r_y, o_y = dot(v, y), dot(v_o, y)
    if params.gated:
        alert *= min(1.0, max(0.0, (r_y - o_y) / params.closing_speed))
    if alert <= 0.0:
        return Weights(1.0, 0.0, 0.0)
    s = guide.s
    labels = decision_labels(params, (dot(v, x) / s, r_y / s), (dot(v_o, x), o_y))
    c = label_weights(params, labels, guide.rho - params.contact_distance)
    return Weights(1.0 + alert * (c.c1 - 1.0), alert * c.c2, alert * c.c3)


@compiled
def commanded_velocity(
    params: Any,
    v_tip: Vector,
    dt: float,
    weights: Weights,
    velocities: tuple[Vector, Vector, Vector],
    s: float,
) -> Vector:
    """v_R / s of equation (6), the tip's velocity, within its limits, m/s.

    Args:
        params: A record of `constants`.
        v_tip: v_R / s before the step, m/s.
        dt: Length of the step, s.
        weights: c_1, c_2, c_3.
        velocities: v_1, v_2, v_3, m/s.
        s: Proportion of the guide point.
    """
    v1, v2, v3 = velocities
    v_r = along(along(scaled(weights.c1, v1), weights.c2, v2), weights.c3, v3)
    change = sub(limited(over(v_r, s), params.max_speed), v_tip)
    return plus(v_tip, limited(change, params.max_acceleration * dt))


@compiled
def arbitrate(
    params: Any,
    v_tip: Vector,
    dt: float,
    velocities: tuple[Vector, Vector, Vector],
    guide: Guide,
    robot: RobotTool,
    obstacle: Estimate,
    target: Estimate,
) -> tuple[Weights, Vector, float]:
    """One step of the block: decision, sum and limits.

    Args:
        params: A record of `constants`.
        v_tip: v_R / s before the step, m/s.
        dt: Length of the step, s.
        velocities: v_1, v_2, v_3, m/s.
        guide: The guide point.
        robot: R.
        obstacle: Of O.
        target: Of S.

    Returns:
        The weights, v_R / s in m/s, and s.
    """
    v1, v2, v3 = velocities
    known = usable(obstacle) and usable(target)
    moves = all_finite(v1) and all_finite(v2) and all_finite(v3)
    is_there = finite_guide(guide)
    if not (known and moves and is_there and finite_tool(robot)):
        s = guide.s if is_there else 1.0
        change = limited(scaled(-1.0, v_tip), params.max_acceleration * dt)
        return Weights(0.0, 0.0, 0.0), plus(v_tip, change), s
    seen = scaled(guide.s, v_tip) if params.current else v1
    weights = decision(params, seen, guide, obstacle)
    v = commanded_velocity(params, v_tip, dt, weights, velocities, guide.s)
    return weights, v, guide.s


@compiled
def _step(
    params: Any,
    state: State,
    time: float,
    v1: Velocity,
    v2: Velocity,
    v3: Velocity,
    guide: Guide,
    robot: RobotTool,
    obstacles: np.ndarray,
    target: Estimate,
) -> tuple[State, Weights, Velocity]:
    weights, v_tip, s = arbitrate(
        params,
        state.v_tip,
        time - state.time,
        (v1.v, v2.v, v3.v),
        guide,
        robot,
        obstacle_at(guide, obstacles),
        target,
    )
    return State(v_tip, time), weights, Velocity(scaled(s, v_tip))


class FuzzyArbiter(StepBlock):
    """Weighs the three behaviours and adds them up to the guide point's velocity.

    Bauzano et al., section 4, Table I and equation (6); see the module. While an
    estimate is not known or an input is not finite, the weights are zero and the
    robot slows down to rest at the maximum acceleration.

    Port ``v1`` accepts v_1 of go to target, a `Velocity` of the guide point.
    Port ``v2`` accepts v_2 of the velocity corrections, a `Velocity`.
    Port ``v3`` accepts v_3 of the backward movement, a `Velocity`.
    Port ``guide`` accepts the `Guide`.
    Port ``robot_tool`` accepts the `RobotTool`.
    Port ``obstacles`` accepts the `Estimate` of every obstacle tool; O is the nearest.
    Port ``target`` accepts the `Estimate` of the target tool S.
    Port ``weights`` emits the `Weights`.
    Port ``v_R`` emits the commanded `Velocity` of the guide point.

    The outputs are those of the step from the last update to now: no sample of delay.
    """

    def __init__(
        self,
        params: FuzzyArbiterParams | None = None,
        obstacles: Sequence[str] = ("obstacle",),
    ) -> None:
        """Builds the block.

        Args:
            params: Parameters; the defaults if None.
            obstacles: Names of the obstacle tools.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        params = params or FuzzyArbiterParams()
        self.declare_step(
            _step,
            [constants(params)],
            {
                "v1": Velocity,
                "v2": Velocity,
                "v3": Velocity,
                "guide": Guide,
                "robot_tool": RobotTool,
                "obstacles": Many(Estimate, tuple(obstacles)),
                "target": Estimate,
            },
            State((0.0, 0.0, 0.0), -params.period),
            {"weights": Weights, "v_R": Velocity},
            params.period,
        )
