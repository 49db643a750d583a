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
from systems.common.parameter import ParameterError, Rules, check, parameter

ENTRY, ELEMENTARY, VOLUME = "entry", "elementary", "volume"
KINDS = (ENTRY, ELEMENTARY, VOLUME)


@dataclass
class Tool:
    """A tool: the ball that its rotating wire ring sweeps."""

    radius: float = parameter(4.0e-3, "of the ball", "m", above=0.0, most=0.02)
    offset: float = parameter(
        3.0e-3, "from O3 to its centre", "m", least=0.0, most=0.05
    )


@dataclass
class Procedure:
    """A procedure in the channel frame W."""

    kind: str = parameter(ENTRY, "who places it, and how long it is", choices=KINDS)
    # An entry starts in the channel.
    position: list[float] | None = parameter(
        None,
        "where the tool is when it starts, last module straight",
        "m",
        least=-0.5,
        most=0.5,
        shape=(3,),
    )
    direction: list[float] | None = parameter(
        None,
        "its axis; an entry's is that of the channel",
        least=-1e3,
        most=1e3,
        shape=(3,),
    )
    length: float = parameter(
        0.010,
        "how far it goes along the axis; 0 for an elementary volume",
        "m",
        least=0.0,
        most=0.5,
    )
    radius: float = parameter(
        0.008,
        "of what it removes about its axis, tool included",
        "m",
        above=0.0,
        most=0.1,
    )
    clipped: bool = parameter(
        False, "whether poses that fail are left out; the paper's is refused whole"
    )
    pitch: float = parameter(
        2.0e-3,
        "between poses of a ring, rings, and elementary volumes",
        "m",
        least=2e-4,
        most=0.01,
    )
    tool: Tool | None = parameter(None, "the tool; the robot's own if left out")
    name: str = parameter("", "for lists and plots")

    def rules(self) -> Rules:
        """What an entry has and others have not, and the other way round."""
        is_entry = self.kind == ENTRY
        for name in ("position", "direction"):
            expected = "three numbers"
            if is_entry:
                expected = f"none: an entry's {name} is the channel's"
            yield (getattr(self, name) is None) == is_entry, name, expected
        n = self.direction
        yield n is None or math.hypot(*n) >= 1e-9, "direction", "a direction"
        is_long = self.kind == VOLUME and self.length != 0.0
        yield not is_long, "length", "0 for an elementary volume"

    def axis(self) -> np.ndarray:
        """Unit vector along it, (3,)."""
        n = np.array(self.direction if self.direction is not None else (0.0, 0.0, 1.0))
        return n / np.linalg.norm(n)


@dataclass
class ToolChange:
    """A tool that the robot changed to.

    Attributes:
        radius: Of its ball in m.
        time: Visit of the plan from which it carries it.
    """

    radius: float
    time: int


def with_tool(params: SnakeParams, tool: Tool | None) -> SnakeParams:
    """The robot with another tool."""
    if tool is None:
        return params
    changed = {**asdict(params), "tool_radius": tool.radius, "tool_offset": tool.offset}
    return check(SnakeParams(**changed), "tool")


def check_procedure(procedure: Procedure, params: SnakeParams, owner: str = "") -> None:
    """Raises ParameterError for a procedure that makes no sense for a robot.

    Args:
        procedure: The procedure.
        params: The robot.
        owner: The procedure's key; its name or kind if empty.
    """
    owner = owner or procedure.name or procedure.kind
    check(procedure, owner)
    ball = with_tool(params, procedure.tool).tool_radius
    if not procedure.radius >= ball:
        raise ParameterError(
            f"{owner}.radius={procedure.radius} m: expected >= {ball}, the tool's own"
        )


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
