"""`trocar resect`: a resection session in the terminal, line by line.

Every line is a command; the session is saved after every commit, so a session that
was killed goes on where it was.
"""

from collections.abc import Iterable
from pathlib import Path
import shlex

from diagrams.common.progress import Progress, progress_bar
from diagrams.common.scenario import refusals
from diagrams.resection.operation import finish_plan, new_session, reach_of, resumed
from diagrams.resection.scenario import ResectionScenario
from plants.tissue.labels import TUMOUR
from plants.tissue.mask import load_mask
from systems.resection.planning.feasibility import place
from systems.resection.planning.feasibility_map import FeasibilityMap, feasibility_map
from systems.resection.planning.next_entry import NextEntry, next_entries
from systems.resection.planning.next_tool import next_tools
from systems.resection.planning.planner import Planner
from systems.resection.planning.procedure import (
    ELEMENTARY,
    ENTRY,
    VOLUME,
    Procedure,
    check_procedure,
    load_procedures,
    save_procedures,
)
from systems.resection.planning.reach import Reach
from systems.resection.planning.session import Session
from systems.resection.planning.trial import Preview

HELP = """\
entry LENGTH RADIUS                  propose an entry procedure [mm]
elementary X Y Z NX NY NZ LENGTH RADIUS   an elementary procedure [mm], axis N
volume X Y Z NX NY NZ RADIUS         an elementary volume [mm]
   add `clipped` to leave out poses that fail; the paper's shape is refused whole
suggest                              propose what gains most of some the planner tries
check | commit | undo                ask of the proposal, make it part of the plan
map                                  where elementary volumes are feasible now
reach                                what can be reached at all, and why the rest not
finish                               let the planner do the rest
entries | access N                   what further entries would add | take the N-th
tools | tool R                       what another ball would add | change to one [mm]
update FILE                          an image taken meanwhile replaces the mask
list | quit                          the plan; the session is saved
save FILE | load FILE                its procedures as JSON; commit those of a file"""


def procedure_from(words: list[str]) -> Procedure:
    """A procedure from a command's words; lengths in mm.

    Raises:
        ValueError: If there are not the numbers that it needs.
    """
    clipped = "clipped" in words
    kind = words[0]
    needed = {ENTRY: 2, ELEMENTARY: 8, VOLUME: 7}[kind]
    rest = [word for word in words[1:] if word != "clipped"]
    try:
        numbers = [float(word) for word in rest]
    except ValueError as error:
        raise ValueError(f"{kind}: {rest} must be numbers") from error
    if len(numbers) != needed:
        raise ValueError(f"{kind} takes {needed} numbers, not {len(numbers)}")
    if kind == ENTRY:
        length, radius = (1e-3 * v for v in numbers)
        return Procedure(ENTRY, None, None, length, radius, clipped)
    position, axis = [1e-3 * v for v in numbers[:3]], numbers[3:6]
    length = 1e-3 * numbers[6] if kind == ELEMENTARY else 0.0
    return Procedure(kind, position, axis, length, 1e-3 * numbers[-1], clipped)


