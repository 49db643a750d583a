"""A resection as a session: propose, check, preview, commit, undo, save, resume."""

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from plants.snake.kinematics import POINTS
from plants.snake.parameters import SnakeParams
from plants.snake.snake_body import CULPRIT, OK, Body, body_of, place
from plants.tissue.critical import Boxes
from plants.tissue.labels import TUMOUR
from plants.tissue.space import Space, roll_back
from plants.tissue.tissue import Grid, Tissue
from plants.tissue.volume import Channel, Volume
from systems.common.archive import read_archive, sensible, write_archive
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
    Procedure,
    Tool,
    ToolChange,
    check_procedure,
    procedure_of,
    widest_bend,
    with_tool,
)
from systems.resection.planning.saved import check_removed, check_saved
from systems.resection.planning.sweep import LIMIT, posture_at, sweep_procedure
from systems.resection.planning.tree import (
    Tree,
    copied,
    cut,
    enlist_all,
    extend,
    go_to,
    grown,
    here,
    nearest_nodes,
    new_tree,
    tree_of,
)

ROOM = 60_000
"""Nodes, and visits, that one step of a session may need."""

FORMAT = 3
"""Of a session's file; 2: what is critical as the mask has it; 3: several entries."""

STROKES = "strokes"
"""Kind of a step that is no procedure: see `strokes`."""

UPDATE = "update"
"""Kind of a step in which the tissue is taken as an image shows it now."""

ACCESS = "access"
"""Kind of a step in which the access robot is set anew."""

TOOL = "tool"
"""Kind of a step in which the tool is changed."""

STARTS = 24
"""Nodes from which a procedure's start is tried."""


