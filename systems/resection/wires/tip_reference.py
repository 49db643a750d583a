"""Tip reference: where the tool is to be, poses one after another or a circle."""

from collections.abc import Sequence
from dataclasses import dataclass, field
import math
from typing import Any

from plants.snake.kinematics import turned
from systems.common.block import Block
from systems.common.geometry import along, cross, dot, unit


@dataclass
class ToolPose:
    """A tool pose in the channel frame W, with the redundant freedoms.

    Attributes:
        p_WT: Position of the tool in m.
        n_WT: Its axis.
        n_WI: Axis of the intermediate frame; that of the tool if None.
    """

    p_WT: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0414])
    n_WT: list[float] = field(default_factory=lambda: [0.0, 0.0, 1.0])
    n_WI: list[float] | None = None

    def vector(self) -> list[float]:
        """p_WT, n_WT, n_WI (9)."""
        return [*self.p_WT, *self.n_WT, *(self.n_WI or self.n_WT)]


@dataclass
class CircleParams:
    """A circle of the tip about a fixed tool axis.

    Attributes:
        p_WC: Centre in m.
        n_WT: Tool axis, and the circle's axis.
        radius: In m.
        period: Of one turn, in s.
        ramp: Time to get up to speed, in s.
        lean: Angle in rad by which the intermediate axis leans outwards: it
            spreads the bend over all three modules.
    """

    p_WC: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.045])
    n_WT: list[float] = field(default_factory=lambda: [0.0, 0.0, 1.0])
    radius: float = 0.01
    period: float = 4.0
    ramp: float = 1.0
    lean: float = 0.3


@dataclass
class TipReferenceParams:
    """Parameters of `TipReference`.

    Attributes:
        poses: Poses, in turn and again; empty for the circle.
        dwell: Time from one pose to the next, in s.
        circle: The circle.
        lead: How far ahead of time ``target`` is, in s.
    """

    poses: list[ToolPose] = field(default_factory=list)
    dwell: float = 2.0
    circle: CircleParams = field(default_factory=CircleParams)
    lead: float = 0.02

    def check(self) -> None:
        """Raises ValueError for a value that makes no sense."""
        for name, value in (
            ("dwell", self.dwell),
            ("circle.radius", self.circle.radius),
            ("circle.period", self.circle.period),
            ("circle.ramp", self.circle.ramp),
        ):
            if not (math.isfinite(value) and value > 0.0):
                raise ValueError(f"tip_reference.{name}={value}: expected > 0")
        if not self.lead >= 0.0:
            raise ValueError(f"tip_reference.lead={self.lead} s: expected >= 0")
        axes = {"circle.p_WC": self.circle.p_WC, "circle.n_WT": self.circle.n_WT}
        for i, pose in enumerate(self.poses):
            axes[f"poses[{i}].p_WT"] = pose.p_WT
            axes[f"poses[{i}].n_WT"] = pose.n_WT
            axes[f"poses[{i}].n_WI"] = pose.n_WI or pose.n_WT
        for name, axis in axes.items():
            if len(axis) != 3 or not all(map(math.isfinite, axis)):
                raise ValueError(
                    f"tip_reference.{name}={axis}: expected three finite numbers"
                )
            if "n_W" in name and math.hypot(*axis) < 1e-9:
                raise ValueError(f"tip_reference.{name}={axis}: expected a direction")


def circle_pose(circle: CircleParams, time: float) -> list[float]:
    """p_WT, n_WT, n_WI (9) on the circle at a time in s, at rest before 0."""
    time = max(time, 0.0)
    ramp = circle.ramp
    turns = time * time / (2 * ramp) if time < ramp else time - ramp / 2
    angle = 2 * math.pi * turns / circle.period
    n = unit(tuple(circle.n_WT))
    # Two axes across n: the world's x as far as it goes, or y.
    x = (1.0, 0.0, 0.0) if abs(n[0]) < 0.9 else (0.0, 1.0, 0.0)
    u = unit(along(x, -dot(x, n), n))
    out, _ = turned(u, cross(n, u), math.cos(angle), math.sin(angle))
    n_WI, _ = turned(n, out, math.cos(circle.lean), math.sin(circle.lean))
    return [*along(tuple(circle.p_WC), circle.radius, out), *n, *n_WI]


def reference(params: TipReferenceParams, time: float) -> list[float]:
    """p_WT, n_WT, n_WI (9) at a time in s."""
    if not params.poses:
        return circle_pose(params.circle, time)
    # An instant that rounding puts just before a change belongs after it.
    index = int(max(time, 0.0) / params.dwell + 1e-9)
    return params.poses[index % len(params.poses)].vector()


class TipReference(Block):
    """The tool poses that the snake is to take.

    Port ``target`` emits p_WT [m], n_WT and n_WI, channel frame W, ``lead`` ahead of
    time, as what is commanded now is reached a period later (9).

    Port ``reference`` emits p_WT [m] and n_WT for this instant (6).
    """

    def __init__(self, params: TipReferenceParams | None = None) -> None:
        """Makes the block."""
        super().__init__()
        self._params = params or TipReferenceParams()
        self._params.check()
        self.vector_out("target", 9, self._calc_target, {self.time_ticket()})
        self.vector_out("reference", 6, self._calc_reference, {self.time_ticket()})

    def _calc_target(self, context: Any) -> Sequence[float]:
        return reference(self._params, context.get_time() + self._params.lead)

    def _calc_reference(self, context: Any) -> Sequence[float]:
        return reference(self._params, context.get_time())[:6]
