"""A resection as a session: propose, check, preview, commit, undo, save, resume."""

from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from plants.snake.kinematics import POINTS, corners
from plants.snake.parameters import SnakeParams
from plants.snake.snake_body import CULPRIT, OK, Body, body_of
from plants.tissue.critical import Boxes
from plants.tissue.space import Space, roll_back
from plants.tissue.volume import Volume
from systems.common.archive import read_archive, write_archive
from systems.common.parameter import check
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
    ENTRY,
    Procedure,
    check_procedure,
    procedure_of,
    widest_bend,
    with_tool,
)
from systems.resection.planning.sweep import LIMIT, posture_at, sweep_procedure
from systems.resection.planning.tree import (
    Tree,
    extend,
    go_to,
    grown,
    nearest_nodes,
    new_tree,
)

ROOM = 60_000
"""Nodes, and visits, that one step of a session may need."""

FORMAT = 2
"""Of a session's file; from 2 on it holds what is critical as the mask has it."""

STARTS = 24
"""Nodes from which a procedure's start is tried."""


@dataclass
class Step:
    """A part of the plan.

    Attributes:
        name: What it is called.
        kind: "entry", "elementary", "volume", "finish" or "home".
        first: Its first visit in the route.
        last: One past its last visit.
        nodes: Nodes of the tree before it.
        gained: Tumour it removes, in m3.
        procedure: What was asked for, if it was a procedure.
    """

    name: str
    kind: str
    first: int
    last: int
    nodes: int
    gained: float
    procedure: Procedure | None = None


@dataclass
class Session:
    """A resection under way.

    Attributes:
        volume: The tissue.
        params: The robot.
        clearance: That the plan keeps between body and tissue, in m.
        accuracy: To which the robot follows the plan, in m: its tool surely frees
            a ball that is smaller by this.
        steps: What has been committed.
        file: Where every commit is saved; nowhere if None.
        concluded: How a planner went about it that found nothing more to do.
    """

    volume: Volume
    params: SnakeParams
    clearance: float = 0.075e-3
    accuracy: float = 0.025e-3
    steps: list[Step] = field(default_factory=list)
    file: Path | None = None
    concluded: str = ""

    def __post_init__(self) -> None:
        check(self.params)
        self.body: Body = body_of(self.params, self.clearance, self.accuracy)
        self.home = home_posture(self.volume, self.params)
        c = np.empty((POINTS, 3))
        corners(self.home, self.body.h, self.body.tool, c)
        self.tree: Tree = new_tree(self.home, c[7], ROOM, ROOM)
        self.why = np.zeros(CULPRIT)

    # What is asked -----------------------------------------------------------

    def check(self, procedure: Procedure) -> Answer:
        """Whether a procedure is feasible now; nothing changes."""
        answer = self._do(procedure)
        self._take_back(self._mark)
        return answer

    preview = check

    def commit(self, procedure: Procedure) -> Answer:
        """Makes a procedure part of the plan if it is feasible."""
        before = self.standing()
        answer = self._do(procedure)
        if answer.feasible and procedure.tool is not None:
            answer = refused(
                "limit", None, 0.0, "the robot carries another tool: change it first"
            )
        if not answer.feasible:
            self._take_back(self._mark)
            return answer
        self.record(procedure.name or procedure.kind, procedure.kind, before, procedure)
        return answer

    def undo(self) -> Step:
        """Takes back the last step and returns it.

        Raises:
            ValueError: If there is none.
        """
        if not self.steps:
            raise ValueError("there is no step to undo")
        step = self.steps.pop()
        self.concluded = ""
        self.volume.undo(step.first - 1)
        self.tree.size[:] = step.nodes, step.first
        self.save_if_filed()
        return step

    # How it is done ----------------------------------------------------------

    def standing(self) -> tuple[int, int, int]:
        """Nodes, visits and resected voxels: how things stand."""
        return (
            int(self.tree.size[0]),
            int(self.tree.size[1]),
            int(np.count_nonzero(self.volume.resected)),
        )

    def _take_back(self, mark: tuple[int, int, int, int]) -> None:
        roll_back(self.volume.space(), mark[0], mark[1])
        self.tree.size[:] = mark[2:]

    def make_room(self) -> None:
        """Sees to it that a step's nodes fit into the tree."""
        self.tree = grown(self.tree, ROOM, 4 * ROOM)

    def roomy(self) -> bool:
        """Whether a third of that room is left."""
        tree = self.tree
        return bool(tree.size[0] + ROOM // 3 < len(tree.x)) and bool(
            tree.size[1] + 4 * ROOM // 3 < len(tree.route)
        )

    def _do(self, procedure: Procedure) -> Answer:
        """Carries a procedure out in thought; `_mark` is how it was before."""
        self.volume.forget_journals()
        self.make_room()
        self._mark = (0, 0, int(self.tree.size[0]), int(self.tree.size[1]))
        check_procedure(procedure, self.params)
        params = with_tool(self.params, procedure.tool)
        body = self.body
        if procedure.tool is not None:
            body = body_of(params, self.clearance, self.accuracy)
        if procedure.kind == ENTRY:
            start = np.array([0.0, 0.0, self.volume.depth - params.tool_radius])
        else:
            start = np.array(procedure.position, float)
        clearance = self.volume.channel - params.body_radius
        refusal = check_jam(
            procedure, clearance, params, self.clearance, self.accuracy
        ) or check_reach(procedure, start, params)
        if refusal:
            return refusal
        n, s = procedure.axis(), self.volume.space()
        x = np.empty(7)
        O2 = start - (params.straight_module + params.tool_offset) * n
        tips = tips_of(procedure, start, params)
        status = posture_at(body, O2, n, x)
        if status == OK:
            status = self._approach(s, body, x)
        if status == OK:
            status = sweep_procedure(
                s,
                body,
                self.tree,
                n,
                procedure.length,
                procedure.pitch,
                widest_bend(procedure, params),
                procedure.pitch,
                not procedure.clipped,
                self.why,
            )
        poses = int(self.tree.size[1]) - self._mark[3]
        gained = int(self.volume.space().used[0]) * self.volume.voxel
        if status != OK:
            answer = explain(
                self.volume, status, self.why, tips, params.tool_radius, body.face
            )
            answer.poses = poses
            return answer
        if procedure.clipped and gained == 0.0:
            return refused(
                NEVER, start, 0.0, "nothing of it can be reached, or is left"
            )
        text = f"feasible: removes {1e9 * gained:.0f} mm3 in {poses} poses"
        return Answer(True, text=text, gained=gained, poses=poses)

    def _approach(self, s: Space, body: Body, x: NDArray[np.float64]) -> int:
        """Drives to a posture from the nearest node that has a free way to it."""
        c = np.empty((POINTS, 3))
        corners(x, body.h, body.tool, c)
        found, far = np.empty(STARTS, np.int64), np.empty(STARTS)
        nearest_nodes(self.tree, c[7], found, far)
        blamed, best, status = None, -1.0, LIMIT
        for node in [0, *found[found >= 0].tolist()]:
            freed, roomed = int(s.used[0]), int(s.used[1])
            new = extend(s, body, self.tree, int(node), x, self.why)
            if new >= 0:
                return OK
            roll_back(s, freed, roomed)
            # The culprit of the attempt that came nearest to the goal is named.
            near = -float(np.linalg.norm(self.why[1:4] - c[7]))
            if blamed is None or near > best:
                blamed, best, status = self.why.copy(), near, -new
        if blamed is not None:
            self.why[:] = blamed
        return status

    def record(
        self,
        name: str,
        kind: str,
        before: tuple[int, int, int],
        procedure: Procedure | None = None,
    ) -> Step:
        """Makes all since `before` a step of the plan, and saves it."""
        self.volume.forget_journals()
        nodes, first, voxels = before
        gained = (int(np.count_nonzero(self.volume.resected)) - voxels) * (
            self.volume.voxel
        )
        step = Step(name, kind, first, int(self.tree.size[1]), nodes, gained, procedure)
        self.steps.append(step)
        self.concluded = ""
        self.save_if_filed()
        return step

    def go_home(self) -> None:
        """Appends the way back into the channel."""
        before = self.standing()
        self.make_room()
        go_to(self.volume.space(), self.body, self.tree, 0, self.why)
        self.record("home", "home", before)

    # What comes of it --------------------------------------------------------

    @property
    def postures(self) -> NDArray[np.float64]:
        """All postures of the plan in their order, (n, 7)."""
        return self.tree.x[self.tree.route[: self.tree.size[1]]]

    @property
    def tips(self) -> NDArray[np.float64]:
        """Where the tool is at each of them in W, (n, 3)."""
        return self.tree.tip[self.tree.route[: self.tree.size[1]]]

    @property
    def fraction(self) -> float:
        """Of the tumour that the plan removes."""
        return self.volume.resected_volume / self.volume.tumour_volume

    # Saving ------------------------------------------------------------------

    def save_if_filed(self) -> None:
        """Saves to the session's file if it has one."""
        if self.file is not None:
            self.save(self.file)

    def save(self, path: Path) -> None:
        """Writes the session; the file before it is kept as `*.before`."""
        v, t = self.volume, self.tree
        nodes, visits = map(int, t.size)
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
            "clearance": self.clearance,
            "accuracy": self.accuracy,
            "params": asdict(self.params),
            "steps": [asdict(step) for step in self.steps],
            "concluded": self.concluded,
        }
        write_archive(path, meta, arrays)


