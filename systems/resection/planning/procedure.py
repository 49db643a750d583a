"""Procedures: what the surgeon chooses (paper, V.B).

All have one shape, a stretch of elementary volumes along an axis. They differ in
who places them: the entry procedure lies along the channel, the elementary one
anywhere, and an elementary volume has no length.
"""

from dataclasses import asdict, dataclass
import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from plants.snake.last_module import bend_for_radius
from plants.snake.parameters import SnakeParams

ENTRY, ELEMENTARY, VOLUME = "entry", "elementary", "volume"
KINDS = (ENTRY, ELEMENTARY, VOLUME)


@dataclass
class Tool:
    """A tool: the ball that its rotating wire ring sweeps.

    Attributes:
        radius: Of the ball in m.
        offset: From O3 to its centre in m.
    """

    radius: float = 4.0e-3
    offset: float = 3.0e-3


@dataclass
class Procedure:
    """A procedure in the channel frame W.

    Attributes:
        kind: "entry", "elementary" or "volume".
        position: Where the tool is when it starts, last module straight, in m. An
            entry starts in the channel.
        direction: Its axis; an entry's is that of the channel.
        length: How far it goes along the axis, in m; 0 for an elementary volume.
        radius: Of what it removes about its axis, tool included, in m.
        clipped: Whether poses that fail are left out; the paper's is refused whole.
        pitch: Between poses of a ring, rings, and elementary volumes, in m.
        tool: The tool; the robot's own if None.
        name: For lists and plots.
    """

    kind: str = ENTRY
    position: list[float] | None = None
    direction: list[float] | None = None
    length: float = 0.010
    radius: float = 0.008
    clipped: bool = False
    pitch: float = 2.0e-3
    tool: Tool | None = None
    name: str = ""

    def check(self, params: SnakeParams) -> None:
        """Raises ValueError for a value that makes no sense for a robot."""
        name = self.name or self.kind
        if self.kind not in KINDS:
            raise ValueError(f"{name}: kind={self.kind!r}, choose from {KINDS}")
        for key in ("position", "direction"):
            v = getattr(self, key)
            if self.kind == ENTRY:
                if v is not None:
                    raise ValueError(f"{name}: an entry's {key} is the channel's")
            elif v is None or len(v) != 3 or not all(map(math.isfinite, v)):
                raise ValueError(f"{name}: {key}={v}, expected three finite numbers")
        if self.direction is not None and math.hypot(*self.direction) < 1e-9:
            raise ValueError(f"{name}: direction={self.direction} is no direction")
        if not (math.isfinite(self.length) and self.length >= 0.0):
            raise ValueError(f"{name}: length={self.length} m, expected >= 0")
        if self.kind == VOLUME and self.length != 0.0:
            raise ValueError(f"{name}: an elementary volume's length is 0")
        if not 2e-4 <= self.pitch <= 0.01:
            raise ValueError(f"{name}: pitch={self.pitch} m, expected 0.0002 to 0.01")
        ball = with_tool(params, self.tool).tool_radius
        if not self.radius >= ball:
            raise ValueError(
                f"{name}: radius={self.radius} m is less than the tool's own {ball} m"
            )

    def axis(self) -> np.ndarray:
        """Unit vector along it, (3,)."""
        n = np.array(self.direction if self.direction is not None else (0.0, 0.0, 1.0))
        return n / np.linalg.norm(n)


def with_tool(params: SnakeParams, tool: Tool | None) -> SnakeParams:
    """The robot with another tool."""
    if tool is None:
        return params
    changed = {**asdict(params), "tool_radius": tool.radius, "tool_offset": tool.offset}
    return SnakeParams(**changed).check()


def widest_bend(procedure: Procedure, params: SnakeParams) -> float:
    """Largest bend of the last module in rad.

    Raises:
        ValueError: If the procedure is wider than the last module reaches.
    """
    return bend_for_radius(procedure.radius - params.tool_radius, params)


def save_procedures(procedures: list[Procedure], path: Path) -> None:
    """Writes procedures as JSON."""
    path.write_text(json.dumps([asdict(p) for p in procedures], indent=1) + "\n")


def load_procedures(path: Path) -> list[Procedure]:
    """Reads procedures from JSON.

    Raises:
        ValueError: If the file does not hold procedures.
    """
    try:
        rows = json.loads(path.read_text())
        return [procedure_of(row) for row in rows]
    except (OSError, TypeError, json.JSONDecodeError) as error:
        raise ValueError(f"{path} holds no procedures: {error}") from error


def procedure_of(row: dict[str, Any]) -> Procedure:
    """A procedure from plain data."""
    tool = row.get("tool")
    return Procedure(**{**row, "tool": Tool(**tool) if tool else None})
