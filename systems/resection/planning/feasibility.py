"""Which procedures are feasible now, and what is in the way of the others.

The whole body, not the tool alone, has to stay in space that is free already or that
the tool frees ahead of it in the same procedure. Every pose is driven to from the
one before, in thought; then all is taken back.
"""

from dataclasses import dataclass
import math
from typing import Any

import numpy as np

from plants.snake.inverse_kinematics import positioning
from plants.snake.last_module import meridian
from plants.snake.parameters import SnakeParams
from plants.snake.reachability import refusal
from plants.snake.snake_body import BODY, PLATE, TOOL
from plants.tissue.labels import CAP, CHANNEL, CRITICAL, TUMOUR
from plants.tissue.space import OUTSIDE, nearest_in_ball
from plants.tissue.volume import Volume
from systems.resection.planning.entry_law import least_clearance
from systems.resection.planning.procedure import ENTRY, Procedure, widest_bend

TOOL_OUTSIDE = "tool outside"
NEVER = "never freed"
TOO_LATE = "freed too late"
IN_BRAIN = "brain"
WALL = "channel wall"
NEAR_CRITICAL = "critical"
LIMIT = "limit"
JAM = "jam"
REASONS = (TOOL_OUTSIDE, NEVER, TOO_LATE, IN_BRAIN, WALL, NEAR_CRITICAL, LIMIT, JAM)

PARTS = (
    "the shaft in the channel",
    "module 1",
    "module 1 to 2",
    "module 2",
    "module 2 to 3",
    "module 3",
    "the last plate",
    "the tool's shank",
    "the tool",
)


@dataclass
class Answer:
    """What the system says of a procedure.

    Attributes:
        feasible: Whether it can be carried out now.
        reason: One of REASONS, "" if feasible.
        where: The first point in the way, in W in m, (3,); None if there is none.
        gap: By how much it is in the way, in m (rad for a bend).
        text: The answer as a sentence.
        gained: Tumour that it would remove, in m3.
        healthy: Healthy tissue that it would touch, in m3.
        poses: How many poses it has (those before the first that fails).
    """

    feasible: bool
    reason: str = ""
    where: list[float] | None = None
    gap: float = 0.0
    text: str = ""
    gained: float = 0.0
    healthy: float = 0.0
    poses: int = 0


def refused(reason: str, where: Any, gap: float, text: str) -> Answer:
    """An answer that refuses."""
    point = None if where is None else [float(x) for x in where]
    return Answer(False, reason, point, float(gap), text)


def place(p: Any) -> str:
    """A point as text."""
    return "(" + ", ".join(f"{1e3 * x:.1f}" for x in p) + ") mm"


def volume_starts(procedure: Procedure, start: np.ndarray) -> np.ndarray:
    """Where the tool is at each elementary volume, last module straight, (n, 3)."""
    count = math.ceil(procedure.length / procedure.pitch - 1e-9) + 1
    along = np.linspace(0.0, procedure.length, count)
    return start + along[:, None] * procedure.axis()


def intermediate_positions(
    procedure: Procedure, start: np.ndarray, params: SnakeParams
) -> np.ndarray:
    """O2 at each elementary volume in W, (n, 3)."""
    ahead = params.straight_module + params.tool_offset
    return volume_starts(procedure, start) - ahead * procedure.axis()


def check_reach(
    procedure: Procedure, start: np.ndarray, params: SnakeParams
) -> Answer | None:
    """Refuses a procedure beyond the robot's limits: bends, travel.

    Wire strokes follow the bends: the drums have the length for every posture.

    Args:
        procedure: The procedure.
        start: Where the tool starts, (3,).
        params: The robot with the procedure's tool.
    """
    try:
        widest_bend(procedure, params)
    except ValueError as error:
        widest = float(meridian(params.max_bend, params)[0]) + params.tool_radius
        return refused(LIMIT, start, procedure.radius - widest, str(error))
    n, O2 = procedure.axis(), intermediate_positions(procedure, start, params)
    answers = positioning(O2, n, params)
    if answers.reached.all():
        return None
    first = int(np.argmin(answers.reached))
    why = refusal(O2[first], n, params)
    gap = max(why.gap, why.tilt_gap) if why else 0.0
    return refused(LIMIT, O2[first], gap, f"intermediate pose {why}")


