"""A session resumed from its file."""

from pathlib import Path
from typing import Any

import numpy as np

from plants.snake.parameters import SnakeParams
from plants.tissue.critical import Boxes
from plants.tissue.tissue import Grid
from plants.tissue.volume import Channel, Volume
from systems.common.archive import read_archive, sensible
from systems.resection.planning.procedure import (
    Tool,
    ToolChange,
    procedure_of,
    with_tool,
)
from systems.resection.planning.saved import FORMAT, check_removed, check_saved
from systems.resection.planning.session import ROOM, Session, Step
from systems.resection.planning.tree import tree_of


def load_session(path: Path) -> Session:
    """Resumes a session from its file.

    Raises:
        ValueError: If the file is not there or damaged, and the one before is offered;
            or if what it says makes no sense.
    """
    meta, arrays = read_archive(path, "session", FORMAT)
    with sensible(path, "session"):
        session = _restored(meta, arrays)
    session.file = path
    return session


def _restored(meta: dict[str, Any], arrays: dict[str, Any]) -> Session:
    """The session of a file's plain data and arrays, held against each other."""
    check_saved(meta, arrays)
    volume = Volume(
        arrays["labels"],
        arrays["origin"],
        meta["spacing"],
        meta["channel"],
        meta["channel_depth"],
        arrays["X_PW"],
        meta["margin"],
        arrays["tau"],
        Boxes(arrays["critical"], arrays["X_WV"]) if "critical" in arrays else None,
        mask_volume=meta["mask_volume"],
        notes=meta["notes"],
        image=meta.get("image")
        and Grid(tuple(meta["image"]["sizes"]), np.array(meta["image"]["X_PI"])),
        more=[
            Channel(np.array(row["X_WE"]), row["depth"], row["time"])
            for row in meta["more"]
        ],
    )
    session = Session(
        volume, SnakeParams(**meta["params"]), meta["clearance"], meta["accuracy"]
    )
    session.tree = tree_of(
        arrays["x"],
        arrays["parent"],
        arrays["depth"],
        arrays["tip"],
        arrays["route"],
        meta["home"],
        ROOM,
        ROOM,
    )
    for row in meta.get("tools", ()):
        tool = ToolChange(float(row["radius"]), int(row["time"]))
        with_tool(session.own, Tool(tool.radius, session.own.tool_offset))
        if not 0 < tool.time < len(arrays["route"]):
            raise ValueError(f"a tool at no visit: {tool.time}")
        session.tools.append(tool)
    session.stand()
    for row in meta["steps"]:
        row["procedure"] = row["procedure"] and procedure_of(row["procedure"])
        session.steps.append(Step(**row))
    session.concluded = meta["concluded"]
    session.reached = list(map(float, meta.get("reached", ())))
    check_removed(session)
    return session
