"""The automatic planner: entry, greedy clipped procedures, finisher.

Space only grows, so a procedure that is feasible stays so, and a greedy choice can
waste procedures but never lose tissue. The entry is driven in passes of growing
bend: the pilot makes the room in which the next pass may bend. Then come the
procedures that gain most among random ones, and at last single steps, lump by lump:
first those that gain much, then those that gain little.
"""

from collections.abc import Callable
from dataclasses import dataclass
import math

import numpy as np
from numpy.typing import NDArray

from plants.snake.last_module import meridian
from plants.tissue.labels import TUMOUR
from plants.tissue.space import SOLID
from systems.common.parameter import Rules, check, parameter
from systems.resection.planning.draws import new_draws
from systems.resection.planning.growth import grow
from systems.resection.planning.procedure import ELEMENTARY, ENTRY, Procedure
from systems.resection.planning.session import Session
from systems.resection.planning.sweep import intermediate, straightened, try_procedure
from systems.resection.planning.tree import nearest_nodes

NEAR = 16
"""Nodes near a voxel among which a candidate's start is drawn."""

TURNS = 5
"""Turns of a candidate's axis that are tried, each half the one before."""

VAIN = 5
"""Rounds of the last stage in a row that free nothing, after which it ends."""

WEARY = 100
"""Failed attempts after which a round asks for a voxel no more."""