def check_jam(
    procedure: Procedure,
    clearance: float,
    params: SnakeParams,
    kept: float = 0.0,
    accuracy: float = 0.0,
) -> Answer | None:
    """Refuses an entry that narrows until the robot jams (`entry_law`).

    Args:
        procedure: The procedure.
        clearance: Of the channel, in m.
        params: The robot with the procedure's tool.
        kept: Clearance that the plan keeps between body and tissue, in m.
        accuracy: By which it takes the tool for smaller, in m.
    """
    if procedure.kind != ENTRY:
        return None
    needed = least_clearance(params, kept, accuracy)
    if needed == 0.0 or clearance > needed:
        return None
    text = (
        f"with a tool of {1e3 * params.tool_radius:g} mm radius at "
        f"{1e3 * params.tool_offset:g} mm each hole is narrower than the one before "
        f"unless the channel's clearance exceeds {1e3 * needed:.2f} mm; it is "
        f"{1e3 * clearance:.2f} mm"
    )
    return refused(JAM, [0.0, 0.0, 0.0], needed - clearance, text)


def tips_of(procedure: Procedure, start: np.ndarray, params: SnakeParams) -> np.ndarray:
    """Where the tool goes in a rigid procedure, poses apart by its pitch, (n, 3)."""
    n = procedure.axis()
    e = np.cross(n, [1.0, 0.0, 0.0] if abs(n[0]) < 0.7 else [0.0, 1.0, 0.0])
    e /= np.linalg.norm(e)
    f = np.cross(n, e)
    O2 = intermediate_positions(procedure, start, params)
    r, z = meridian(np.linspace(0.0, widest_bend(procedure, params), 24), params)
    turn = np.linspace(0.0, 2 * np.pi, 48, endpoint=False)
    ring = np.cos(turn)[:, None] * e + np.sin(turn)[:, None] * f
    dome = r[:, None, None] * ring + z[:, None, None] * n
    return (O2[:, None, :] + dome.reshape(-1, 3)).reshape(-1, 3)


def plate_gap(p: np.ndarray, why: np.ndarray, face: float) -> float:
    """How deep a point lies in the last plate, a cylinder, in m.

    Args:
        p: The point in W, (3,).
        why: The culprit as `snake_body.check_body` leaves it, (9,).
        face: Length of the cylinder in m.
    """
    away, n = p - why[1:4], why[6:9]
    along = float(away @ n)
    across = float(np.linalg.norm(away - along * n))
    return max(min(float(why[4]) - across, face / 2 - abs(along)), 0.0)


def explain(
    volume: Volume,
    status: int,
    why: np.ndarray,
    tips: np.ndarray,
    tool_radius: float,
    face: float,
) -> Answer:
    """Names what a pose that failed met first.

    Args:
        volume: The volume as it was at that pose.
        status: BODY, TOOL or a limit.
        why: The culprit as `snake_body.drive` leaves it, (9,).
        tips: Where the tool of the whole procedure goes, (n, 3).
        tool_radius: In m.
        face: Length of the last plate with its half module, in m.
    """
    if status not in (BODY, TOOL):
        return refused(LIMIT, why[1:4], 0.0, f"beyond a limit at {place(why[1:4])}")
    part = PARTS[int(why[0])]
    voxel, distance = nearest_in_ball(volume.space(), status == TOOL, why[1:4], why[4])
    at = int(voxel) if voxel != OUTSIDE else int(why[5])
    gap = max(float(why[4]) - distance, 0.0) if math.isfinite(distance) else 0.0
    if int(why[0]) == PLATE:
        at = int(why[5])
        gap = plate_gap(volume.centre_of(at), why, face) if at >= 0 else gap
    where = volume.centre_of(at) if at >= 0 else why[1:4]
    if at < 0 and where[2] <= volume.depth:
        gap = math.hypot(where[0], where[1]) + float(why[4]) - volume.channel
    label = int(volume.labels.reshape(-1)[at]) if at >= 0 else -1
    forbidden = at >= 0 and not volume.allowed.reshape(-1)[at]
    in_wall = where[2] <= volume.depth and math.hypot(where[0], where[1]) < 1.6 * (
        volume.channel
    )
    if label == CRITICAL or (forbidden and label in (TUMOUR, CHANNEL, CAP)):
        reason, text = NEAR_CRITICAL, "comes too near to what is critical"
    elif status == TOOL:
        reason, text = TOOL_OUTSIDE, "leaves the tumour"
    elif label == TUMOUR:
        near = ((tips - where) ** 2).sum(axis=1).min() if len(tips) else math.inf
        if near <= tool_radius**2:
            reason, text = TOO_LATE, "meets tissue that is only removed later"
        else:
            reason, text = NEVER, "meets tumour that is not removed"
    elif in_wall:
        reason, text = WALL, "meets the wall of the channel"
    else:
        reason, text = IN_BRAIN, "meets the brain"
    return refused(
        reason, where, gap, f"{part} {text} at {place(where)}, by {1e3 * gap:.2f} mm"
    )
