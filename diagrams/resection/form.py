"""A procedure as sliders have it, and as a line of the console."""

from dataclasses import asdict, dataclass, replace
import math
from typing import Any

import numpy as np

from diagrams.resection.console import procedure_from
from plants.snake.parameters import SnakeParams
from plants.tissue.labels import TUMOUR
from plants.tissue.volume import Volume
from systems.resection.planning.entry import radius_of
from systems.resection.planning.procedure import ELEMENTARY, ENTRY, KINDS, Procedure


@dataclass(frozen=True)
class Form:
    """Lengths in mm, angles in degrees: where a procedure is, and how large.

    Attributes:
        kind: One of KINDS.
        x: Of where the tool starts, in W.
        y: The same.
        z: The same.
        tilt: Of the axis, from the channel's.
        turn: Of the axis about the channel's, from x.
        length: Along the axis.
        radius: About it, tool included.
        clipped: Whether poses that fail are left out.
    """

    kind: str = ENTRY
    x: float = 0.0
    y: float = 0.0
    z: float = 10.0
    tilt: float = 0.0
    turn: float = 0.0
    length: float = 10.0
    radius: float = 6.0
    clipped: bool = True

    def line(self) -> str:
        """What proposes it in the console."""
        words: list[Any] = [self.kind]
        if self.kind != ENTRY:
            n = axis(self.tilt, self.turn)
            words += [self.x, self.y, self.z, *(round(float(v), 6) + 0.0 for v in n)]
        if self.kind in (ENTRY, ELEMENTARY):
            words.append(self.length)
        words.append(self.radius)
        shown = [w if isinstance(w, str) else f"{w:.10g}" for w in words]
        return " ".join(shown + ["clipped"] * self.clipped)

    def procedure(self) -> Procedure:
        """The procedure that the line proposes."""
        return procedure_from(self.line().split())

    def at(self, p_W: Any) -> "Form":
        """The same elsewhere; a point in m."""
        x, y, z = (round(1e3 * float(v), 1) + 0.0 for v in p_W)
        return replace(self, x=x, y=y, z=z)

    @property
    def p_W(self) -> np.ndarray:
        """Where the tool starts, in m, (3,)."""
        return 1e-3 * np.array([self.x, self.y, self.z])

    def moved(self, told: Any) -> "Form":
        """The same with what a page tells.

        Raises:
            ValueError: If it tells anything but finite numbers, words and truths.
        """
        plain = asdict(self)
        if not isinstance(told, dict) or not set(told) <= set(plain):
            raise ValueError(f"{told!r}: expected some of {', '.join(plain)}")
        for name, value in told.items():
            before = plain[name]
            if isinstance(before, float) and type(value) is int:
                value = float(value)
            good = type(value) is type(before) and (
                value in KINDS if name == "kind" else abs(value) < 1e4
            )
            if not good:
                raise ValueError(f"{name}={value!r}: expected such as {before!r}")
            plain[name] = value
        return Form(**plain)


def axis(tilt: float, turn: float) -> np.ndarray:
    """Unit vector of an axis by its angles in degrees, (3,)."""
    a, b = math.radians(turn), math.radians(tilt)
    return np.array([math.sin(b) * math.cos(a), math.sin(b) * math.sin(a), math.cos(b)])


def form_of(procedure: Procedure, form: Form) -> Form:
    """The form of a procedure; what it does not tell is as in another form."""
    n = procedure.axis()
    if procedure.position is not None:
        form = replace(
            form.at(procedure.position),
            tilt=round(math.degrees(math.acos(min(max(n[2], -1.0), 1.0))), 1),
            turn=round(math.degrees(math.atan2(n[1], n[0])), 1) + 0.0,
        )
    return replace(
        form,
        kind=procedure.kind,
        length=round(1e3 * procedure.length, 1),
        radius=round(1e3 * procedure.radius, 1),
        clipped=procedure.clipped,
    )


def bounds(volume: Volume, params: SnakeParams) -> dict[str, tuple[float, ...]]:
    """Of each slider the least, the most, and the step."""
    points = 1e3 * volume.points(volume.labels == TUMOUR)
    low, high = np.floor(points.min(axis=0)), np.ceil(points.max(axis=0))
    widest = 1e3 * radius_of(params.max_bend, params)
    return {
        "x": (float(low[0]), float(high[0]), 0.5),
        "y": (float(low[1]), float(high[1]), 0.5),
        "z": (float(low[2]), float(high[2]), 0.5),
        "tilt": (0.0, 90.0, 1.0),
        "turn": (-180.0, 180.0, 1.0),
        "length": (0.0, float(high[2] - low[2]), 0.5),
        "radius": (1e3 * params.tool_radius, math.floor(10 * widest) / 10, 0.1),
    }
