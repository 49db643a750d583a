"""Procedures chosen while the robot works: the console's lines, each at its time.

A line is answered in the running diagram (`ProcedureChooser`) against what will be free
once all that was accepted before is done. What has been chosen is kept beside the
session's file, so that a run that was killed goes on with the lines that are left.
"""

from collections.abc import Callable, Iterable
import csv
from dataclasses import replace
import io
import json
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

from diagrams.common.progress import Progress, silent
from diagrams.resection import operation
from diagrams.resection.console import HELP, Console
from diagrams.resection.operation import Operation, finish_plan, reach_of, waits_of
from diagrams.resection.scenario import ResectionScenario
from systems.common.archive import beside, read_regular, whole
from systems.resection.planning.session import Session
from systems.resection.wires.online_player import Page, Wait
from systems.resection.wires.procedure_chooser import Book

MORE = """\
while the robot works: what is committed is carried out, one step after the other
stop | go                            begin no further step | go on
home                                 the way back into the channel is a step, too
end                                  no more will be chosen: home, and that is all"""

_LARGEST_FILE = 16_000_000
FIELDS = ["t", "line"]

type Line = tuple[float, str]


def load_choices(path: Path) -> list[Line]:
    """Reads lines of the console and when they are said, CSV `t,line`.

    Raises:
        ValueError: If the file cannot be read or is no such table; line and file are
            named.
    """
    try:
        text = read_regular(path, _LARGEST_FILE).decode("utf-8")
        rows = list(csv.reader(io.StringIO(text, newline="")))
    except OSError as error:
        raise ValueError(f"choices {path}: cannot be read: {error.strerror}") from error
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"choices {path}: cannot be read as CSV") from error
    if not rows or rows[0] != FIELDS:
        raise ValueError(f"choices {path}, line 1: expected {','.join(FIELDS)!r}")
    lines: list[Line] = []
    for number, row in enumerate(rows[1:], start=2):
        try:
            time, line = float(row[0]), row[1]
        except (ValueError, IndexError):
            time, line = np.nan, ""
        if len(row) != len(FIELDS) or not 0.0 <= time < np.inf or not line.strip():
            raise ValueError(
                f"choices {path}, line {number}: expected a time in s and a line"
            )
        if lines and time < lines[-1][0]:
            raise ValueError(f"choices {path}, line {number}: times must not fall")
        lines.append((time, line))
    return lines


def save_choices(path: Path, lines: Iterable[Line]) -> None:
    """Writes lines as `load_choices` reads them."""
    stream = io.StringIO(newline="")
    rows = csv.writer(stream, lineterminator="\n")
    rows.writerow(FIELDS)
    rows.writerows([repr(float(time)), line] for time, line in lines)
    with whole(path) as draft:
        draft.write_text(stream.getvalue(), encoding="utf-8")


class OnlineConsole(Console):
    """A console whose plan is being carried out."""

    def __init__(
        self, session: Session, scenario: ResectionScenario, progress: Progress
    ) -> None:
        """Makes a console with nothing proposed, and nothing taken."""
        super().__init__(session, scenario, progress)
        self.taken = 0
        self.is_stopped = self.is_over = False

    def _do(self, words: list[str]) -> str:
        command = words[0]
        if command in ("stop", "go") and len(words) == 1:
            self.is_stopped = command == "stop"
            return "no further step is begun" if self.is_stopped else "it goes on"
        if self.is_over:
            raise ValueError("it was said that no more will be chosen")
        steps = self.session.steps
        if command in ("home", "end") and len(words) == 1:
            self.is_over = command == "end"
            if steps and steps[-1].kind != "home" and not self.is_stopped:
                self.session.go_home()
            return self._share()
        if command == "undo" and steps and steps[-1].first <= self.taken:
            raise ValueError("the robot has begun that step: it cannot be undone")
        if command == "update":
            raise ValueError(
                "an image is taken between two runs: end this one, and `update` then"
            )
        if command == "finish":
            # What could be reached at first, as if all were planned before.
            reach = self.reach or reach_of(self.session, self.scenario, self.progress)
            self.reach = finish_plan(self.session, reach, self.scenario, self.progress)
            return self._share()
        text = super()._do(words)
        return f"{HELP}\n{MORE}" if text == HELP else text


