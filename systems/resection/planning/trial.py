"""A procedure carried out in thought, against what is free now."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plants.snake.kinematics import POINTS
from plants.snake.parameters import SnakeParams
from plants.snake.snake_body import OK, Body, body_of, place
from plants.tissue.space import Space, roll_back
from systems.common.signal import vector
from systems.resection.planning.feasibility import (
    NEVER,
    Answer,
    check_jam,
    check_reach,
    explain,
    refused,
    tips_of,
)
from systems.resection.planning.procedure import (
    Procedure,
    check_procedure,
    widest_bend,
    with_tool,
)
from systems.resection.planning.sweep import LIMIT, posture_at, sweep_procedure
from systems.resection.planning.tree import extend, nearest_nodes

STARTS = 24
"""Nodes from which a procedure's start is tried."""


@dataclass
class Trial:
    """What a procedure came to, and how to take it back.

    Attributes:
        answer: Whether it is feasible.
        tips: Where its tool goes if nothing is in the way, in W in m, (n, 3).
        nodes: Nodes of the session's tree before it.
        visits: Visits of its route before it.
    """

    answer: Answer
    tips: NDArray[np.float64]
    nodes: int
    visits: int


@dataclass
class Preview:
    """A procedure as it would go.

    Attributes:
        answer: Whether it is feasible now.
        tips: Where its tool goes if nothing is in the way, in W in m, (n, 3).
        freed: Flat indices of the tumour's voxels that it frees; if it is refused,
            before that.
        posture: The robot where it ends, or comes to a stand, (7,).
    """

    answer: Answer
    tips: NDArray[np.float64]
    freed: NDArray[np.int32]
    posture: NDArray[np.float64]


def try_out(session: Any, procedure: Procedure) -> Trial:
    """Carries a procedure out in a session's tissue and tree; it can be taken back."""
    session.volume.forget_journals()
    session.make_room()
    nodes, visits = int(session.tree.size[0]), int(session.tree.size[1])
    check_procedure(procedure, session.params)
    answer, tips = _carried_out(session, procedure, visits)
    return Trial(answer, tips, nodes, visits)


def _carried_out(
    session: Any, procedure: Procedure, visits: int
) -> tuple[Answer, NDArray[np.float64]]:
    """The answer, and where the tool goes: nowhere if it is refused unseen."""
    params, volume = with_tool(session.params, procedure.tool), session.volume
    body = session.body
    if procedure.tool is not None:
        body = body_of(params, session.clearance, session.accuracy)
    own, start = _in_entry(session, procedure, params)
    clearance = volume.channel - params.body_radius
    refusal = check_jam(
        procedure, clearance, params, session.clearance, session.accuracy
    ) or check_reach(own, start, params)
    if refusal:
        if refusal.where is not None:
            refusal.where = (session.X_WE @ [*refusal.where, 1.0])[:3].tolist()
        return refusal, np.empty((0, 3))
    R_WE, o = session.X_WE[:3, :3], session.X_WE[:3, 3]
    n, s = R_WE @ own.axis(), volume.space()
    x = np.empty(7)
    O2 = R_WE @ start + o - (params.straight_module + params.tool_offset) * n
    tips = tips_of(own, start, params) @ R_WE.T + o
    start = R_WE @ start + o
    axis = vector(n)
    status = posture_at(body, vector(O2), axis, x)
    if status == OK:
        status = _approach(session, s, body, x)
    if status == OK:
        status = sweep_procedure(
            s,
            body,
            session.tree,
            axis,
            procedure.length,
            procedure.pitch,
            widest_bend(procedure, params),
            procedure.pitch,
            not procedure.clipped,
            session.why,
        )
    poses = int(session.tree.size[1]) - visits
    gained = int(volume.space().used[0]) * volume.voxel
    if status != OK:
        answer = explain(
            volume, status, session.why, tips, params.tool_radius, body.face
        )
        answer.poses = poses
    elif procedure.clipped and gained == 0.0:
        answer = refused(NEVER, start, 0.0, "nothing of it can be reached, or is left")
    else:
        text = f"feasible: removes {1e9 * gained:.0f} mm3 in {poses} poses"
        answer = Answer(True, text=text, gained=gained, poses=poses)
    return answer, tips


def _in_entry(
    session: Any, procedure: Procedure, params: SnakeParams
) -> tuple[Procedure, NDArray[np.float64]]:
    """A procedure as the entry's frame has it, and where its tool starts there."""
    if procedure.position is None or procedure.direction is None:
        depth = session.volume.depth
        return procedure, np.array([0.0, 0.0, depth - params.tool_radius])
    X_EW = np.linalg.inv(session.X_WE)
    start = X_EW[:3, :3] @ np.array(procedure.position) + X_EW[:3, 3]
    axis = X_EW[:3, :3] @ np.array(procedure.direction)
    own = replace(procedure, position=start.tolist(), direction=axis.tolist())
    return own, start


def _approach(session: Any, s: Space, body: Body, x: NDArray[np.float64]) -> int:
    """Drives to a posture from the nearest node that has a free way to it."""
    tree, why, c = session.tree, session.why, np.empty((POINTS, 3))
    place(body, x, c)
    found, far = np.empty(STARTS, np.int64), np.empty(STARTS)
    nearest_nodes(tree, vector(c[7]), found, far)
    blamed, best, status = None, -1.0, LIMIT
    for node in [int(tree.size[2]), *found[found >= 0].tolist()]:
        freed, roomed = int(s.used[0]), int(s.used[1])
        new = extend(s, body, tree, int(node), x, why)
        if new >= 0:
            return OK
        roll_back(s, freed, roomed)
        # The culprit of the attempt that came nearest to the goal is named.
        near = -float(np.linalg.norm(why[1:4] - c[7]))
        if blamed is None or near > best:
            blamed, best, status = why.copy(), near, -new
    if blamed is not None:
        why[:] = blamed
    return status
