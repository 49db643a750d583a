"""The fuzzy decision: Bauzano et al., section 4, Table I and equation (6).

v_R = c_1 v_1 + c_2 v_2 + c_3 v_3. The directions of the robot's and the
obstacle's velocity, as quadrants, give a label of Table I: A (go away), FA (far
away), C (get closer), HC (high close). Label and distance give the weights.

Axes of the quadrants (the paper names none; this reading fits all 16 cells): y
points from M_R to M_O, x across y to the goal's side, quadrants 1 to 4
counter-clockwise. Then A: both in the same quadrant, FA: they differ in x only,
C: in y only, HC: in both. The memberships are cos^2 humps at 45, 135, 225 and
315 degrees. The robot's velocity is v_1, where the robot wants to go: with v_R
itself, a robot that gives way would look like one that goes along with the
obstacle, and turn back. A robot at rest has no direction: it belongs to all
quadrants. v_O is that of O's material point M_O.

The printed table cannot tell an opposed pair that closes from one that parts
(turn both velocities round). `literal` takes it as it is; `gated` lets it count
only as far as the tools close.

Weights: far off, and with A and FA, the field alone, (1, 0, 0). Nearer, C and HC
add the corrections, (1, 1, 0), and next to the obstacle the backward movement,
(1, 1, 1): then the field acts relative to the obstacle and the robot follows it.
An obstacle at rest has no direction, and is left to the field.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import partial
from math import sqrt
from typing import Any

import numpy as np

from systems.auto_guidance.backward_movement import contact_velocity
from systems.common.compiled import Numbers, compiled, packed
from systems.common.fuzzy import RuleTable, activations, degrees, weighted_mean
from systems.common.geometry import (
    Vector,
    all_finite,
    along,
    any_perpendicular,
    dot,
    limited,
    norm,
    sub,
    unit,
    xyz,
)
from systems.common.signals import (
    GUIDE_EXAMPLE,
    OBSTACLE_EXAMPLE,
    ROBOT_TOOL_EXAMPLE,
    TARGET_EXAMPLE,
    usable,
)
from systems.common.step_block import StepBlock

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
    "go": [1.0, 0.0, 0.0],
    "correct": [1.0, 1.0, 0.0],
    "follow": [1.0, 1.0, 1.0],
}
"""(c_1, c_2, c_3) of each conclusion."""

TABLES = ("literal", "gated")


@dataclass
class FuzzyArbiterParams:
    """Parameters of `FuzzyArbiter`.

    Attributes:
        table: "literal" or "gated".
        period: Of the update, s.
        distances: Centers of close, near and far, m, in rho less the contact
            distance.
        contact_distance: rho at contact, m: the sum of both tools' radii.
        moving_speed: Speed from which on a direction counts in full, m/s. Of the
            tip for the robot, in proportion below; of M_O for the obstacle, not at
            all below half of it.
        closing_speed: Closing speed at which the gated table counts in full, m/s.
        max_speed: v_max of the tip, m/s.
        max_acceleration: Of the tip's commanded velocity, m/s^2.
    """

    table: str = "gated"
    period: float = 1.0 / 60.0
    distances: list[float] = field(default_factory=lambda: [0.01, 0.025, 0.05])
    contact_distance: float = 0.005
    moving_speed: float = 0.01
    closing_speed: float = 0.01
    max_speed: float = 0.06
    max_acceleration: float = 1.0

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: With the name, the value and what was expected.
        """
        if self.table not in TABLES:
            raise ValueError(f"table={self.table!r} must be one of {', '.join(TABLES)}")
        if len(self.distances) != 3 or not (
            0.0 <= self.distances[0] < self.distances[1] < self.distances[2]
        ):
            raise ValueError(
                f"distances={self.distances} must be 3 increasing values >= 0, for "
                f"{', '.join(DISTANCES)}"
            )
        for name in (
            "period",
            "moving_speed",
            "closing_speed",
            "max_speed",
            "max_acceleration",
        ):
            value = getattr(self, name)
            if not 0.0 < value < float("inf"):
                raise ValueError(f"{name}={value} must be finite and > 0")
        if not 0.0 <= self.contact_distance < float("inf"):
            raise ValueError(
                f"contact_distance={self.contact_distance} must be finite and >= 0"
            )


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
def axes(guide: Numbers) -> tuple[Vector, Vector]:
    """The quadrants' axes x, y (unit vectors); see the module.

    Where the tools' axes touch or the goal lies along y, a fixed perpendicular
    stands in for the direction that is missing.

    Args:
        guide: The guide signal (12).
    """
    m_r = xyz(guide, 0)
    goal = sub(xyz(guide, 9), m_r)
    y = unit(sub(xyz(guide, 3), m_r), any_perpendicular(goal))
    across = along(goal, -dot(goal, y), y)
    size = norm(across)
    if size < 1e-6:
        return any_perpendicular(y), y
    return (across[0] / size, across[1] / size, across[2] / size), y