class Choosing:
    """The lines of a run, and what they came to.

    Attributes:
        console: Answers them.
        book: The plans after each, for the diagram.
        told: Of each line answered in this run when it was, the line, and the answer.
        planning_time: Wall time of all answers, in s.
        hear: Called with each line and its answer.
        heed: Called with the time in s of this run and a `Wait` when that is another.
    """

    def __init__(
        self, case: Operation, progress: Progress, lines: list[Line] | None
    ) -> None:
        """Makes what chooses.

        Args:
            case: As it stands before anything is chosen; its session is changed.
            progress: Shows how far long work is.
            lines: Of a file, by the time of the whole operation; None if somebody is
                there who will say them.
        """
        session, scenario, done = case.session, case.scenario, case.done
        self.console = OnlineConsole(session, scenario, progress)
        self.console.reach = case.reach
        self.told: list[tuple[float, str, str]] = []
        self.planning_time = 0.0
        self.hear: Callable[[str, str], None] = lambda line, answer: None
        self.heed: Callable[[float, int], None] = lambda time, reason: None
        self._reason = int(Wait.PLAYING)
        self._before = done.time
        self._rows: list[tuple[float, int, str]] = []
        if session.file is not None:
            self._rows = _kept(beside(session.file, "choices"))
        count = answered(self._rows, len(session.steps))
        for _, _, line in self._rows[:count]:
            if line.strip() in ("stop", "go"):
                self.console.is_stopped = line.strip() == "stop"
        left = ended(lines, scenario)[count:] if lines is not None else []
        del self._rows[count:]
        due = [(max(time - done.time, 0.0), line) for time, line in left]
        self.book = Book(self.page(), self.answer, due)
        self.book.heed = self._heed

    @property
    def lines(self) -> list[Line]:
        """All that was said so far, in this run and those before."""
        return [(time, line) for time, _, line in self._rows]

    @property
    def is_whole(self) -> bool:
        """Whether the lines, after the scenario's procedures, made the whole plan."""
        first = self._rows[0][1] if self._rows else 0
        return first <= len(self.console.scenario.procedures)

    def page(self) -> Page:
        """The plan as it stands."""
        console = self.console
        session = console.session
        return Page(
            session.postures,
            tuple(step.last - 1 for step in session.steps if step.last > step.first),
            session.entries.astype(float),
            session.tool_radii,
            waits_of(session, console.scenario),
            console.is_stopped,
            console.is_over,
        )

    def answer(self, line: str, taken: int, time: float) -> Page:
        """Answers a line, and returns the plan then; see `Book`."""
        console, start = self.console, perf_counter()
        console.taken = taken
        self._rows.append((self._before + time, len(console.session.steps), line))
        if console.session.file is not None:
            _keep(beside(console.session.file, "choices"), self._rows)
        before = self._standing()
        text = console.answer(line)
        self.planning_time += perf_counter() - start
        self.told.append((self._before + time, line, text))
        self.hear(line, text)
        last = self.book.pages[-1]
        if self._standing() != before:
            return self.page()
        return replace(last, is_stopped=console.is_stopped, is_over=console.is_over)

    def _heed(self, time: float, reason: int) -> None:
        if reason != self._reason:
            self._reason = reason
            self.heed(time, reason)

    def _standing(self) -> tuple[int, ...]:
        session = self.console.session
        return len(session.steps), *session.standing()

    def figures(self, run: Any) -> dict[str, Any]:
        """What is told of a run besides."""
        waiting = ~np.isin(run.plan.waiting.reason[1:], (Wait.PLAYING, Wait.OVER))
        return {
            "time_waited": float(np.sum(np.diff(run.signals["time"])[waiting])),
            "choices": [
                {"start": time, "line": line, "answer": text}
                for time, line, text in self.told
            ],
        }


def prepare(scenario: ResectionScenario, progress: Progress) -> Operation:
    """As `operation.prepare`; with what chooses while the robot works, if anything."""
    case = operation.prepare(scenario, progress)
    if scenario.choices is not None:
        file = Path(scenario.choices) if scenario.choices else None
        lines = load_choices(file) if file else None
        case.choosing = Choosing(case, progress, lines)
    return case


def outline(scenario: ResectionScenario) -> Operation:
    """As `operation.outline`, with the same blocks as `prepare` has it."""
    case = operation.outline(scenario)
    if scenario.choices is not None:
        case.choosing = Choosing(case, silent, None)
    return case


def is_over(case: Operation, station: Any, context: Any) -> bool:
    """Whether all that was chosen is done, and no more will be."""
    if case.choosing is None:
        return False

    def told(block: str, port: str) -> int:
        system = station.GetSubsystemByName(block)
        value = system.GetOutputPort(port).Eval(system.GetMyContextFromRoot(context))
        return int(value[0])

    page = case.choosing.book.pages[told("procedure_chooser", "accepted")]
    waits = told("procedure_player", "waiting") in (Wait.OVER, Wait.TOLD)
    return page.is_over and waits


def ended(lines: list[Line], scenario: ResectionScenario) -> list[Line]:
    """The lines of a file with those that end them."""
    last = lines[-1][0] if lines else 0.0
    if any(line.split()[:1] == ["end"] for _, line in lines):
        return lines
    finish = [(last, "finish")] if scenario.automatic else []
    return [*lines, *finish, (last, "end")]


def answered(rows: list[tuple[float, int, str]], steps: int) -> int:
    """How many lines need not be said again to a session of so many steps.

    Lines after the last that changed it are: what they proposed is not kept.

    Args:
        rows: Of each line its time, the steps there were before it, and the line.
        steps: That there are now.
    """
    counts = [*(before for _, before, _ in rows), steps]
    changed = [n + 1 for n in range(len(rows)) if counts[n] != counts[n + 1]]
    if changed and changed[-1] == len(rows) and rows[-1][2].split()[0] == "finish":
        return len(rows) - 1  # it may have been cut off, and goes on
    return changed[-1] if changed else 0


def _kept(path: Path) -> list[tuple[float, int, str]]:
    if not path.is_file():
        return []
    try:
        rows = json.loads(path.read_text(encoding="utf-8"))
        return [(float(time), int(steps), str(line)) for time, steps, line in rows]
    except (ValueError, TypeError) as error:
        raise ValueError(f"choices {str(path)!r} are damaged: {error}") from error


def _keep(path: Path, rows: list[tuple[float, int, str]]) -> None:
    with whole(path) as draft:
        draft.write_text(json.dumps(rows) + "\n", encoding="utf-8")