@dataclass
class Step:
    """A part of the plan.

    Attributes:
        name: What it is called.
        kind: "entry", "elementary", "volume", "strokes", "home", "access" (the
            robot withdrawn, and set anew at the end of another channel), "update" or
            "tool".
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


@dataclass
class Session:
    """A resection under way.

    Attributes:
        volume: The tissue.
        params: The robot with the tool that it carries; it begins with `own`.
        clearance: That the plan keeps between body and tissue, in m.
        accuracy: To which the robot follows the plan, in m: its tool surely frees
            a ball that is smaller by this.
        steps: What has been committed.
        file: Where every commit is saved; nowhere if None.
        concluded: How a planner went about it that found nothing more to do.
        reached: Share of the tumour that can be reached, after each entry planned.
        tools: Those that it changes to.
    """

    volume: Volume
    params: SnakeParams
    clearance: float = 0.075e-3
    accuracy: float = 0.025e-3
    steps: list[Step] = field(default_factory=list)
    file: Path | None = None
    concluded: str = ""
    reached: list[float] = field(default_factory=list)
    tools: list[ToolChange] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.own = check(self.params)
        self.stand()
        c = np.empty((POINTS, 3))
        place(self.body, self.home, c)
        self.tree: Tree = new_tree(self.home, c[7], ROOM, ROOM)
        self.why = np.zeros(CULPRIT)

    def stand(self) -> None:
        """Puts the robot with its tool into the channel bored last.

        At home the largest ball that it has carried lies within the channel.
        """
        radii = [self.own.tool_radius, *(tool.radius for tool in self.tools)]
        self.params = replace(self.own, tool_radius=radii[-1])
        widest = replace(self.own, tool_radius=max(radii))
        self.home = home_posture(self.volume, widest)
        self.body: Body = body_of(
            self.params, self.clearance, self.accuracy, X_WE=self.X_WE
        )

    @property
    def X_WE(self) -> NDArray[np.float64]:
        """Pose of the frame of the entry worked through, (4, 4)."""
        return self.volume.more[-1].X_WE if self.volume.more else np.eye(4)

    @property
    def entries(self) -> NDArray[np.int64]:
        """The entry through which each posture of the plan is reached, (n,)."""
        times = [channel.time for channel in self.volume.more]
        visits = np.arange(int(self.tree.size[1]))
        return np.searchsorted(np.array(times, int), visits, side="right")

    @property
    def tool_radii(self) -> NDArray[np.float64]:
        """Of the ball that it carries at each posture of the plan, in m, (n,)."""
        radii = np.array([self.own.tool_radius, *(t.radius for t in self.tools)])
        times = np.array([tool.time for tool in self.tools], int)
        visits = np.arange(int(self.tree.size[1]))
        return radii[np.searchsorted(times, visits, side="right")]

    # What is asked -----------------------------------------------------------

    def check(self, procedure: Procedure) -> Answer:
        """Whether a procedure is feasible now; nothing changes."""
        return self.preview(procedure).answer

    def preview(self, procedure: Procedure) -> Preview:
        """How a procedure would go now, to be drawn; nothing changes."""
        answer, s = self._do(procedure), self.volume.space()
        tree, freed = self.tree, s.freed[: s.used[0]].copy()
        posture = tree.x[tree.route[tree.size[1] - 1]].copy()
        self._take_back(self._mark)
        return Preview(answer, self._tips, freed, posture)

    def commit(self, procedure: Procedure) -> Answer:
        """Makes a procedure part of the plan if it is feasible."""
        before = self.standing()
        answer = self._do(procedure)
        if answer.feasible and with_tool(self.params, procedure.tool) != self.params:
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
        if self.steps[-1].kind == UPDATE:
            raise ValueError("what was measured cannot be undone")
        step = self.steps.pop()
        self.concluded = ""
        self.volume.undo(step.first - 1)
        cut(self.tree, step.nodes, step.first)
        if step.kind in (ACCESS, TOOL):
            self.tools = [tool for tool in self.tools if tool.time < step.first]
            roots = np.flatnonzero(self.tree.parent[: step.nodes] < 0)
            self.tree.size[2] = roots[-1]
            enlist_all(self.tree)
            self.stand()
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
        cut(self.tree, *mark[2:])

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
        """Carries a procedure out in thought.

        `_mark` is how it was before, `_tips` where its tool goes.
        """
        self.volume.forget_journals()
        self.make_room()
        self._mark = (0, 0, int(self.tree.size[0]), int(self.tree.size[1]))
        self._tips = np.empty((0, 3))
        check_procedure(procedure, self.params)
        params = with_tool(self.params, procedure.tool)
        body = self.body
        if procedure.tool is not None:
            body = body_of(params, self.clearance, self.accuracy)
        own, start = self._in_entry(procedure, params)
        clearance = self.volume.channel - params.body_radius
        refusal = check_jam(
            procedure, clearance, params, self.clearance, self.accuracy
        ) or check_reach(own, start, params)
        if refusal:
            if refusal.where is not None:
                refusal.where = (self.X_WE @ [*refusal.where, 1.0])[:3].tolist()
            return refusal
        R_WE, o = self.X_WE[:3, :3], self.X_WE[:3, 3]
        n, s = R_WE @ own.axis(), self.volume.space()
        x = np.empty(7)
        O2 = R_WE @ start + o - (params.straight_module + params.tool_offset) * n
        tips = self._tips = tips_of(own, start, params) @ R_WE.T + o
        start = R_WE @ start + o
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

    def _in_entry(
        self, procedure: Procedure, params: SnakeParams
    ) -> tuple[Procedure, NDArray[np.float64]]:
        """A procedure as the entry's frame has it, and where its tool starts there."""
        if procedure.position is None or procedure.direction is None:
            return procedure, np.array(
                [0.0, 0.0, self.volume.depth - params.tool_radius]
            )
        X_EW = np.linalg.inv(self.X_WE)
        start = X_EW[:3, :3] @ np.array(procedure.position) + X_EW[:3, 3]
        axis = X_EW[:3, :3] @ np.array(procedure.direction)
        own = replace(procedure, position=start.tolist(), direction=axis.tolist())
        return own, start

    def _approach(self, s: Space, body: Body, x: NDArray[np.float64]) -> int:
        """Drives to a posture from the nearest node that has a free way to it."""
        c = np.empty((POINTS, 3))
        place(body, x, c)
        found, far = np.empty(STARTS, np.int64), np.empty(STARTS)
        nearest_nodes(self.tree, c[7], found, far)
        blamed, best, status = None, -1.0, LIMIT
        for node in [int(self.tree.size[2]), *found[found >= 0].tolist()]:
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
        home = int(self.tree.size[2])
        go_to(self.volume.space(), self.body, self.tree, home, self.why)
        self.record("home", "home", before)

    def enter_anew(self, X_WE: NDArray[np.float64], name: str = "") -> Step:
        """Withdraws the robot and sets it at the end of another channel.

        Args:
            X_WE: The channel's frame: as W it has z along the channel, which ends at
                the volume's depth along that.
            name: Of the step.

        Raises:
            ValueError: If the channel comes too near to what is critical.
        """
        if self.steps and self.steps[-1].kind != "home":
            self.go_home()
        before = self.standing()
        visit = int(self.tree.size[1])
        self.volume.bore(Channel(np.array(X_WE, float), self.volume.depth, visit))
        self._begin_at_home()
        name = name or f"entry {1 + len(self.volume.more)}"
        return self.record(name, ACCESS, before)

    def change_tool(self, radius: float, name: str = "") -> Step:
        """Withdraws the robot and gives it a ball of another radius, in m.

        Raises:
            ValueError: If that is no tool of this robot.
        """
        params = with_tool(self.own, Tool(radius, self.own.tool_offset))
        if radius >= self.volume.channel:
            raise ValueError(
                f"tool of {radius} m: expected < {self.volume.channel}, the channel's"
            )
        if self.steps and self.steps[-1].kind != "home":
            self.go_home()
        before = self.standing()
        self.make_room()
        back = home_posture(self.volume, params)
        if back[0] < self.home[0]:
            space, at = self.volume.space(), here(self.tree)
            extend(space, self.body, self.tree, at, back, self.why)
        self.tools.append(ToolChange(radius, int(self.tree.size[1])))
        self._begin_at_home()
        name = name or f"tool of {1e3 * radius:.1f} mm"
        return self.record(name, TOOL, before)

    def _begin_at_home(self) -> None:
        """Lets a tree of its own begin at home: nothing driven before is relied on."""
        self.stand()
        self.make_room()
        tree, c = self.tree, np.empty((POINTS, 3))
        place(self.body, self.home, c)
        node, visit = int(tree.size[0]), int(tree.size[1])
        tree.x[node], tree.tip[node] = self.home, c[7]
        tree.parent[node], tree.depth[node] = -1, 0
        tree.route[visit] = node
        tree.size[:] = node + 1, visit + 1, node
        enlist_all(tree)

    def update(
        self,
        tissue: Tissue,
        seen: NDArray[np.bool_] | None = None,
        opened: NDArray[np.bool_] | None = None,
    ) -> Step:
        """Takes the tissue as an image, and a scan of the cavity, show it now.

        The robot goes home, and relies on no way that it drove before: what it
        still can do is checked against what is there.

        Args:
            tissue: Of an image taken meanwhile: the tumour that is left, and what is
                critical, in the same frame P.
            seen: Voxels found to be tissue, as `Volume.retarget` takes them.
            opened: Voxels found to be free, likewise.

        Raises:
            ValueError: If the tumour that is left lies beyond the grid.
        """
        if self.steps and self.steps[-1].kind != "home":
            self.go_home()
        self.volume.retarget(tissue, seen, opened, int(self.tree.size[1]) - 1)
        before = self.standing()
        self._begin_at_home()
        return self.record("update", UPDATE, before)

    def thought(self) -> "Session":
        """The same as it stands now, to be gone on with without consequence."""
        other = Session(self.volume.thought(), self.own, self.clearance, self.accuracy)
        other.tools = list(self.tools)
        other.tree = copied(self.tree, ROOM, 4 * ROOM)
        other.steps = list(self.steps)
        other.stand()
        return other

    def reaches(self, mask: NDArray[np.bool_]) -> float:
        """Keeps, and returns, the share of the tumour found to be in reach so far."""
        entry = len(self.volume.more)
        known = max(self.reached[entry : entry + 1], default=0.0)
        share = int(mask.sum()) / int((self.volume.labels == TUMOUR).sum())
        self.reached[entry:] = [max(known, share)]
        self.save_if_filed()
        return share

    def adopt(self, thought: "Session") -> None:
        """Makes what was done in thought part of the plan, and saves it."""
        self.volume.tau[:] = thought.volume.tau
        self.volume.more = thought.volume.more
        self.volume.allow()
        self.volume.refresh()
        self.tools = thought.tools
        self.stand()
        self.tree, self.steps = thought.tree, thought.steps
        self.concluded = ""
        self.save_if_filed()

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
            "clearance": self.clearance,
            "accuracy": self.accuracy,
            "params": asdict(self.own),
            "tools": [asdict(tool) for tool in self.tools],
            "steps": [asdict(step) for step in self.steps],
            "concluded": self.concluded,
            "reached": self.reached,
            "home": home,
            "image": v.image
            and {"sizes": list(map(int, v.image.sizes)), "X_PI": v.image.X_PI.tolist()},
            "more": [
                {"X_WE": c.X_WE.tolist(), "depth": c.depth, "time": c.time}
                for c in v.more
            ],
        }
        write_archive(path, meta, arrays)


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
