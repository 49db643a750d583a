"""The automatic planner: a pilot entry, then strokes.

Space only grows, so what is feasible stays so, and a greedy choice can waste time but
never lose tissue. The pilot makes the room in which modules may bend; then come strokes
(`strokes`), first those that free most a second, then those that free less. They begin
at edges of the tree by which the reachable part was found. The plan is then driven
again and again in thought, each time without the detours that it turns out not to need
(`tighten`), with strokes for what that leaves; the quickest is kept.
"""

from collections.abc import Callable
from dataclasses import dataclass
import math

import numpy as np
from numpy.typing import NDArray

from plants.tissue.space import SOLID, as_bits
from systems.common.parameter import Rules, check, parameter
from systems.common.signal import vector
from systems.resection.planning.draws import new_draws
from systems.resection.planning.entry import PILOT, entry_pass, radius_of
from systems.resection.planning.procedure import ELEMENTARY, Procedure
from systems.resection.planning.reach import Reach
from systems.resection.planning.search import coverable, search
from systems.resection.planning.session import STROKES, Session
from systems.resection.planning.strokes import (
    Goal,
    Library,
    Pace,
    fresh,
    new_library,
    stroke,
)
from systems.resection.planning.sweep import intermediate, straightened, try_procedure
from systems.resection.planning.tighten import tightened
from systems.resection.planning.tree import nearest_nodes
from systems.resection.wires.procedure_player import ProcedurePlayerParams, schedule

NEAR = 16
"""Nodes near a voxel among which a candidate's start is drawn."""

TURNS = 5
"""Turns of a candidate's axis that are tried, each half the one before."""

BATCH = 100
"""Strokes begun between two looks at the target."""

WALL = 1.5e-3
"""How near to where the tool may not be tissue counts as wall, in m."""

FIRST_RATE = 10e-9
"""Of strokes in m3/s, weighted; each stage's is `FALL` of the one before."""

FALL = 0.7

ENOUGH, SEARCHES = 0.98, 4
"""Share of the target below which a plan searches anew, and how often at most."""


@dataclass
class PlannerParams:
    """How the planner goes about it."""

    # Above 1, since the plan may find more than the search did.
    target: float = parameter(
        1.004, "share of the reachable part at which it stops", above=0.0, most=1.2
    )
    pitch: float = parameter(
        2.0e-3, "of poses when carried out", "m", least=5e-4, most=6e-3
    )
    trial_pitch: float = parameter(
        3.0e-3, "of poses when a candidate is tried", "m", least=5e-4, most=6e-3
    )
    passes: list[float] = parameter(
        [PILOT],
        "largest bends of the entry's passes",
        "rad",
        above=0.0,
        most=math.pi / 4,
        shape=(-1,),
    )
    candidates: int = parameter(
        32, "procedures tried for one that is chosen", least=1, most=10_000
    )
    lengths: list[float] = parameter(
        [0.0, 0.006, 0.012], "of candidates", "m", least=0.0, most=0.1, shape=(-1,)
    )
    least_gain: float = parameter(
        0.01,
        "of a procedure that is suggested, as a share of the reachable part",
        least=0.0,
        most=1.0,
    )
    least_rate: float = parameter(
        0.15e-9,
        "tumour that a stroke must free a second, the wall weighted",
        "m3/s",
        least=0.0,
        most=1e-6,
    )
    tightenings: int = parameter(
        4, "times that the plan is driven again without its detours", least=0, most=100
    )
    # At first; every second one prices it at three times as much.
    worth: float = parameter(
        1.0e-9,
        "tumour that may be left to save a second, when detours are left out",
        "m3",
        above=0.0,
        most=1e-6,
    )
    budget: int = parameter(
        1_000_000,
        "strokes that a plan begins at most",
        least=1,
        most=100_000_000,
    )
    seed: int = parameter(1, "of all random choices", least=0, most=2**63 - 1)

    def rules(self) -> Rules:
        """There must be something to try."""
        yield bool(self.lengths), "lengths", "at least one"


