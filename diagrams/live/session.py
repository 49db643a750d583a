"""A gauze delivery in real time: the surgeon's tools follow sliders or the keyboard.

Sliders, buttons and read-outs are Meshcat's own. What every hand did is kept as a
recording; a scenario that plays them back is the run that was seen.
"""

from collections.abc import Callable
from copy import deepcopy
from dataclasses import dataclass, replace
import itertools
from pathlib import Path
from time import perf_counter, sleep
from typing import Any

import numpy as np
from pydrake.common import RandomGenerator
from pydrake.geometry import MeshcatVisualizer, MeshcatVisualizerParams, Role
from pydrake.systems.framework import DiagramBuilder

from diagrams.common.replay import QUERY_PORT, dress
from diagrams.common.run import start
from diagrams.common.scenario import ScenarioError
from diagrams.gauze.diagram import make_gauze_diagram
from diagrams.gauze.tools import HandTool, hands
from diagrams.studies import get_study
from plants.surgeon.guided_tool import GuidedTool
from plants.surgeon.hunting_tool import Hunt
from plants.surgeon.recording import save_recording
from systems.common.signal import view
from systems.common.signals import Force, RobotTool, Shaft
from systems.common.stops import Stop

FRAME = 1.0 / 30.0
"""Between two looks at the sliders [s]."""
_READ = 3
"""Frames between two updates of the read-outs."""
_RANGE = 0.16
"""Of a slider about the tool's trocar [m]."""
KEYS = (
    (("KeyA", "KeyD"), ("KeyS", "KeyW"), ("KeyQ", "KeyE")),
    (("ArrowLeft", "ArrowRight"), ("ArrowDown", "ArrowUp"), ("PageDown", "PageUp")),
)
"""Of the first obstacle, then of the target: less and more of x, y and z."""
BUTTONS = ("pause", "push", "reset", "another seed", "end and save")


@dataclass(frozen=True)
class ReadOut:
    """A figure that is shown while it runs, as a slider that nobody moves."""

    name: str
    low: float
    high: float
    step: float
    value: Callable[["Session"], float]


def _gap(session: "Session") -> float:
    return 1e3 * float(session.port("clearance").min())


def _force(session: "Session") -> float:
    return float(np.linalg.norm(view(Force, session.port("wall.force")).f))


def _speed(session: "Session") -> float:
    return 1e3 * session.speed_of_robot


READ_OUTS = (
    ReadOut("> clearance [mm]", -5.0, 100.0, 0.1, _gap),
    ReadOut("> wall force [N]", 0.0, 10.0, 0.01, _force),
    ReadOut("> speed [mm/s]", 0.0, 150.0, 1.0, _speed),
)