@dataclass
class PlannerParams:
    """How the planner goes about it."""

    target: float = parameter(
        0.986, "share of the reachable part at which it stops", above=0.0, most=1.0
    )
    pitch: float = parameter(
        2.0e-3, "of poses when carried out", "m", least=5e-4, most=6e-3
    )
    trial_pitch: float = parameter(
        3.0e-3, "of poses when a candidate is tried", "m", least=5e-4, most=6e-3
    )
    passes: list[float] = parameter(
        [math.radians(8.0), math.radians(20.0), math.pi / 4],
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
    # Below it the finisher takes over.
    least_gain: float = parameter(
        0.01,
        "of a procedure, as a share of the reachable part",
        least=0.0,
        most=1.0,
    )
    lump: float = parameter(
        0.006,
        "how far the finisher looks from where it starts a lump",
        "m",
        least=5e-4,
        most=0.1,
    )
    step_gains: list[float] = parameter(
        [27e-9, 9e-9, 3e-9, 0.6e-9, 0.25e-9],
        "tumour that a step of the finisher must free, stage by stage",
        "m3",
        least=0.0,
        most=1e-6,
        shape=(-1,),
    )
    rounds: int = parameter(
        4,
        "through all lumps in a stage but the last, which goes on",
        least=1,
        most=1000,
    )
    # Four times as many in the last stage.
    attempts: int = parameter(
        400,
        "steps in a lump before the finisher looks at what they gained",
        least=1,
        most=1_000_000,
    )
    budget: int = parameter(
        20_000_000,
        "single steps that the finisher tries at most",
        least=1,
        most=1_000_000_000,
    )
    seed: int = parameter(1, "of all random choices", least=0, most=2**63 - 1)

    def rules(self) -> Rules:
        """There must be something to try."""
        for name in ("lengths", "step_gains"):
            yield bool(getattr(self, name)), name, "at least one"


class Planner:
    """Plans a session to its end, step by step."""

    def __init__(
        self,
        session: Session,
        reachable: NDArray[np.bool_],
        params: PlannerParams | None = None,
        progress: Callable[[float], None] = lambda share: None,
    ) -> None:
        """Makes a planner.

        Args:
            session: What is planned; it may have steps already.
            reachable: Tumour voxels that can be reached, the goal.
            params: How.
            progress: Called with the share of the goal that is planned.
        """
        self.session = session
        self.params = check(params or PlannerParams())
        self.goal = np.flatnonzero(reachable.reshape(-1)).astype(np.int32)
        self.progress = progress
        self.rng = np.random.default_rng(self.params.seed)
        self.draws = new_draws(self.params.seed + len(session.steps))
        self.tried = 0

    def left(self) -> NDArray[np.int32]:
        """Voxels of the goal that are still there."""
        tau = self.session.volume.tau.reshape(-1)
        return self.goal[tau[self.goal] == SOLID]

    @property
    def share(self) -> float:
        """Of the goal that is planned."""
        return 1.0 - len(self.left()) / max(len(self.goal), 1)

    def run(self) -> None:
        """Plans to the target, or as far as it goes, and home.

        A session that was planned so before is left as it is.
        """
        if self.session.concluded == repr(self.params):
            return
        self.enter()
        while self.share < self.params.target and self.choose():
            self.progress(self.share)
        for stage, gain in enumerate(self.params.step_gains):
            last = stage + 1 == len(self.params.step_gains)
            attempts = self.params.attempts * (4 if last else 1)
            rounds, vain = 0, 0
            while (last or rounds < self.params.rounds) and self.unfinished():
                vain = 0 if self.finish(gain, attempts) else vain + 1
                if vain == (VAIN if last else 1):
                    break
                rounds += 1
                self.progress(self.share)
        if self.session.steps and self.session.steps[-1].kind != "home":
            self.session.go_home()
        if self.tried < self.params.budget:  # else there may be more to do
            self.session.concluded = repr(self.params)
        self.session.save_if_filed()

    def unfinished(self) -> bool:
        """Whether the target is not reached, and some of the budget is left."""
        return self.share < self.params.target and self.tried < self.params.budget

    def _radius(self, bend: float) -> float:
        params = self.session.params
        return float(meridian(bend, params)[0]) + params.tool_radius

    def enter(self) -> None:
        """The entry's passes, to the far end of the tumour, but those made before."""
        volume = self.session.volume
        deepest = float(volume.points(volume.labels == TUMOUR)[:, 2].max())
        length = deepest - volume.depth + self.session.params.tool_radius
        travel = self.session.params.travel[1] - float(self.session.home[0])
        length = min(max(length, self.params.pitch), travel)
        for number, bend in enumerate(self.params.passes):
            name = "pilot entry" if number == 0 else f"entry {number + 1}"
            procedure = Procedure(
                kind=ENTRY,
                length=length,
                radius=self._radius(bend),
                clipped=True,
                pitch=self.params.pitch,
                name=name,
            )
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
            nearest_nodes(t, p, found, far)
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
        radius = self._radius(params.max_bend)
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

    def finish(self, gain: float, attempts: int) -> bool:
        """Single steps in the lumps that are left, nearest first; False if vain.

        Args:
            gain: Tumour that a step must free, in m3.
            attempts: In a lump before it is looked at what they gained.
        """
        session, params = self.session, self.params
        session.volume.forget_journals()
        session.make_room()
        before = session.standing()
        volume = session.volume
        s, b, t, why = volume.space(), session.body, session.tree, session.why
        least = max(1, round(gain / volume.voxel))
        left = self.left()
        size = np.array(volume.labels.shape)
        points = np.column_stack(np.unravel_index(left, size)) * volume.spacing
        open_ = np.ones(len(left), bool)
        made = 0
        while open_.any() and self.unfinished() and session.roomy():
            tip = session.tips[-1] - volume.origin
            rest = np.flatnonzero(open_)
            seed = rest[int(np.argmin(((points[rest] - tip) ** 2).sum(axis=1)))]
            near = ((points - points[seed]) ** 2).sum(axis=1) < params.lump**2
            lump = left[near & open_]
            open_ &= ~near
            tries = np.zeros(len(lump), np.int32)
            while len(lump) and session.roomy():
                count = min(attempts, params.budget - self.tried)
                done = grow(
                    s, b, t, self.draws, lump, tries, count, WEARY, least, True, why
                )
                self.tried += count
                made += done
                alive = (s.tau[lump] == SOLID) & (tries < WEARY)
                lump, tries = lump[alive], tries[alive]
                if done < 2:
                    break
        if made:
            number = 1 + sum(step.kind == "finish" for step in session.steps)
            session.record(f"finish {number}", "finish", before)
        return made > 0