class Console:
    """A session that takes lines and answers with text."""

    def __init__(
        self,
        session: Session,
        scenario: ResectionScenario,
        progress: Progress = progress_bar,
    ) -> None:
        """Makes a console with nothing proposed.

        `preview` is how the proposal was found to go, `map` and `reach` are what was
        found last; None before.
        """
        self.session = session
        self.scenario = scenario
        self.progress = progress
        self.proposal: Procedure | None = None
        self.preview: Preview | None = None
        self.map: FeasibilityMap | None = None
        self.reach: Reach | None = None
        self.further: list[NextEntry] = []

    def answer(self, line: str) -> str:
        """Does what a line says; bad input is answered, never raised."""
        try:
            words = shlex.split(line, comments=True)
            return self._do(words) if words else ""
        except (ValueError, OSError) as error:
            return f"error: {error}"

    def _do(self, words: list[str]) -> str:
        command = words[0]
        if command in (ENTRY, ELEMENTARY, VOLUME):
            self.proposal = self.preview = None  # none is left after a bad line
            proposal = procedure_from(words)
            check_procedure(proposal, self.session.params)
            self.proposal = proposal
            return self._check()
        if command == "suggest":
            return self._suggest()
        if command == "check":
            return self._check()
        if command == "commit":
            return self._commit()
        if command == "undo":
            return f"took back {self.session.undo().name}; {self._share()}"
        if command == "map":
            self.map = feasibility_map(self.session)
            return told_map(self.map)
        if command == "reach":
            self.reach = reach_of(self.session, self.scenario, self.progress)
            return told_reach(self.reach)
        if command == "finish":
            reach = reach_of(self.session, self.scenario, self.progress)
            reach = finish_plan(self.session, reach, self.scenario, self.progress)
            self.reach = reach
            return f"{self._share()}, {100 * reach.fraction:.1f} % are reachable"
        if command == "entries":
            with self.progress("further entries", "of those tried") as show:
                self.further = next_entries(
                    self.session,
                    self.scenario.entries,
                    self.scenario.seed,
                    lambda share: show(share, 1.0),
                )
            rows = [entry.text(self.session.volume) for entry in self.further]
            return "\n".join(f"{n}: {row}" for n, row in enumerate(rows, 1)) or "none"
        if command == "access":
            return self._access(words[1:])
        if command == "tools":
            tools = next_tools(self.session, self.scenario.balls, self.scenario.seed)
            return "\n".join(tool.text() for tool in tools) or "none"
        if command == "tool" and len(words) == 2:
            step = self.session.change_tool(1e-3 * float(words[1]))
            return f"{step.name}; {self._share()}"
        if command == "update" and len(words) == 2:
            self.session.update(load_mask(words[1], self.scenario.labels))
            return f"updated; {self._share()}"
        if command == "list":
            rows = [
                f"{n}: {step.name}, {1e9 * step.gained:.0f} mm3"
                for n, step in enumerate(self.session.steps, 1)
            ]
            return "\n".join([*rows, self._share()])
        if command == "save" and len(words) == 2:
            chosen = [s.procedure for s in self.session.steps if s.procedure]
            save_procedures(chosen, Path(words[1]))
            return f"{len(chosen)} procedures: {words[1]}"
        if command == "load" and len(words) == 2:
            return self._load(Path(words[1]))
        return HELP

    def _access(self, words: list[str]) -> str:
        chosen = int(words[0]) if len(words) == 1 and words[0].isdigit() else 0
        if not 1 <= chosen <= len(self.further):
            raise ValueError(
                f"access {' '.join(words)}: expected one number, 1 to "
                f"{len(self.further)}, of the list that `entries` gives"
            )
        step = self.session.enter_anew(self.further[chosen - 1].X_WE)
        self.further = []
        return f"{step.name}; {self._share()}"

    def _suggest(self) -> str:
        tumour = self.session.volume.labels == TUMOUR
        planner = Planner(self.session, tumour, self.scenario.planner)
        good = planner.suggest()
        if not good:
            return "nothing that was tried gains enough; try `finish`"
        self.proposal = good[0]
        axis = ", ".join(f"{v:.2f}" for v in good[0].axis())
        return (
            f"{1e3 * good[0].length:.0f} mm from {place(good[0].position)} "
            f"along ({axis}): " + (self._check())
        )

    def _load(self, path: Path) -> str:
        rows = []
        for procedure in load_procedures(path):
            self.proposal = procedure
            rows.append(f"{procedure.name or procedure.kind}: {self._commit()}")
        return "\n".join(rows)

    def _check(self) -> str:
        if self.proposal is None:
            raise ValueError("nothing is proposed yet")
        self.preview = self.session.preview(self.proposal)
        answer = self.preview.answer
        return answer.text if answer.feasible else f"{answer.reason}: {answer.text}"

    def _commit(self) -> str:
        if self.proposal is None:
            raise ValueError("nothing is proposed yet")
        answer = self.session.commit(self.proposal)
        if not answer.feasible:
            return f"{answer.reason}: {answer.text}"
        self.proposal = self.preview = None
        return f"committed, {self._share()}"

    def _share(self) -> str:
        return f"{100 * self.session.fraction:.1f} % of the tumour planned"


def told_map(found: FeasibilityMap) -> str:
    """A map as text: how much is feasible, and the five best places."""
    yes = found.feasible
    rows = [f"feasible at {yes.sum()} of {len(yes)} points"]
    for n in found.gained.argsort()[::-1][:5]:
        if found.gained[n] > 0.0:
            rows.append(
                f"  {1e9 * found.gained[n]:.0f} mm3 at {place(found.points[n])}"
            )
    return "\n".join(rows)


def told_reach(reach: Reach) -> str:
    """What can be reached as text, and why the five largest parts cannot."""
    rows = [f"{100 * reach.fraction:.1f} % of the tumour can be reached"]
    for lump in reach.lumps[:5]:
        volume = f"{1e9 * lump.volume:.0f} mm3"
        rows.append(f"  not {volume} at {place(lump.where)}: {lump.reason}")
    return "\n".join(rows)


def open_session(scenario: ResectionScenario, file: Path) -> Session:
    """The session of a file, resumed, or a new one that is saved to it.

    Raises:
        ScenarioError: If the file is damaged or the scenario makes no session.
    """
    with refusals():
        session, _ = new_session(scenario)
        if file.exists():
            session = resumed(file, session)
    session.file = file
    session.save(file)
    return session


def run_console(
    scenario: ResectionScenario, file: Path, lines: Iterable[str], prompt: bool
) -> None:
    """Answers lines until they end or say quit."""
    console = Console(open_session(scenario, file), scenario)
    print(f"session {file}; {console.answer('list')}; `help` lists the commands")
    if prompt:
        print("> ", end="", flush=True)
    for line in lines:
        if line.strip() in ("quit", "exit"):
            break
        text = console.answer(line)
        if text:
            print(text)
        if prompt:
            print("> ", end="", flush=True)