class Session:
    """One go at a scenario; `frame` steps it, `save` keeps what was done.

    Attributes:
        scenario: What runs.
        time: Simulated [s].
        is_paused: Whether time stands.
        is_over: Whether somebody has ended it.
        lag: How far the frames were behind the clock [s], one a frame.
        stop: Why the robot stands; moving if it does not.
    """

    def __init__(self, scenario: Any, meshcat: Any) -> None:
        """Builds diagram, sliders and buttons.

        Args:
            scenario: Of a gauze delivery.
            meshcat: Where it is shown.

        Raises:
            ScenarioError: If it is of another system.
        """
        if scenario.system != "gauze":
            raise ScenarioError(
                f"system={scenario.system!r}: live is for gauze deliveries as yet, "
                "e.g. gauze_dynamic"
            )
        self._meshcat = meshcat
        self.is_paused = self.is_over = False
        self.lag: list[float] = []
        self._clicks = dict.fromkeys(BUTTONS, 0)
        for name in meshcat.GetSliderNames():
            meshcat.DeleteSlider(name)
        for name in meshcat.GetButtonNames():
            meshcat.DeleteButton(name)
        for name in BUTTONS:
            meshcat.AddButton(name, "Space" if name == "pause" else "")
        for out in READ_OUTS:
            meshcat.AddSlider(out.name, out.low, out.high, out.step, out.low)
        self._begin(scenario)

    def _begin(self, scenario: Any) -> None:
        """Begins anew."""
        self.scenario = scenario
        tools = hands(scenario.tools, scenario.seed)
        swaps = {f"{n}_tool": GuidedTool(_held(tool)) for n, tool in tools.items()}
        builder = DiagramBuilder()
        still = deepcopy(scenario)
        still.tools = [_held(t) if isinstance(t, HandTool) else t for t in still.tools]
        self._station = builder.AddNamedSystem(
            "station", make_gauze_diagram(still, swaps)
        )
        self._visualizer = MeshcatVisualizer.AddToBuilder(
            builder,
            self._station.GetOutputPort(QUERY_PORT),
            self._meshcat,
            MeshcatVisualizerParams(
                role=Role.kIllustration, prefix="scene", publish_period=1e6
            ),
        )
        root = builder.Build()
        study = get_study(scenario.system)
        dress(self._meshcat, study.view)
        self._simulator = start(root, study.integrator(scenario))
        self._context = self._simulator.get_mutable_context()
        root.SetRandomContext(self._context, RandomGenerator(scenario.seed))
        self._simulator.Initialize()
        self.time, self._count, self.speed_of_robot = 0.0, 0, 0.0
        self.stop = Stop.WAITING
        self._hands = {}
        for (name, tool), keys in zip(_ordered(tools), itertools.cycle(KEYS)):
            self._hands[name] = Hand(name, tool, swaps[f"{name}_tool"], keys)
            self._hands[name].show(self._meshcat)
        self._tip = self._robot()

    def port(self, name: str) -> np.ndarray:
        """An exported signal of the diagram, now."""
        told: Any = self._station.GetOutputPort(name)
        context = self._station.GetMyContextFromRoot(self._context)
        return np.array(told.Eval(context))

    def _robot(self) -> np.ndarray:
        tip: np.ndarray = view(RobotTool, self.port("robot.tool")).tip
        return tip

    def frame(self) -> None:
        """Reads sliders and buttons, and simulates a frame if it is not paused."""
        self._obey()
        if self.is_paused or self.is_over:
            return
        for hand in self._hands.values():
            hand.guide(self._meshcat, self._context)
        self._count += 1
        self.time = self._count * FRAME
        self._simulator.AdvanceTo(self.time)
        tip = self._robot()
        self.speed_of_robot = float(np.linalg.norm(tip - self._tip)) / FRAME
        self._tip = tip
        for name, hand in self._hands.items():
            hand.keep(self.time, view(Shaft, self.port(f"{name}.shaft")).tip)
        context = self._visualizer.GetMyContextFromRoot(self._context)
        self._visualizer.ForcedPublish(context)
        if self._count % _READ == 0:
            for out in READ_OUTS:
                value = float(np.clip(out.value(self), out.low, out.high))
                self._meshcat.SetSliderValue(out.name, value)
            self._tell()

    def _tell(self) -> None:
        """Says why the robot stands, once."""
        code = round(float(self.port("navigation.stop")[0]))
        now = next(stop for stop in Stop if stop == code)
        if now != self.stop:
            print(f"{self.time:7.2f} s  {now.text}")
        self.stop = now

    def _obey(self) -> None:
        """Does what the buttons say."""
        for name in BUTTONS:
            clicks = self._meshcat.GetButtonClicks(name)
            if clicks == self._clicks[name]:
                continue
            self._clicks[name] = clicks
            if name == "pause":
                self.is_paused = not self.is_paused
            elif name == "push":
                next(iter(self._hands.values())).send(self._meshcat, self._robot())
            elif name == "end and save":
                self.is_over = True
            else:
                more = int(name == "another seed")
                self._begin(replace(self.scenario, seed=self.scenario.seed + more))

    def play(self, duration: float, speed: float = 1.0) -> None:
        """Runs in real time until it is over or has lasted so long.

        Args:
            duration: Simulated seconds at the most.
            speed: Simulated seconds a second.
        """
        due = perf_counter()
        while self.time < duration - 1e-9 and not self.is_over:
            self.frame()
            due += FRAME / speed
            late = perf_counter() - due
            self.lag.append(max(0.0, late))
            if late < 0.0:
                sleep(-late)
            else:
                due += late  # what is lost is not made up for in a rush

    def save(self, folder: Path) -> Any:
        """Writes the recording of every hand.

        Returns:
            The scenario that plays them back.

        Raises:
            ScenarioError: If nothing was simulated.
        """
        if self._count < 2:
            raise ScenarioError("nothing to save: the run was ended before it began")
        folder.mkdir(parents=True, exist_ok=True)
        played = deepcopy(self.scenario)
        for tool in played.tools:
            if isinstance(tool, HandTool):
                path = folder / f"{tool.name}_recording.csv"
                self._hands[tool.name].save(path)
                tool.recording = str(path.absolute())
                tool.hunt, tool.pushes, tool.tremor_rms = Hunt(), [], 0.0
        return replace(played, duration=self.time)


class Hand:
    """One of the surgeon's hands: its sliders, and what it did."""

    def __init__(self, name: str, tool: HandTool, block: Any, keys: Any) -> None:
        self._name, self._block, self._keys = name, block, keys
        self._start = np.array(tool.points[0])
        self._middle = np.array(tool.p_WG)
        self._path: list[tuple[float, np.ndarray]] = [(0.0, self._start)]

    def _sliders(self) -> list[str]:
        return [f"{self._name} {axis} [mm]" for axis in "xyz"]

    def show(self, meshcat: Any) -> None:
        """Adds the sliders, or brings them back to the start."""
        known = meshcat.GetSliderNames()
        for axis, name in enumerate(self._sliders()):
            middle = 1e3 * self._middle[axis]
            low, high = middle - 1e3 * _RANGE, middle + 1e3 * _RANGE
            if axis == 2:
                high = middle - 20.0
            if name in known:
                meshcat.SetSliderValue(name, 1e3 * self._start[axis])
            else:
                less, more = self._keys[axis]
                value = 1e3 * self._start[axis]
                meshcat.AddSlider(name, low, high, 1.0, value, less, more)

    def guide(self, meshcat: Any, root: Any) -> None:
        """Tells the tool where the sliders are."""
        wanted = [1e-3 * meshcat.GetSliderValue(name) for name in self._sliders()]
        context = self._block.GetMyMutableContextFromRoot(root)
        self._block.GetInputPort("wanted").FixValue(context, np.array(wanted))

    def send(self, meshcat: Any, point: np.ndarray) -> None:
        """Moves the sliders to a point in W."""
        for axis, name in enumerate(self._sliders()):
            meshcat.SetSliderValue(name, 1e3 * float(point[axis]))

    def keep(self, time: float, tip: np.ndarray) -> None:
        """Remembers where the tip was."""
        self._path.append((time, np.array(tip)))

    def save(self, path: Path) -> None:
        """Writes the recording."""
        times, points = zip(*self._path, strict=True)
        save_recording(path, np.array(times), np.array(points))


def _held(tool: HandTool) -> HandTool:
    """The tool at its first place, with nothing that moves it."""
    held = replace(tool, times=[0.0], points=tool.points[:1], recording=None)
    return replace(held, pushes=[], hunt=Hunt(), tremor_rms=0.0)


def _ordered(tools: dict[str, HandTool]) -> list[tuple[str, HandTool]]:
    """Obstacles first: they have the keys in the left hand."""
    return sorted(tools.items(), key=lambda item: item[1].role == "target")
