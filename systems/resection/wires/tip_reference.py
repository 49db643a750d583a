"""Tip reference: where the tool is to be, poses one after another or a circle."""

from collections.abc import Sequence
from dataclasses import dataclass
import math
from typing import Any

from systems.common.block import Block
from systems.common.parameter import Rules, check, parameter, part

PLACE: dict[str, Any] = {"least": -0.5, "most": 0.5, "shape": (3,)}
DIRECTION: dict[str, Any] = {"least": -1e3, "most": 1e3, "shape": (3,)}


def is_direction(n: Sequence[float]) -> bool:
    """Whether a vector is long enough to have a direction."""
    return math.hypot(*n) >= 1e-9


@dataclass
class ToolPose:
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

    def vector(self) -> list[float]:
        """p_WT, n_WT, n_WI (9)."""
        return [*self.p_WT, *self.n_WT, *(self.n_WI or self.n_WT)]


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


@dataclass
class TipReferenceParams:
    """Parameters of `TipReference`."""

    poses: list[ToolPose] = parameter(
        [], "poses, in turn and again; none for the circle", shape=(-1,)
    )
    dwell: float = parameter(
        2.0, "time from one pose to the next", "s", least=0.1, most=1e3
    )
    circle: CircleParams = part(CircleParams)
    lead: float = parameter(
        0.02, "how far ahead of time `target` is", "s", least=0.0, most=1.0
    )


def circle_pose(circle: CircleParams, time: float) -> list[float]:
    """p_WT, n_WT, n_WI (9) on the circle at a time in s, at rest before 0."""
    time = max(time, 0.0)
    ramp = circle.ramp
    turns = time * time / (2 * ramp) if time < ramp else time - ramp / 2
    angle = 2 * math.pi * turns / circle.period
    nx, ny, nz = (x / math.hypot(*circle.n_WT) for x in circle.n_WT)
    # Two axes across n: the world's x as far as it goes, or y.
    ux, uy, uz = (1.0, 0.0, 0.0) if abs(nx) < 0.9 else (0.0, 1.0, 0.0)
    along = ux * nx + uy * ny + uz * nz
    ux, uy, uz = ux - along * nx, uy - along * ny, uz - along * nz
    size = math.hypot(ux, uy, uz)
    ux, uy, uz = ux / size, uy / size, uz / size
    vx, vy, vz = ny * uz - nz * uy, nz * ux - nx * uz, nx * uy - ny * ux
    c, s = math.cos(angle), math.sin(angle)
    rx, ry, rz = c * ux + s * vx, c * uy + s * vy, c * uz + s * vz
    cl, sl = math.cos(circle.lean), math.sin(circle.lean)
    x, y, z = circle.p_WC
    return [
        *(x + circle.radius * rx, y + circle.radius * ry, z + circle.radius * rz),
        *(nx, ny, nz),
        *(cl * nx + sl * rx, cl * ny + sl * ry, cl * nz + sl * rz),
    ]


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
        self._params = check(params or TipReferenceParams())
        self.vector_out("target", 9, self._calc_target, {self.time_ticket()})
        self.vector_out("reference", 6, self._calc_reference, {self.time_ticket()})

    def _calc_target(self, context: Any) -> Sequence[float]:
        return reference(self._params, context.get_time() + self._params.lead)

    def _calc_reference(self, context: Any) -> Sequence[float]:
        return reference(self._params, context.get_time())[:6]
