"""`trocar resect NAME --execute`: procedures are chosen while the robot works.

Lines of a terminal are heard at the instant at which they are typed, the robot keeps to
the clock on the wall meanwhile; what comes by a pipe is all said at the beginning. The
results are a run's, with the lines in `inputs`: `trocar run DIR/scenario.yaml` chooses
the same again.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from time import perf_counter, sleep
from typing import Any

import yaml

from diagrams.common.progress import progress_bar
from diagrams.common.run import Run, prepare, run_scenario
from diagrams.resection.online import save_choices
from diagrams.resection.scenario import ResectionScenario
from systems.common.archive import beside, whole
from systems.resection.wires.online_player import Wait

LATE = 0.05
"""By which the robot may lag behind the clock and catch up, in s."""


class Listener:
    """Hears lines while the robot works, at the pace of the clock on the wall."""

    def __init__(self, lines: Iterable[str], speed: float) -> None:
        """Begins to listen.

        Args:
            lines: Said by somebody; the last, or `quit`, means `end`.
            speed: Simulated seconds a second; 0 to hear all at once, and not to wait.
        """
        self._heard: SimpleQueue[str] = SimpleQueue()
        self._speed, self._begin, self._last = speed, 0.0, -1.0
        self._listens = Thread(target=self._listen, args=(lines,), daemon=True)
        self._listens.start()
        if speed == 0.0:
            self._listens.join()

    def _listen(self, lines: Iterable[str]) -> None:
        for line in lines:
            words = line.split()
            if words[:1] in (["quit"], ["exit"]):
                break
            if words:
                self._heard.put(line.strip())
        self._heard.put("end")

    def hear(self, time: float) -> list[str]:
        """Waits until it is time, and returns what has been said."""
        if self._speed > 0.0:
            now = perf_counter()
            if time < self._last or self._last < 0.0:  # it begins, perhaps again
                self._begin = now - time / self._speed
            late = now - (self._begin + time / self._speed)
            if late < 0.0:
                sleep(-late)
            self._begin += max(late - LATE, 0.0)
            self._last = time
        return [self._heard.get() for _ in range(self._heard.qsize())]


def operate(
    scenario: ResectionScenario,
    file: Path,
    lines: Iterable[str],
    out: Path,
    speed: float = 1.0,
    tell: Callable[[str], Any] = print,
    with_replay: bool = True,
) -> Run:
    """Carries out what is chosen meanwhile.

    Args:
        scenario: Of the resection.
        file: The session's; if it is there, with its execution, it goes on.
        lines: Of the console.
        out: Folder of the results.
        speed: Simulated seconds a second; 0 for as fast as it goes, all lines at once.
        tell: Is told what is answered, and why the robot waits.
        with_replay: Whether a replay is drawn.

    Raises:
        ScenarioError: If the scenario cannot run, or the folder not be written.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    case: Any = prepare(replace(scenario, session=str(file), choices=""), progress_bar)
    choosing, kept = case.choosing, beside(file, "choices.csv")
    choosing.hear = lambda line, answer: tell(f"> {line}\n{answer}".rstrip())
    choosing.heed = lambda time, reason: tell(f"{time:.1f} s: {words(reason)}")
    choosing.book.hear = Listener(lines, speed).hear
    save_choices(kept, [])
    case.scenario.choices = str(kept)  # copied with the results
    try:
        return run_scenario(case, out, with_replay)
    finally:
        save_choices(kept, choosing.lines)
        if (out / "scenario.yaml").is_file():
            save_choices(out / "inputs" / kept.name, choosing.lines)
            if choosing.is_whole:
                _begin_anew(out / "scenario.yaml")


def words(reason: int) -> str:
    """Why the robot waits, by the code of a `Wait`."""
    return next(wait.text for wait in Wait if wait == reason)


def _begin_anew(path: Path) -> None:
    """Lets a scenario's file begin without the session, which is at its end."""
    tree = yaml.safe_load(path.read_text(encoding="utf-8"))
    with whole(path) as draft:
        text = yaml.safe_dump(tree | {"session": ""}, sort_keys=False)
        draft.write_text(text, encoding="utf-8")
