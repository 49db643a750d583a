"""The rounds of a rehearsal: what is believed, planned, carried out and measured.

A rim of the tumour is kept until the end: as deep as what is still to go may move the
tissue, so the border is cut when most of the motion has been, and has been measured
often. An image shows where the border is now, with an error of its own each time; the
first mask, displaced to fit all images, shows it better than any of them (`Sight`).
"""

from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from diagrams.common.progress import Progress
from diagrams.resection.operation import new_session
from diagrams.resection.scenario import ResectionScenario
from diagrams.resection.sight import ALL, MOUTH, Sight
from plants.tissue.labels import CRITICAL, TUMOUR
from plants.tissue.space import SOLID
from plants.tissue.tissue import Tissue
from plants.tissue.yielding import YieldingTissue
from systems.common.archive import before, beside, read_archive, sensible, write_archive
from systems.resection.planning.planner import Planner
from systems.resection.planning.reach import find_reach
from systems.resection.planning.resumed import load_session
from systems.resection.wires.procedure_player import schedule

ROUNDS = 30
"""At most."""

STROKES = 16
"""Begun in the first round."""

LEAST = 0.003
"""Of the tumour, that a round must remove for another to be worth it."""

FORMAT = 1
"""Of the file of a rehearsal under way."""


@dataclass
class Rehearsal:
    """How it went.

    Attributes:
        reachable: Share of the tumour that can be reached if nothing moves.
        rounds: A row each: shares of the tumour `resected` and `healthy` so far,
            `time` [s], the `stage`, largest `moved` and `error` of the fit in
            the tumour that is left [m], `rms` of the points seen [m].
        stopped: Why it ended before nothing more was to do; "" if it did not.
        hits: Checks that found the body in tissue.
        nearest: Least distance to what is critical, in m; None if nothing is.
        way: Of the tool, in m.
    """

    reachable: float
    rounds: list[dict[str, float]] = field(default_factory=list)
    stopped: str = ""
    hits: int = 0
    nearest: float | None = None
    way: float = 0.0

    def figures(self) -> dict[str, Any]:
        """As data."""
        last = self.rounds[-1] if self.rounds else {"resected": 0.0, "healthy": 0.0}
        return {
            "reachable_fraction": self.reachable,
            "resected_fraction": last["resected"],
            "healthy_fraction": last["healthy"],
            "min_critical_distance": self.nearest,
            "body_collisions": self.hits,
            "execution_time": last.get("time", 0.0),
            "path_length": self.way,
            "stopped": self.stopped,
            "rounds": self.rounds,
        }


