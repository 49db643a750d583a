"""The snake live: its wires are wound by hand."""

from typing import Any

import numpy as np

from diagrams.common.live import KEYS, Figure, Guided, Live, Slider, Switch
from diagrams.snake.diagram import start_lengths
from diagrams.snake.scenario import SnakeScenario
from plants.snake.signals import WIRE_NAMES, Drums, Tensions, ToolPose
from systems.resection.wires.wire_watch import Alarm

PULL = 6.0
"""To either side of its length at the start a wire is wound [mm]."""


def guided(scenario: SnakeScenario) -> list[Guided]:
    """All nine wires, and the translation."""
    lengths = start_lengths(scenario)
    names = [f"wire {name[1:]} [mm]" for name in WIRE_NAMES]
    keys = [*KEYS[0], *KEYS[1], *[("", "")] * (len(names) - 6)]
    sliders = [
        Slider(name, 1e3 * at - PULL, 1e3 * at + PULL, 0.1, keys=pair)
        for name, at, pair in zip(names, lengths, keys, strict=False)
    ]
    low, high = (1e3 * end for end in scenario.snake.travel)
    sliders.append(Slider("translation [mm]", low, high, 0.1))
    rest = Drums(tuple(lengths[:-1]), float(lengths[-1]))
    owner = lambda scenario: scenario  # noqa: E731
    return [Guided("wires", Drums, rest, owner, "guided", tuple(sliders))]


def least_tension(session: Any) -> float:
    """Of all wires [N]."""
    return float(np.min(session.read("wires.tension", Tensions).T))


def words(session: Any) -> str:
    """The alarm, or that all is well."""
    alarm = session.read("watch.alarm", Alarm)
    module = round(float(alarm.module))
    if alarm.time < 0.0:
        return "wires hold"
    return f"a wire of module {module} is slack" if module else "the posture is lost"


LIVE = Live(
    guided=guided,
    switches=lambda scenario: [Switch("tension not read", "tension_nan", 0.1)],
    figures=lambda scenario: [
        Figure("least tension [N]", least_tension, 0.0, 20.0, 0.1, 1.0)
    ],
    words=words,
    moving=lambda session: session.read("snake.tool", ToolPose).p,
    streamed=lambda session: {"Snake": tuple(session.read("snake.tool", ToolPose))},
    frame=0.02,  # the drums' period
)