class Planner:
    """Plans a session to its end, step by step."""

    def __init__(
        self,
        session: Session,
        reachable: Reach | NDArray[np.bool_],
        params: PlannerParams | None = None,
        progress: Callable[[float], None] = lambda share: None,
        player: ProcedurePlayerParams | None = None,
    ) -> None:
        """Makes a planner.

        Args:
            session: What is planned; it may have steps already.
            reachable: What can be reached; or tumour voxels, the goal, (nx, ny, nz).
            params: How.
            progress: Called with the share of the goal that is planned.
            player: Rates and accelerations at which the plan will be played.
        """
        self.session = session
        self.params = check(params or PlannerParams())
        self.reach = reachable if isinstance(reachable, Reach) else None
        mask = self.reach.mask if self.reach else np.asarray(reachable)
        self.reachable = int(np.count_nonzero(mask))
        if self.reach is not None:
            mask = coverable(session.volume, session.body.radius)
        self.goal = np.flatnonzero(mask.reshape(-1)).astype(np.int32)
        self.progress = progress
        self.player = player or ProcedurePlayerParams()
        self.rng = np.random.default_rng(self.params.seed)
        self.tried = 0

    def left(self, session: Session | None = None) -> NDArray[np.int32]:
        """Voxels of the goal that are still there."""
        tau = (session or self.session).volume.tau.reshape(-1)
        return self.goal[tau[self.goal] == SOLID]

    @property
    def share(self) -> float:
        """Planned, of what can be reached; the plan may find more than the search."""
        return self.share_of(self.session)

    def share_of(self, session: Session) -> float:
        """As `share`, of another session."""
        gone = len(self.goal) - len(self.left(session))
        return gone / max(self.reachable, 1)

    def run(self) -> None:
        """Plans to the target, or as far as it goes, and home.

        A session that was planned so before is left as it is.
        """
        if self.session.concluded == repr(self.params):
            return
        self.enter()
        pace = Pace(self.player.travel_rate, self.player.bend_rate, self.player.turn)
        library = self.library()
        plan = self.session.thought()
        self.stroke(plan, pace, fresh(library), 0)
        for more in range(SEARCHES):
            # Where edges of the library stay shut, others are found from here.
            if self.share_of(plan) >= ENOUGH * self.params.target or self.spent:
                break
            self.stroke(plan, pace, self.searched(plan), -1 - more)
        best, least = plan, self.price(plan)
        for number in range(self.params.tightenings):
            worth = self.params.worth * (3.0 if number % 2 else 1.0)
            plan = tightened(
                self.session, plan, self.goal, pace, self.player.lead, worth
            )
            plan.record("strokes 1", STROKES, self.session.standing())
            self.stroke(plan, pace, fresh(library), number + 1)
            price = self.price(plan)
            if price < least:
                best, least = plan, price
        best.go_home()
        self.session.adopt(best)
        if self.tried < self.params.budget:  # else there may be more to do
            self.session.concluded = repr(self.params)
        self.session.save_if_filed()

    @property
    def spent(self) -> bool:
        """Whether a plan has begun all strokes that it may."""
        return self.tried >= self.params.budget

    def price(self, plan: Session) -> float:
        """What a plan costs: its time, and that of what it leaves, in s."""
        time = float(schedule(plan.postures, self.player)[-1])
        lost = max(self.params.target - self.share_of(plan), 0.0) * self.reachable
        return time + lost * plan.volume.voxel / max(self.params.least_rate, 1e-12)

    def library(self) -> Library:
        """Where strokes may begin: what the search found, or one made now."""
        if self.reach is not None:
            return new_library(self.reach.x, self.reach.parent, self.reach.nodes)
        return self.searched(self.session)

    def searched(self, session: Session) -> Library:
        """Edges that a search finds from how a session stands."""
        thought = session.thought()
        nodes = int(thought.tree.size[0])
        search(thought, new_draws(self.params.seed), 0.25)
        end = int(thought.tree.size[0])
        return new_library(
            thought.tree.x[nodes:end], thought.tree.parent[nodes:end], nodes
        )

    def stroke(
        self, session: Session, pace: Pace, library: Library, number: int
    ) -> None:
        """Strokes of falling gain until the target, a step of the plan for each rate.

        Args:
            session: What is planned.
            pace: The robot's.
            library: Where strokes may begin.
            number: Of the plan: its random moves are its own.
        """
        volume, params = session.volume, self.params
        wanted = np.zeros(volume.labels.shape, bool)
        wanted.reshape(-1)[self.goal] = True
        near = volume.inside <= WALL / volume.spacing
        goal = Goal(as_bits(wanted), as_bits(wanted & near))
        draws = new_draws(1000 * params.seed + number % 1000)
        rate, begun = FIRST_RATE, 0
        while rate > params.least_rate * FALL:
            rate = max(rate, params.least_rate)
            before = session.standing()
            while begun < params.budget and self.share_of(session) < params.target:
                session.volume.forget_journals()
                session.make_room()
                most = min(BATCH, params.budget - begun)
                count = stroke(
                    volume.space(), session.body, session.tree, draws, pace, goal,
                    library, rate / volume.voxel, most, session.why,
                )  # fmt: skip
                begun += count
                self.progress(max(self.share, self.share_of(session)))
                if count < most:
                    break
            if session.standing()[1] > before[1]:
                number = 1 + sum(step.kind == STROKES for step in session.steps)
                session.record(f"strokes {number}", STROKES, before)
            rate *= FALL
        self.tried = max(self.tried, begun)

    def enter(self) -> None:
        """The entry's passes, to the far end of the tumour, but those made before."""
        for number, bend in enumerate(self.params.passes):
            name = "pilot entry" if number == 0 else f"entry pass {number + 1}"
            if self.session.volume.more:
                name += f", channel {1 + len(self.session.volume.more)}"
            procedure = entry_pass(self.session, bend, self.params.pitch, name)
            if not any(step.procedure == procedure for step in self.session.steps):
                self.session.commit(procedure)
            self.progress(self.share)

    def suggest(self) -> list[Procedure]:
        """The procedures of some random ones that gain enough, best first.

        Nothing changes: it is the surgeon's, or `choose`'s, to commit one.
        """
        session, params = self.session, self.params
        session.volume.forget_journals()
        session.make_room()
        s, b, t, why = session.volume.space(), session.body, session.tree, session.why
        left = self.left()
        if len(left) == 0:
            return []
        found, far = np.empty(NEAR, np.int64), np.empty(NEAR)
        least = params.least_gain * len(self.goal)
        good: list[tuple[int, Procedure]] = []
        for _ in range(params.candidates):
            p = session.volume.centre_of(int(left[self.rng.integers(len(left))]))
            nearest_nodes(t, vector(p), found, far)
            node = int(found[self.rng.integers(NEAR)])
            if node < 0:
                continue
            length = float(self.rng.choice(params.lengths))
            pitch, share, gain = params.trial_pitch, self.rng.random(), -1
            x = np.empty(7)
            for _ in range(TURNS):
                if straightened(b, t.x[node], p, share, x):
                    gain = try_procedure(
                        s, b, t, node, x, length, pitch, math.pi / 4, pitch, why
                    )
                if gain >= 0:
                    break
                share /= 2  # where it is tight the axis turns but little
            if gain > 0 and gain >= least:
                good.append((gain, self._procedure(x, length)))
        return [procedure for _, procedure in sorted(good, key=lambda row: -row[0])]

    def _procedure(self, x: NDArray[np.float64], length: float) -> Procedure:
        """The clipped procedure that starts at a posture (7,), last module straight."""
        params = self.session.params
        p_WI, n = map(np.array, intermediate(self.session.body, x))
        start = p_WI + (params.straight_module + params.tool_offset) * n
        radius = radius_of(params.max_bend, params)
        number = 1 + sum(step.kind == ELEMENTARY for step in self.session.steps)
        return Procedure(
            ELEMENTARY,
            start.tolist(),
            n.tolist(),
            length,
            radius,
            True,
            self.params.pitch,
            name=f"procedure {number}",
        )

    def choose(self) -> bool:
        """Commits the best that is suggested; False if nothing is."""
        return any(self.session.commit(p).feasible for p in self.suggest())
