"""What a session's file may say: whoever wrote it, it is held against itself.

A digest tells damage, not nonsense: indices are looked up by compiled code, and what
counts as removed is removed by nothing but the plan.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from plants.tissue.labels import NAMES
from plants.tissue.space import SOLID
from systems.common.archive import Arrays, check_arrays, write_archive

FORMAT = 3
"""Of a session's file; 2: what is critical as the mask has it; 3: several entries."""

ARRAYS: Arrays = {
    "labels": ("u1", ("x", "y", "z")),
    "origin": ("f8", (3,)),
    "X_PW": ("f8", (4, 4)),
    "tau": ("i4", ("x", "y", "z")),
    "x": ("f8", ("nodes", 7)),
    "parent": ("i4", ("nodes",)),
    "depth": ("i4", ("nodes",)),
    "tip": ("f8", ("nodes", 3)),
    "route": ("i4", ("visits",)),
}
"""Of a session: kinds and shapes, equal letters for equal lengths."""
CRITICAL: Arrays = {"critical": ("i8", ("critical", 3)), "X_WV": ("f8", (4, 4))}
"""Likewise, of one whose mask holds what is critical."""


def write_session(session: Any, path: Path) -> None:
    """Writes a session; the file before it is kept as `*.before`."""
    v, t = session.volume, session.tree
    nodes, visits, home = map(int, t.size)
    arrays = {
        "labels": v.labels,
        "origin": v.origin,
        "X_PW": v.X_PW,
        "tau": v.tau,
        "x": t.x[:nodes],
        "parent": t.parent[:nodes],
        "depth": t.depth[:nodes],
        "tip": t.tip[:nodes],
        "route": t.route[:visits],
    }
    if v.critical is not None:
        arrays |= {"critical": v.critical.index, "X_WV": v.critical.X_WV}
    meta = {
        "format": FORMAT,
        "spacing": v.spacing,
        "channel": v.channel,
        "channel_depth": v.depth,
        "margin": v.margin,
        "mask_volume": v.mask_volume,
        "notes": v.notes,
        "clearance": session.clearance,
        "accuracy": session.accuracy,
        "params": asdict(session.own),
        "tools": [asdict(tool) for tool in session.tools],
        "steps": [asdict(step) for step in session.steps],
        "concluded": session.concluded,
        "reached": session.reached,
        "home": home,
        "image": v.image
        and {"sizes": list(map(int, v.image.sizes)), "X_PI": v.image.X_PI.tolist()},
        "more": [
            {"X_WE": c.X_WE.tolist(), "depth": c.depth, "time": c.time} for c in v.more
        ],
    }
    write_archive(path, meta, arrays)


def check_saved(meta: dict[str, Any], arrays: dict[str, Any]) -> None:
    """Holds a session's plain data and arrays against each other.

    Raises:
        ValueError: What is wrong is named.
    """
    check_arrays(arrays, {**ARRAYS, **(CRITICAL if "critical" in arrays else {})})
    labels, tau = arrays["labels"], arrays["tau"]
    nodes, visits = len(arrays["x"]), len(arrays["route"])
    parent, order = arrays["parent"], np.arange(nodes)
    ends = [0, *(step["last"] for step in meta["steps"])]
    begins = [step["first"] for step in meta["steps"]]
    sizes = [step["nodes"] for step in meta["steps"]]
    for what, holds in {
        "a label that there is not": (labels < len(NAMES)).all(),
        "a tree without its root": nodes > 0 and visits > 0,
        "a parent that comes later": ((parent >= -1) & (parent < order)).all(),
        "a home that is no node": 0 <= meta["home"] < nodes,
        "a visit to no node": (
            (arrays["route"] >= 0) & (arrays["route"] < nodes)
        ).all(),
        "an arrival at no visit": ((tau == SOLID) | (tau >= 0) & (tau < visits)).all(),
        "steps that are not its plan's": all(
            end <= first <= last <= visits
            for end, first, last in zip(ends, begins, ends[1:], strict=False)
        ),
        "steps of no nodes": all(0 < size <= nodes for size in sizes),
    }.items():
        if not holds:
            raise ValueError(f"it holds {what}")


def check_removed(session: Any) -> None:
    """Holds what counts as removed against the plan that would have removed it.

    Raises:
        ValueError: If it is not so.
    """
    volume, tips = session.volume, session.tips
    tau, fresh = volume.tau, volume.fresh().tau
    reach = float(session.tool_radii.max()) + volume.spacing
    # What a channel bored, and what a scan found to be free.
    others = [channel.time for channel in volume.more]
    others += [step.first - 1 for step in session.steps if step.kind == "update"]
    planned = (tau > 0) & (tau != SOLID) & ~np.isin(tau, others)
    points, times = volume.points(planned), tau[planned]
    a, b = tips[times - 1], tips[times]
    along = np.einsum("ij,ij->i", points - a, b - a)
    share = along / np.maximum(np.einsum("ij,ij->i", b - a, b - a), 1e-18)
    near = points - a - np.clip(share, 0.0, 1.0)[:, None] * (b - a)
    # A move is straight in the modules' angles: its tool goes along an arc.
    arc = np.linalg.norm(b - a, axis=1) / 2
    is_near = np.einsum("ij,ij->i", near, near) <= (reach + arc) ** 2
    if ((tau == 0) != (fresh == 0)).any() or not is_near.all():
        raise ValueError("it holds tissue as removed that the plan does not reach")
