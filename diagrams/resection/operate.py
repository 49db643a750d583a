"""`trocar resect NAME --execute`: procedures are chosen while the robot works.

Lines of a terminal are heard at the instant at which they are typed, the robot keeps to
the clock on the wall meanwhile; what comes by a pipe is all said at the beginning. The
results are a run's, with the lines in `inputs`: `trocar run DIR/scenario.yaml` chooses
the same again.
"""

from collections.abc import Callable, Iterable
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from queue import SimpleQueue
from threading import Thread
from time import monotonic, sleep
from typing import Any

import yaml

from diagrams.common.pace import Pace
from diagrams.common.progress import progress_bar
from diagrams.common.replay import start_meshcat
from diagrams.common.run import Run, prepare, run_scenario
from diagrams.resection.browser import serve
from diagrams.resection.desk import Desk
from diagrams.resection.online import save_choices
from diagrams.resection.operation import Operation
from diagrams.resection.scenario import ResectionScenario
from systems.common.archive import beside, whole
from systems.resection.wires.online_player import Wait


class Listener:
    """Hears lines while the robot works, at the pace of the clock on the wall."""

    def __init__(self, lines: Iterable[str], speed: float) -> None:
        """Begins to listen.

        Args:
            lines: Said by somebody; the last, or `quit`, means `end`.
            speed: Simulated seconds a second; 0 to hear all at once, and not to wait.
        """
        self._heard: SimpleQueue[str] = SimpleQueue()
        self._pace = Pace(speed)
        self._listens = Thread(target=self._listen, args=(lines,), daemon=True)
        self._listens.start()
        if speed == 0.0:
            self._listens.join()

    def _listen(self, lines: Iterable[str]) -> None:
        ends = False
        for line in lines:
            words = line.split()
            if words[:1] in (["quit"], ["exit"]):
                break
            ends = ends or words == ["end"]
            if words:
                self._heard.put(line.strip())
        if not ends:
            self._heard.put("end")

    def hear(self, time: float, taken: int) -> list[str]:
        """Waits until it is time, and returns what has been said."""
        sleep(self._pace.early(time))
        return [self._heard.get() for _ in range(self._heard.qsize())]


class OnlineDesk(Desk):
    """A desk whose plan is carried out; it works while the robot's clock waits."""

    def __init__(self, case: Operation, file: Path, meshcat: Any, speed: float) -> None:
        """Draws a case's session, and is heard by its robot from now on."""
        self._book, self._choosing = case.choosing.book, case.choosing
        self._time, self._taken, self._due = 0.0, 0, -1.0
        self._pace = Pace(speed)
        super().__init__(case.scenario, file, meshcat, self._choosing.console)
        self._book.hear, self._choosing.heed = self._hear, self._heed
        self._words = words(Wait.PLAYING)

    def _hear(self, time: float, taken: int) -> list[str]:
        """Does what the page wants until it is time; all is answered at once."""
        self._time, self._taken = time, taken
        steps = self.console.session.steps
        names = [step.name for step in steps if step.first <= taken < step.last]
        self.show["robot"] = f"{time:.0f} s: {', '.join([self._words, *names])}"
        self.turn(0.0)
        while (early := self._pace.early(time)) > 0.0:
            self.turn(early)
        if monotonic() > self._due:
            self._due = monotonic() + 0.5
            self._publish()
        return []

    def _heed(self, time: float, reason: int) -> None:
        self._words = words(reason)

    def want(self, what: str, told: Any) -> None:
        """As a desk's; what stops is the robot, after the present step."""
        super().want(*(("line", "stop") if what == "stop" else (what, told)))

    def _obey(self, line: str) -> None:
        line = "end" if line.strip() in ("quit", "exit") else line
        if self._proposed is not None and line.strip() != "map":
            self._said(self._proposed[0])
        super()._obey(line)

    def _said(self, line: str) -> str:
        """Has a line answered at this instant."""
        self._book.say(self._time, line)
        self._book.read(len(self._book.lines), self._taken, self._time)
        answer: str = self._choosing.told[-1][2]
        return answer


def operate(
    scenario: ResectionScenario,
    file: Path,
    out: Path,
    begin: Callable[[Operation], Any],
    with_replay: bool = True,
) -> Run:
    """Carries out what is chosen meanwhile.

    Args:
        scenario: Of the resection.
        file: The session's; if it is there, with its execution, it goes on.
        out: Folder of the results.
        begin: Sees to it that somebody chooses: `listened`, or a desk.
        with_replay: Whether a replay is drawn.

    Raises:
        ScenarioError: If the scenario cannot run, or the folder not be written.
    """
    file.parent.mkdir(parents=True, exist_ok=True)
    case: Any = prepare(replace(scenario, session=str(file), choices=""), progress_bar)
    choosing, kept = case.choosing, beside(file, "choices.csv")
    save_choices(kept, [])
    case.scenario.choices = str(kept)  # copied with the results
    begin(case)
    try:
        return run_scenario(case, out, with_replay)
    finally:
        save_choices(kept, choosing.lines)
        if (out / "scenario.yaml").is_file():
            save_choices(out / "inputs" / kept.name, choosing.lines)
            if choosing.is_whole:
                _begin_anew(out / "scenario.yaml")


def listened(
    lines: Iterable[str], speed: float = 1.0, tell: Callable[[str], Any] = print
) -> Callable[[Operation], None]:
    """Has somebody's lines heard, and tells what is answered and why it waits.

    Args:
        lines: Of the console.
        speed: Simulated seconds a second; 0 for as fast as it goes, all lines at once.
        tell: Is told the answers.
    """

    def begin(case: Operation) -> None:
        choosing = case.choosing
        choosing.hear = lambda line, answer: tell(f"> {line}\n{answer}".rstrip())
        choosing.heed = lambda time, reason: tell(f"{time:.1f} s: {words(reason)}")
        choosing.book.hear = Listener(lines, speed).hear

    return begin


def operate_by_page(
    scenario: ResectionScenario,
    file: Path,
    out: Path,
    speed: float = 1.0,
    host: str = "localhost",
    opened: Callable[[str], Any] = print,
) -> Run:
    """As `operate`, chosen on a page of the browser.

    Args:
        scenario: Of the resection.
        file: The session's.
        out: Folder of the results.
        speed: Simulated seconds a second.
        host: Where to listen.
        opened: Called with the page's address.
    """
    with ExitStack() as stack:

        def begin(case: Operation) -> None:
            desk = OnlineDesk(case, file, start_meshcat(host), speed)
            server, address = serve(desk, host)
            stack.callback(server.server_close)
            stack.callback(server.shutdown)
            stack.callback(desk.close)
            opened(address)

        return operate(scenario, file, out, begin)


def words(reason: int) -> str:
    """Why the robot waits, by the code of a `Wait`."""
    return next(wait.text for wait in Wait if wait == reason)


def _begin_anew(path: Path) -> None:
    """Lets a scenario's file begin without the session, which is at its end."""
    tree = yaml.safe_load(path.read_text(encoding="utf-8"))
    with whole(path) as draft:
        text = yaml.safe_dump(tree | {"session": ""}, sort_keys=False)
        draft.write_text(text, encoding="utf-8")
