"""Tip reference: where the tool is to be: poses in turn, a circle, a scan, a swing."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from plants.snake.parameters import SnakeParams
from plants.snake.posture import posture_of
from plants.snake.signals import ToolPose, ToolTarget
from plants.snake.tool_target import target_of
from systems.common.block import Block
from systems.common.geometry import across, along, cross, plus, scaled, unit
from systems.common.parameter import Rules, check, parameter, part
from systems.common.signal import vector

PLACE: dict[str, Any] = {"least": -0.5, "most": 0.5, "shape": (3,)}
DIRECTION: dict[str, Any] = {"least": -1e3, "most": 1e3, "shape": (3,)}


def is_direction(n: Sequence[float]) -> bool:
    """Whether a vector is long enough to have a direction."""
    return math.hypot(*n) >= 1e-9


@dataclass
class PoseParams:
    """A tool pose in the channel frame W, with the redundant freedoms."""

    p_WT: list[float] = parameter([0.0, 0.0, 0.0414], "of the tool", "m", **PLACE)
    n_WT: list[float] = parameter([0.0, 0.0, 1.0], "its axis", **DIRECTION)
    n_WI: list[float] | None = parameter(
        None, "axis of the intermediate frame; the tool's if left out", **DIRECTION
    )

    def rules(self) -> Rules:
        """Axes have a length."""
        yield is_direction(self.n_WT), "n_WT", "a direction"
        yield self.n_WI is None or is_direction(self.n_WI), "n_WI", "a direction"

    def target(self) -> ToolTarget:
        """The pose as the blocks take it."""
        n_WI = self.n_WT if self.n_WI is None else self.n_WI
        return ToolTarget(vector(self.p_WT), vector(self.n_WT), vector(n_WI))


@dataclass
class CircleParams:
    """A circle of the tip about a fixed tool axis."""

    p_WC: list[float] = parameter([0.0, 0.0, 0.045], "its centre", "m", **PLACE)
    n_WT: list[float] = parameter(
        [0.0, 0.0, 1.0], "tool axis, and the circle's", **DIRECTION
    )
    radius: float = parameter(0.01, "of the circle", "m", above=0.0, most=0.2)
    period: float = parameter(4.0, "of one turn", "s", least=0.1, most=1e3)
    ramp: float = parameter(1.0, "time to get up to speed", "s", least=0.01, most=100.0)
    # It spreads the bend over all three modules.
    lean: float = parameter(
        0.3,
        "by which the intermediate axis leans outwards",
        "rad",
        least=-math.pi,
        most=math.pi,
    )

    def rules(self) -> Rules:
        """An axis has a length."""
        yield is_direction(self.n_WT), "n_WT", "a direction"


BEND: dict[str, Any] = {"least": -math.pi / 4, "most": math.pi / 4}


@dataclass
class ScanParams:
    """Rings of the last module, ever wider, while the others stand bent."""

    first: float = parameter(0.35, "bend of module 1's balls", "rad", **BEND)
    second: float = parameter(0.26, "of module 2's", "rad", **BEND)
    least: float = parameter(0.14, "of the last's, in the first ring", "rad", **BEND)
    most: float = parameter(0.66, "in the last ring", "rad", **BEND)
    rings: int = parameter(5, "their number", least=2, most=100)


@dataclass
class SwingParams:
    """All modules bend in one plane, to one side and the other."""

    bends: list[float] = parameter(
        [0.7, 0.7, 0.7],
        "of the modules' balls at either end",
        "rad",
        **BEND,
        shape=(3,),
    )
    azimuth: float = parameter(
        0.0, "of the plane", "rad", least=-2 * math.pi, most=2 * math.pi
    )


WAYS = ("circle", "scan", "swing")


@dataclass
class TipReferenceParams:
    """Parameters of `TipReference`."""

    way: str = parameter(
        "circle",
        "circle; or scan or swing, in the circle's period and ramp",
        choices=WAYS,
    )

    poses: list[PoseParams] = parameter(
        [], "poses, in turn and again; none for the way", shape=(-1,)
    )
    dwell: float = parameter(
        2.0, "time from one pose to the next", "s", least=0.1, most=1e3
    )
    circle: CircleParams = part(CircleParams)
    scan: ScanParams = part(ScanParams)
    swing: SwingParams = part(SwingParams)
    lead: float = parameter(
        0.02, "how far ahead of time `target` is", "s", least=0.0, most=1.0
    )


def turned(circle: CircleParams, time: float) -> float:
    """How far a circle has turned at a time in s, in rad; it is at rest before 0."""
    time = max(time, 0.0)
    ramp = circle.ramp
    turns = time * time / (2 * ramp) if time < ramp else time - ramp / 2
    return 2 * math.pi * turns / circle.period


def circle_target(circle: CircleParams, time: float) -> ToolTarget:
    """The pose on the circle at a time in s."""
    angle = turned(circle, time)
    n = unit(vector(circle.n_WT))
    # Two axes across n: the world's x as far as it goes, or y.
    u = unit(across((1.0, 0.0, 0.0) if abs(n[0]) < 0.9 else (0.0, 1.0, 0.0), n))
    r = plus(scaled(math.cos(angle), u), scaled(math.sin(angle), cross(n, u)))
    leaning = plus(scaled(math.cos(circle.lean), n), scaled(math.sin(circle.lean), r))
    return ToolTarget(along(vector(circle.p_WC), circle.radius, r), n, leaning)


def bends_at(params: TipReferenceParams, time: float) -> list[float]:
    """The bends of a scan or a swing, as the paper writes them, (7,)."""
    angle = turned(params.circle, time)
    if params.way == "swing":
        swing = params.swing
        sine = math.sin(angle)
        return [0.0] + [
            value for bend in swing.bends for value in (swing.azimuth, sine * bend)
        ]
    scan = params.scan
    # The first ring is bent to, in its first half turn; then it widens ring by ring.
    share = min(angle / (2 * math.pi) / (scan.rings - 1), 1.0)
    bend = scan.least + share * (scan.most - scan.least)
    bend *= 0.5 - 0.5 * math.cos(min(angle, math.pi))
    return [0.0, 0.0, scan.first, 0.0, scan.second, angle, bend]


def reference(
    params: TipReferenceParams, time: float, snake: SnakeParams | None = None
) -> ToolTarget:
    """The pose at a time in s; a scan's and a swing's is that of a snake."""
    if not params.poses and params.way == "circle":
        return circle_target(params.circle, time)
    if not params.poses:
        p, x = snake or SnakeParams(), posture_of(bends_at(params, time))
        return target_of(x, p.half_pitch, p.tool_offset)
    # An instant that rounding puts just before a change belongs after it.
    index = int(max(time, 0.0) / params.dwell + 1e-9)
    return params.poses[index % len(params.poses)].target()


class TipReference(Block):
    """The tool poses that the snake is to take.

    Port ``target`` emits the `ToolTarget`, ``lead`` ahead of time, as what is commanded
    now is reached a period later.
    Port ``reference`` emits the `ToolPose` of this instant.
    """

    def __init__(
        self,
        params: TipReferenceParams | None = None,
        snake: SnakeParams | None = None,
    ) -> None:
        """Makes the block, for a snake whose scan or swing it may be."""
        super().__init__()
        self._params = check(params or TipReferenceParams())
        self._snake = check(snake or SnakeParams())
        ticket = {self.time_ticket()}
        self.signal_out("target", ToolTarget, self._calc_target, ticket)
        self.signal_out("reference", ToolPose, self._calc_reference, ticket)

    def _calc_target(self, context: Any) -> np.ndarray:
        time = context.get_time() + self._params.lead
        target = reference(self._params, time, self._snake)
        return np.array((*target.p, *target.n, *target.n_I))

    def _calc_reference(self, context: Any) -> np.ndarray:
        target = reference(self._params, context.get_time(), self._snake)
        return np.array((*target.p, *target.n))
