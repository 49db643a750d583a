"""A resection as a session: propose, check, preview, commit, undo, save, resume."""

from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from plants.snake.kinematics import POINTS
from plants.snake.parameters import SnakeParams
from plants.snake.snake_body import CULPRIT, Body, body_of, place
from plants.tissue.labels import TUMOUR
from plants.tissue.space import roll_back
from plants.tissue.tissue import Tissue
from plants.tissue.volume import Channel, Volume
from systems.common.parameter import check
from systems.resection.planning.feasibility import (
    Answer,
    refused,
)
from systems.resection.planning.home import home_posture
from systems.resection.planning.procedure import (
    Procedure,
    Tool,
    ToolChange,
    with_tool,
)
from systems.resection.planning.saved import write_session
from systems.resection.planning.tree import (
    Tree,
    copied,
    cut,
    enlist_all,
    extend,
    go_to,
    grown,
    here,
    new_tree,
)
from systems.resection.planning.trial import Preview, Trial, try_out

ROOM = 60_000
"""Nodes, and visits, that one step of a session may need."""

STROKES = "strokes"
"""Kind of a step that is no procedure: see `strokes`."""

UPDATE = "update"
"""Kind of a step in which the tissue is taken as an image shows it now."""

ACCESS = "access"
"""Kind of a step in which the access robot is set anew."""

TOOL = "tool"
"""Kind of a step in which the tool is changed."""


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
        trial, s = try_out(self, procedure), self.volume.space()
        tree, freed = self.tree, s.freed[: s.used[0]].copy()
        posture = tree.x[tree.route[tree.size[1] - 1]].copy()
        self._take_back(trial)
        return Preview(trial.answer, trial.tips, freed, posture)

    def commit(self, procedure: Procedure) -> Answer:
        """Makes a procedure part of the plan if it is feasible."""
        before = self.standing()
        trial = try_out(self, procedure)
        answer = trial.answer
        if answer.feasible and with_tool(self.params, procedure.tool) != self.params:
            answer = refused(
                "limit", None, 0.0, "the robot carries another tool: change it first"
            )
        if not answer.feasible:
            self._take_back(trial)
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

    def _take_back(self, trial: Trial) -> None:
        roll_back(self.volume.space(), 0, 0)
        cut(self.tree, trial.nodes, trial.visits)

    def make_room(self) -> None:
        """Sees to it that a step's nodes fit into the tree."""
        self.tree = grown(self.tree, ROOM, 4 * ROOM)

    def roomy(self) -> bool:
        """Whether a third of that room is left."""
        tree = self.tree
        return bool(tree.size[0] + ROOM // 3 < len(tree.x)) and bool(
            tree.size[1] + 4 * ROOM // 3 < len(tree.route)
        )

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
        write_session(self, path)
