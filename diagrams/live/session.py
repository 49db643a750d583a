"""A scenario in real time: whoever watches, or another program, takes part.

What is done is a tape for each that is guided, and faults that begin when a button was
pressed; the scenario that plays them back is the run that was seen.
"""

from copy import deepcopy
from dataclasses import replace
from pathlib import Path
from time import sleep
from typing import Any

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.geometry import MeshcatVisualizer, MeshcatVisualizerParams, Role
from pydrake.systems.framework import DiagramBuilder

from diagrams.common.live import Figure, Live
from diagrams.common.pace import Pace
from diagrams.common.progress import silent
from diagrams.common.replay import QUERY_PORT, dress
from diagrams.common.run import start
from diagrams.common.scenario import ScenarioError, refusals
from diagrams.live.page import Page
from diagrams.studies import STUDIES, build, check_scenario, get_study
from plants.faults.fault import Fault
from systems.common.signal import flat, view
from systems.common.tape import save_tape

DRAWN = 1.0 / 30.0
"""Between two pictures, and what other programs are told [s]."""
READ = 0.1
"""Between two updates of the figures [s]."""
NEVER = 1e5
"""When a fault begins that nobody has asked for [s]."""
USUAL = ("pause", "reset", "another seed", "end and save")
"""Buttons of every session, about those of the system."""


def spans(starts: list[float], lasting: float) -> list[tuple[float, float]]:
    """From when to when something is on that lasts so long after each of its starts."""
    found: list[tuple[float, float]] = []
    for struck in starts:
        goes_on = found and struck <= found[-1][1]
        first = found.pop()[0] if goes_on else struck
        found.append((first, struck + lasting))
    return found


