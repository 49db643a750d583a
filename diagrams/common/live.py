"""What a system says of itself to be run live: who is guided, buttons, figures.

`diagrams/live` makes sliders, keys, a gamepad, buttons and read-outs of it, and of what
was done a scenario that plays it back.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

KEYS = (
    (("KeyA", "KeyD"), ("KeyS", "KeyW"), ("KeyQ", "KeyE")),
    (("ArrowLeft", "ArrowRight"), ("ArrowDown", "ArrowUp"), ("PageDown", "PageUp")),
)
"""Of what is guided first, then second: less and more of x, y and z."""


@dataclass(frozen=True)
class Slider:
    """What sets one element of a signal.

    Attributes:
        label: With the unit that is shown.
        low: The least, as shown.
        high: The most.
        step: Between two values.
        per_SI: Of what is shown in an SI unit: 1e3 for mm.
        keys: For less, and for more.
    """

    label: str
    low: float
    high: float
    step: float = 1.0
    per_SI: float = 1e3
    keys: tuple[str, str] = ("", "")


@dataclass(frozen=True)
class Guided:
    """What somebody outside the diagram moves: its `Outside` is the block NAME_outside.

    Attributes:
        name: What it is called.
        signal: What is said, its declaration.
        rest: What holds at first, a value of it.
        owner: What of a scenario has the field that names the tape.
        field: That field: None for nobody, "" for whoever is there, or a file.
        sliders: One an element; none if another program guides it.
    """

    name: str
    signal: Any
    rest: Any
    owner: Callable[[Any], Any]
    field: str = "guided"
    sliders: tuple[Slider, ...] = ()


@dataclass(frozen=True)
class Switch:
    """A button that lets something fail for a while, see `plants.faults`."""

    label: str
    kind: str
    lasting: float = 2.0
    size: float = 0.0


@dataclass(frozen=True)
class Figure:
    """A figure that is shown while it runs.

    Attributes:
        label: With the unit that is shown.
        value: Of the session, in SI units.
        low: The least that is shown.
        high: The most.
        step: To which it is rounded.
        per_SI: Of what is shown in an SI unit.
    """

    label: str
    value: Callable[[Any], float]
    low: float
    high: float
    step: float = 0.1
    per_SI: float = 1e3


@dataclass(frozen=True)
class Live:
    """How a system is run live. A session is a `diagrams.live.session.Session`.

    Attributes:
        guided: What of a scenario can be guided.
        held: The scenario with all that moves those of these names taken away.
        switches: What can be made to fail.
        acts: Buttons that do something else, and what to a session.
        figures: What is shown of a scenario.
        words: Why the robot stands, or what it does.
        moving: A point of the robot whose speed is shown [m].
        fastest: The greatest speed that is shown [m/s].
        tracked: What of a scenario a tracker may see: as guided by another program.
        streamed: What other programs are told: by name a point and a direction
            (None for none), or a text.
        frame: Between two looks at what is outside [s], on the controllers' clock.
    """

    guided: Callable[[Any], list[Guided]] = lambda scenario: []
    held: Callable[[Any, list[str]], Any] = lambda scenario, names: scenario
    switches: Callable[[Any], list[Switch]] = lambda scenario: []
    acts: Callable[[Any], Mapping[str, Callable[[Any], None]]] = lambda scenario: {}
    figures: Callable[[Any], list[Figure]] = lambda scenario: []
    words: Callable[[Any], str] = lambda session: ""
    moving: Callable[[Any], Any] | None = None
    fastest: float = 0.2
    tracked: Callable[[Any], list[Guided]] = lambda scenario: []
    streamed: Callable[[Any], dict[str, Any]] = lambda session: {}
    frame: float = 1.0 / 60.0