def load_session(path: Path) -> Session:
    """Resumes a session from its file.

    Raises:
        ValueError: If the file is not there or damaged; the one before is offered.
    """
    meta, arrays = read_archive(path, "session")
    if meta["format"] != FORMAT:
        raise ValueError(
            f"session {str(path)!r} has format {meta['format']}, expected {FORMAT}: "
            "it was planned by another version; plan it anew"
        )
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
    )
    session = Session(
        volume, SnakeParams(**meta["params"]), meta["clearance"], meta["accuracy"]
    )
    nodes, visits = len(arrays["x"]), len(arrays["route"])
    tree = grown(session.tree, nodes, visits)
    for name in ("x", "parent", "depth", "tip"):
        getattr(tree, name)[:nodes] = arrays[name]
    tree.route[:visits] = arrays["route"]
    tree.size[:] = nodes, visits
    session.tree = tree
    for row in meta["steps"]:
        row["procedure"] = row["procedure"] and procedure_of(row["procedure"])
        session.steps.append(Step(**row))
    session.concluded = meta["concluded"]
    session.file = path
    return session


def home_posture(volume: Volume, params: SnakeParams) -> NDArray[np.float64]:
    """Straight in the channel, the tool just within its end, (7,).

    Raises:
        ValueError: If the translation does not reach so far back.
    """
    straight = 3 * params.straight_module + params.tool_offset
    s = volume.depth - params.tool_radius - straight
    low, high = params.travel
    if not low <= s <= high:
        raise ValueError(
            f"home needs a translation of {s:.4f} m, outside travel [{low}, {high}] m"
        )
    return np.array([s, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