class Session:
    """One go at a scenario; `frame` steps it, `save` keeps what was done.

    Attributes:
        case: What runs, prepared.
        scenario: Its scenario, whatever moves by itself what is guided taken away.
        time: Simulated [s].
        speed: Of the robot [m/s].
        is_paused: Whether time stands.
        is_over: Whether somebody has ended it.
        lag: How far the frames were behind the clock [s], one a frame.
        words: Why the robot stands, or what it does.
    """

    def __init__(
        self, scenario: Any, page: Page | None, tracker: Any = None, stream: Any = None
    ) -> None:
        """Builds the diagram and its page.

        Args:
            scenario: Of a system that can be run live.
            page: Where it is shown; None for nowhere.
            tracker: A `connect.tracker.Tracker` that sees tools.
            stream: A `connect.stream.Stream` that tells what is where.

        Raises:
            ScenarioError: If its system cannot be run live, or has no tracker.
        """
        study = get_study(scenario.system)
        if study.live is None:
            able = ", ".join(name for name, other in STUDIES.items() if other.live)
            raise ScenarioError(f"system={study.name!r}: expected one of {able}")
        self._study, self._live = study, study.live
        self._every = {
            seconds: max(1, round(seconds / study.live.frame))
            for seconds in (DRAWN, READ)
        }
        self._page, self._tracker, self._stream = page, tracker, stream
        self.is_paused = self.is_over = False
        self.lag: list[float] = []
        self.words = ""
        self._begin(scenario)

    def _begin(self, scenario: Any) -> None:
        """Begins anew."""
        self._asked = scenario
        live: Live = self._live
        played = deepcopy(scenario)
        seen = self._tracker.tools if self._tracker else ()
        self._guided = [one for one in live.tracked(played) if one.name in seen]
        if self._page:
            self._guided += [o for o in live.guided(played) if o.name not in seen]
        if self._guided:
            played = live.held(played, [one.name for one in self._guided])
        for one in self._guided:
            setattr(one.owner(played), one.field, "")
        self._first_switch = len(played.faults)
        self._switches = live.switches(played) if self._page else []
        played.faults = played.faults + [
            Fault(s.kind, NEVER, s.lasting, s.size) for s in self._switches
        ]
        check_scenario(played)
        self.scenario = played
        with refusals():
            self.case = self._study.prepare(played, silent)
        builder = DiagramBuilder()
        self.station = builder.AddNamedSystem("station", build(self.case))
        self._visualizer = None
        if self._page and self.station.HasOutputPort(QUERY_PORT):
            self._visualizer = MeshcatVisualizer.AddToBuilder(
                builder,
                self.station.GetOutputPort(QUERY_PORT),
                self._page.meshcat,
                MeshcatVisualizerParams(
                    role=Role.kIllustration, prefix="scene", publish_period=1e6
                ),
            )
        self._root = builder.Build()
        self._simulator = start(self._root, self._study.integrator(played))
        self._context = self._simulator.get_mutable_context()
        self._root.SetRandomContext(self._context, RandomGenerator(played.seed))
        self._simulator.Initialize()
        self.time, self._count, self.speed = 0.0, 0, 0.0
        self._struck: list[list[float]] = [[] for _ in self._switches]
        self._acts = live.acts(played) if self._page else {}
        self._figures = live.figures(played)
        if live.moving:
            most = 1e3 * live.fastest
            self._figures.append(
                Figure("speed [mm/s]", lambda session: session.speed, 0.0, most, 1.0)
            )
            self._point = np.array(live.moving(self))
        self._said: dict[str, list[tuple[float, np.ndarray]]] = {}
        for one in self._guided:
            self._said[one.name] = []
        if self._page:
            dress(self._page.meshcat, self._study.view)
            labels = [s.label for s in self._switches]
            buttons = [USUAL[0], *self._acts, *labels, *USUAL[1:]]
            by_hand = [one for one in self._guided if one.sliders]
            self._page.lay_out(by_hand, buttons, self._figures)
        self._draw()
        self._show()

    def values(self, port: str) -> np.ndarray:
        """Elements of an exported signal of the diagram, now."""
        told = self.station.GetOutputPort(port)
        context = self.station.GetMyContextFromRoot(self._context)
        return np.array(told.Eval(context))

    def read(self, port: str, signal: Any) -> Any:
        """An exported signal of the diagram, now."""
        return view(signal, self.values(port))

    def wanted(self, name: str) -> np.ndarray:
        """What was said last of what is guided."""
        one = next(one for one in self._guided if one.name == name)
        rows = self._said[name]
        return rows[-1][1] if rows else flat(one.rest)

    def put(self, name: str, value: Any) -> None:
        """Moves the sliders of what is guided, if somebody guides it here."""
        for one in self._guided:
            if one.name == name and self._page and one.sliders:
                self._page.put(one, value)

    def frame(self) -> None:
        """Hears what is outside, and simulates a frame if it is not paused."""
        if self._tracker:
            self._tracker.poll()
        self._obey()
        if self.is_paused or self.is_over:
            return
        self._hear()
        self._count += 1
        self.time = self._due()
        if self._is_due(DRAWN, 1):
            self._study.adjust(self.case, self.station, self._context)
        self._simulator.AdvanceTo(self.time)
        if self._live.moving:
            point = np.array(self._live.moving(self))
            self.speed = float(np.linalg.norm(point - self._point)) / self._live.frame
            self._point = point
        if self._is_due(DRAWN):
            self._draw()
            self._tell()
        if self._is_due(READ):
            self._show()

    def _due(self) -> float:
        """When the frame ends [s].

        Every so often it is a frame of the replay, whose time is taken to the last
        digit: the integrator takes a step for a difference of that.
        """
        shown = 1.0 / self._study.frame_rate
        every = max(1, round(shown / self._live.frame))
        frames, rest = divmod(self._count, every)
        return self._count * self._live.frame if rest else frames * shown

    def _is_due(self, seconds: float, since: int = 0) -> bool:
        """Whether something is to be done that comes so often, `since` frames later."""
        return (self._count - since) % self._every[seconds] == 0

    def _hear(self) -> None:
        """Says in the diagram what people and other programs say."""
        if self._page:
            self._page.move_by_gamepad(self._live.frame)
        for one in self._guided:
            before = self.wanted(one.name)
            if one.sliders and self._page:
                value = self._page.wanted(one)
            elif self._tracker and not one.sliders:
                last = view(one.signal, before)
                value = flat(self._tracker.sighting(one.name, last))
            else:
                value = before
            rows = self._said[one.name]
            if rows and np.array_equal(value, before):
                continue
            rows.append((self._context.get_time(), value))
            block = self.station.GetSubsystemByName(f"{one.name}_outside")
            block.say(self._context, value)

    def _obey(self) -> None:
        """Does what the buttons say."""
        for name in self._page.clicked() if self._page else []:
            self.press(name)

    def press(self, name: str) -> None:
        """Does what a button says."""
        if name == "pause":
            self.is_paused = not self.is_paused
        elif name == "end and save":
            self.is_over = True
        elif name in ("reset", "another seed"):
            more = int(name == "another seed")
            self._begin(replace(self._asked, seed=self._asked.seed + more))
        elif name in self._acts:
            self._acts[name](self)
        else:
            labels = [switch.label for switch in self._switches]
            self._strike(labels.index(name))

    def _strike(self, index: int) -> None:
        """Lets a fault begin, in all wires that it is in."""
        if self.is_paused:
            return
        mark = f"fault{self._first_switch + index}_"
        wires = [s for s in self.station.GetSystems() if s.get_name().startswith(mark)]
        struck = {wire.strike(self._context) for wire in wires}
        self._struck[index] += struck

    def _draw(self) -> None:
        if self._visualizer is not None:
            context = self._visualizer.GetMyContextFromRoot(self._context)
            self._visualizer.ForcedPublish(context)

    def _show(self) -> None:
        """Brings the figures up to date, and says why the robot stands, once."""
        words = self._live.words(self)
        if self._tracker:
            words = "; ".join(filter(None, [words, f"tracker {self._tracker.told()}"]))
        if words != self.words:
            print(f"{self.time:7.2f} s  {words}")
        self.words = words
        if self._page:
            values = [figure.value(self) for figure in self._figures]
            self._page.show(values, words)

    def _tell(self) -> None:
        """Tells other programs what is where."""
        if self._stream:
            self._stream.tell(self._live.streamed(self), self.words)

    def play(self, duration: float, speed: float = 1.0) -> None:
        """Runs in real time until it is over or has lasted so long.

        Args:
            duration: Simulated seconds at the most.
            speed: Simulated seconds a second.
        """
        pace, due = Pace(speed), 0.0  # time stands while it is paused
        pace.late(due)
        while self.time < duration - 1e-9 and not self.is_over:
            self.frame()
            due += self._live.frame
            late = pace.late(due)
            self.lag.append(max(0.0, late))
            sleep(max(-late, 0.0))

    def save(self, folder: Path) -> Any:
        """Writes the tape of all that was guided.

        Returns:
            The scenario that plays it back.

        Raises:
            ScenarioError: If nothing was simulated.
        """
        if self._count < 2:
            raise ScenarioError("nothing to save: the run was ended before it began")
        folder.mkdir(parents=True, exist_ok=True)
        played = deepcopy(self.scenario)
        for one in self._guided:
            path = folder / f"{one.name}_recording.csv"
            times, rows = zip(*self._said[one.name], strict=True)
            save_tape(path, one.signal, times, rows)
            setattr(one.owner(played), one.field, str(path.absolute()))
        faults = played.faults[: self._first_switch]
        for switch, starts in zip(self._switches, self._struck, strict=True):
            faults += [
                Fault(switch.kind, start, end - start, switch.size)
                # One that never was stays: its samples end the integrator's steps.
                for start, end in spans(starts or [NEVER], switch.lasting)
            ]
        return replace(played, duration=self.time, faults=faults)