class Rounds:
    """A rehearsal under way; between two rounds it is what a file holds."""

    def __init__(
        self, scenario: ResectionScenario, progress: Progress, file: Path | None = None
    ) -> None:
        """Begins, or goes on from a file.

        Raises:
            ValueError: If tumour, access or the file make no sense.
        """
        self.scenario, self.progress, self.file = scenario, progress, file
        params, scan = scenario.rehearsal, scenario.scan
        careful = replace(scenario, tracking=scenario.tracking + params.reserve)
        self.session, _ = new_session(careful, progress)
        volume, pitch = self.session.volume, scenario.carver.pitch
        self.truth = YieldingTissue(volume, scenario.shift, scenario.snake, pitch)
        self.sight = Sight(self.truth, scenario) if scan.on else None
        self.whole = int(np.count_nonzero(volume.labels == TUMOUR))
        self.player = replace(scenario.player, lead=scenario.period)
        self.share = params.reserve / params.feared if scan.on else 1.0
        self.budget = STROKES if scan.on else scenario.planner.budget
        self.stage, self.rim = MOUTH, params.feared
        self.ended = False
        if file is not None and file.is_file():
            self._resume(file)
            return
        self.told = Rehearsal(self._reach(anew=True).fraction)
        if self.sight is not None:
            self._believe(
                self.sight.shown(self.stage, self.rim), self.sight.material.fixed
            )
        self.keep()

    @property
    def number(self) -> int:
        """Of the next round, from 1."""
        return len(self.told.rounds) + 1

    def run(self) -> None:
        """A round: plans, carries out, and measures if there is to be another."""
        first, thought = self._plan()
        postures = self.session.postures[first:]
        removed = -self.truth.resected
        self.truth.carry_out(postures)
        removed += self.truth.resected
        self._tell(postures)
        done = removed < LEAST and self.planned < self.budget
        if self.sight is None or (done and self.stage == ALL) or self.number > ROUNDS:
            self.ended = True
            return
        # As many strokes as remove what the margin allows for.
        self.budget = int(
            self.budget * min(max(self.share / max(removed, 1e-9), 0.5), 4.0)
        )
        row = self.told.rounds[-1]
        rng = np.random.default_rng(
            [self.scenario.seed, self.scenario.shift.seed, self.number]
        )
        gone, self.told.stopped = self.sight.look(
            self.session, first, thought, row, rng
        )
        left = self.sight.left(gone)
        self.ended = bool(self.told.stopped) or left == 0.0
        beyond = max(left - (1.0 - self.told.reachable), 0.0)
        self.stage += int(done)
        # What is still to go may move the tissue by so much.
        self.rim = self.scenario.rehearsal.feared * beyond
        if not self.ended:
            self._believe(self.sight.shown(self.stage, self.rim), gone)
            self.keep()

    def _plan(self) -> tuple[int, NDArray[np.int32]]:
        """Plans a round; its first posture, and the arrival times before it."""
        session, params = self.session, self.scenario.planner
        with self.progress(f"round {self.number}", "of the tumour") as show:
            reach = self._reach(anew=False)
            planner = Planner(session, reach, params, player=self.player)
            more = self.share * self.whole / max(planner.reachable, 1)
            planner.params = replace(
                params,
                target=min(planner.share + more, params.target),
                passes=params.passes if self.number == 1 else [],
                budget=self.budget,
            )
            first, thought = int(session.tree.size[1]) - 1, session.volume.tau.copy()
            planner.run()
            self.planned = planner.tried
            show(session.fraction, 1.0)
        return first, thought

    def _reach(self, anew: bool) -> Any:
        scenario = self.scenario
        half = beside(self.file, "search") if self.file and anew else None
        reach = find_reach(
            self.session,
            scenario.seed,
            scenario.reach_effort,
            explain=False,
            anew=anew,
            file=half,
        )
        if half is not None:
            for path in (half, before(half)):
                path.unlink(missing_ok=True)
        return reach

    def _tell(self, postures: NDArray[np.float64]) -> None:
        """Adds a round's row."""
        told, truth, scan = self.told, self.truth, self.scenario.scan
        time = told.rounds[-1]["time"] if told.rounds else 0.0
        time += float(schedule(postures, self.player)[-1])
        told.rounds.append(
            {
                "resected": truth.resected,
                "healthy": truth.healthy,
                "time": time + (scan.time if scan.on else 0.0),
                "stage": self.stage,
            }
        )
        told.hits, told.way = truth.hits, truth.way
        told.nearest = truth.nearest if np.isfinite(truth.nearest) else None

    def _believe(self, labels: NDArray[np.uint8], gone: NDArray[np.bool_]) -> None:
        """The session takes over what is left of labels, and what is free."""
        volume = self.session.volume
        left = np.where(gone & (labels == TUMOUR), 0, labels)
        left[~np.isin(left, (TUMOUR, CRITICAL))] = 0
        X_WV = np.diag([volume.spacing] * 3 + [1.0])
        X_WV[:3, 3] = volume.origin
        tissue = Tissue(left.astype(np.uint8), volume.X_PW @ X_WV, "scan")
        self.session.update(tissue, (volume.tau != SOLID) & ~gone, gone)

    # Killed at any moment it goes on from here -------------------------------

    def keep(self) -> None:
        """Writes all that the next round begins with, and reads it again."""
        if self.file is None:
            return
        plan = beside(self.file, "session")
        self.session.save(plan)
        meta = {
            "format": FORMAT,
            "key": repr(self.scenario),
            "told": asdict(self.told),
            "budget": self.budget,
            "rim": self.rim,
            "stage": self.stage,
        }
        arrays = {
            "session": np.frombuffer(plan.read_bytes(), np.uint8),
            "gone": self.truth.material.gone,
        }
        if self.sight is not None:
            arrays |= self.sight.arrays()
        write_archive(self.file, meta, arrays)
        self.session = load_session(plan)  # a round begins alike, resumed or not
        self.session.file = None

    def _resume(self, file: Path) -> None:
        meta, arrays = read_archive(file, "rehearsal", FORMAT)
        if meta["key"] != repr(self.scenario):
            raise ValueError(
                f"rehearsal {str(file)!r} is under way with other parameters: move it "
                "away, or choose another folder"
            )
        with sensible(file, "rehearsal"):
            plan = beside(file, "session")
            plan.write_bytes(arrays["session"].tobytes())
            self.session = load_session(plan)
            self.session.file = None
            self.told = Rehearsal(**meta["told"])
            self.budget, self.rim = int(meta["budget"]), float(meta["rim"])
            self.stage = int(meta["stage"])
            truth, told = self.truth, self.told
            truth.material.gone = arrays["gone"]
            truth.hits, truth.way = told.hits, told.way
            truth.nearest = np.inf if told.nearest is None else told.nearest
            if self.sight is not None:
                self.sight.resume(arrays)

    def forget(self) -> None:
        """Removes what it would have gone on from."""
        if self.file is not None:
            for path in (self.file, before(self.file)):
                path.unlink(missing_ok=True)


def rehearse(
    scenario: ResectionScenario, progress: Progress, file: Path | None = None
) -> Rehearsal:
    """Plans, carries out, measures and mends until nothing more can be done.

    Args:
        scenario: Of the resection.
        progress: Shows how far it is.
        file: Where it is saved after each round, and goes on from if it was killed.

    Raises:
        ValueError: If tumour, access or the file make no sense.
    """
    rounds = Rounds(scenario, progress, file)
    while not rounds.ended:
        rounds.run()
    rounds.forget()
    return rounds.told