def constants(params: FuzzyArbiterParams) -> np.ndarray:
    """The parameters and both tables as the compiled functions take them."""
    # Table I concludes with a label, not with a number.
    table_i = RuleTable(TABLE_I, {label: [] for label in DECISIONS})
    weights = RuleTable(WEIGHT_TABLE, WEIGHTS)
    return packed(
        params,
        gated=params.table == "gated",
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
    rows, columns = quadrants(v_o[0], v_o[1], slow), quadrants(v_r[0], v_r[1], slow)
    return activations(params.table_i, 4, rows, columns)


@compiled
def label_weights(params: Any, labels: np.ndarray, distance: float) -> Vector:
    """(c_1, c_2, c_3) for degrees of DECISIONS at a distance in m."""
    near = degrees(params.distances, distance)
    weight = activations(params.weight_table, len(params.weights), labels, near)
    return xyz(weighted_mean(weight, params.weights), 0)


@compiled
def decision(params: Any, v1: Numbers, guide: Numbers, obstacle: Numbers) -> Vector:
    """(c_1, c_2, c_3) for finite inputs and a known obstacle.

    Args:
        params: A record of `constants`.
        v1: v_1, m/s.
        guide: The guide signal (12).
        obstacle: Estimate (17) of O.
    """
    v_o = contact_velocity(guide, obstacle)
    # The tremor and the estimate's noise of a tool at rest do not count.
    alert = min(1.0, 2.0 * norm(v_o) / params.moving_speed - 1.0)
    if alert <= 0.0:
        return 1.0, 0.0, 0.0
    x, y = axes(guide)
    r_y, o_y = dot(v1, y), dot(v_o, y)
    if params.gated:
        alert *= min(1.0, max(0.0, (r_y - o_y) / params.closing_speed))
    if alert <= 0.0:
        return 1.0, 0.0, 0.0
    s = guide[7]
    labels = decision_labels(params, (dot(v1, x) / s, r_y / s), (dot(v_o, x), o_y))
    distance = guide[6] - params.contact_distance
    c1, c2, c3 = label_weights(params, labels, distance)
    return 1.0 + alert * (c1 - 1.0), alert * c2, alert * c3


@compiled
def commanded_velocity(
    params: Any,
    v_tip: Numbers,
    dt: float,
    weights: Numbers,
    velocities: Sequence[Numbers],
    s: float,
) -> Vector:
    """v_R / s of equation (6), the tip's velocity, within its limits, m/s.

    Args:
        params: A record of `constants`.
        v_tip: v_R / s before the step, m/s.
        dt: Length of the step, s.
        weights: (c_1, c_2, c_3).
        velocities: v_1, v_2, v_3, m/s.
        s: Proportion of the guide point.
    """
    (a, b, c), (v1, v2, v3) = weights, velocities
    wanted = (
        (a * v1[0] + b * v2[0] + c * v3[0]) / s,
        (a * v1[1] + b * v2[1] + c * v3[1]) / s,
        (a * v1[2] + b * v2[2] + c * v3[2]) / s,
    )
    change = sub(limited(wanted, params.max_speed), v_tip)
    return along(v_tip, 1.0, limited(change, params.max_acceleration * dt))


@compiled
def arbitrate(
    params: Any,
    v_tip: Numbers,
    dt: float,
    velocities: tuple[Numbers, Numbers, Numbers],
    guide: Numbers,
    robot_tool: Numbers,
    obstacle: Numbers,
    target: Numbers,
) -> tuple[Vector, Vector, float]:
    """One step of the block: decision, sum and limits.

    Args:
        params: A record of `constants`.
        v_tip: v_R / s before the step, m/s.
        dt: Length of the step, s.
        velocities: v_1, v_2, v_3, m/s.
        guide: The guide signal (12).
        robot_tool: G_R, P_R (6), m.
        obstacle: Estimate (17) of O.
        target: Estimate (17) of S.

    Returns:
        (weights, v_R / s in m/s, s).
    """
    v1, v2, v3 = velocities
    known = usable(obstacle) and usable(target)
    moves = all_finite(v1) and all_finite(v2) and all_finite(v3)
    if not (known and moves and all_finite(guide) and all_finite(robot_tool)):
        s = guide[7] if all_finite(guide) else 1.0
        change = limited(sub((0.0, 0.0, 0.0), v_tip), params.max_acceleration * dt)
        return (0.0, 0.0, 0.0), along(v_tip, 1.0, change), s
    weights = decision(params, v1, guide, obstacle)
    s = guide[7]
    return weights, commanded_velocity(params, v_tip, dt, weights, velocities, s), s


@compiled
def _step(
    record: np.ndarray,
    state: np.ndarray,
    time: float,
    v1: np.ndarray,
    v2: np.ndarray,
    v3: np.ndarray,
    guide: np.ndarray,
    robot_tool: np.ndarray,
    obstacle: np.ndarray,
    target: np.ndarray,
) -> np.ndarray:
    """The next state (4), the weights (3) and v_R (3)."""
    weights, v_tip, s = arbitrate(
        record[0],
        xyz(state, 0),
        time - state[3],
        (xyz(v1, 0), xyz(v2, 0), xyz(v3, 0)),
        guide,
        robot_tool,
        obstacle,
        target,
    )
    v_r = along((0.0, 0.0, 0.0), s, v_tip)
    return np.array(v_tip + (time,) + weights + v_r)


class FuzzyArbiter(StepBlock):
    """Weighs the three behaviours and adds them up to the guide point's velocity.

    Bauzano et al., section 4, Table I and equation (6); see the module. While an
    estimate is not known or an input is not finite, the weights are zero and the
    robot slows down to rest at the maximum acceleration.

    Port ``v1`` accepts v_1 (3) of go to target, m/s, in W.
    Port ``v2`` accepts v_2 (3) of the velocity corrections, m/s, in W.
    Port ``v3`` accepts v_3 (3) of the backward movement, m/s, in W.
    Port ``guide`` accepts the guide signal (12).
    Port ``robot_tool`` accepts the robot's instrument: fulcrum G_R and tip P_R
    (6), m, in W.
    Port ``obstacle`` accepts the estimate (17) of the obstacle tool O.
    Port ``target`` accepts the estimate (17) of the target tool S.
    Port ``weights`` emits c_1, c_2, c_3 (3).
    Port ``v_R`` emits the commanded velocity of the guide point (3), m/s, in W.

    The discrete state is v_R / s (3) and the time of the last update. The output
    is that of the step from then to now: no sample of delay.
    """

    def __init__(self, params: FuzzyArbiterParams | None = None) -> None:
        """Builds the block.

        Args:
            params: Parameters; the defaults if None.

        Raises:
            ValueError: If a parameter is out of range.
        """
        super().__init__()
        params = params or FuzzyArbiterParams()
        params.check()
        self.declare_step(
            partial(_step, constants(params)),
            {
                "v1": [0.05, 0.0, 0.0],
                "v2": [-0.01, 0.0, 0.0],
                "v3": [0.0, -0.01, 0.0],
                "guide": GUIDE_EXAMPLE,
                "robot_tool": ROBOT_TOOL_EXAMPLE,
                "obstacle": OBSTACLE_EXAMPLE,
                "target": TARGET_EXAMPLE,
            },
            [0.0, 0.0, 0.0, -params.period],
            {"weights": 3, "v_R": 3},
            params.period,
        )
