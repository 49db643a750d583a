"""The tools in the patient besides the robot's: a list, each with a name and a role.

A file and `--set` reach a tool by its name: `obstacle.points=...`. The list has a
target, an obstacle and a camera of these names; a file's `tools` adds others.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from diagrams.common.scenario import ScenarioError
from plants.surgeon.hunting_tool import Hunt
from plants.surgeon.surgeon_tool import SurgeonToolParams
from systems.common.parameter import Rules, parameter, part
from systems.motion.endoscope import EndoscopeParams

TARGET, OBSTACLE, CAMERA = ROLES = ("target", "obstacle", "camera")
SHORT = {"recording": "recording", "hunt": "hunt"}
"""Keys of the tool called obstacle that need not name it."""
APART = 1 << 40
"""Seeds of a third tool's tremor and so on lie this far from those of the first two."""


@dataclass
class HandTool(SurgeonToolParams):
    """A tool in the surgeon's hand: the target S, or an obstacle O."""

    name: str = parameter("", "by which keys, log and figures go")
    role: str = parameter(OBSTACLE, "what it is to the robot", choices=ROLES[:2])
    hunt: Hunt = part(Hunt)
    guided: str | None = parameter(
        None, "tape `t,x,y,z` of where somebody wanted its tip; '': live", file=True
    )
    tracked: str | None = parameter(
        None, "tape of what another program's tracker saw of it; '': live", file=True
    )

    def rules(self) -> Rules:
        """What hunts does nothing else."""
        yield from super().rules()
        alone = not (self.recording or self.breathes or self.hand.seed)
        told = "0 together with a recording, breathing or a synthetic hand"
        yield alone or not self.hunt.speed, "hunt.speed", told
        alone = not (self.recording or self.hunt.speed or self.hand.seed)
        for name in ("guided", "tracked"):
            led = getattr(self, name) is not None
            told = "None together with a recording, a hunt or a synthetic hand"
            yield not led or alone, name, told
        both = self.guided is not None and self.tracked is not None
        yield not both, "tracked", "None where it is guided"


@dataclass
class CameraTool(EndoscopeParams):
    """The endoscope."""

    name: str = parameter("", "by which keys, log and figures go")
    role: str = parameter(CAMERA, "what it is to the robot", choices=ROLES[2:])


type Tool = HandTool | CameraTool


def usual_tools() -> list[Tool]:
    """A target, an obstacle and a camera."""
    return [
        HandTool(name=TARGET, role=TARGET),
        HandTool(name=OBSTACLE),
        CameraTool(name=CAMERA),
    ]


def gather(tree: dict[str, Any]) -> None:
    """Brings what a scenario's plain data say of tools into the one list `tools`.

    Raises:
        ScenarioError: If a tool has no name, or what stands for one has no keys.
    """
    found: dict[str, Any] = {name: {"role": name} for name in ROLES}
    items = tree.pop("tools", [])
    for index, item in enumerate(items if isinstance(items, list) else [items]):
        name = item.get("name") if isinstance(item, dict) else None
        if not isinstance(name, str) or not name:
            raise ScenarioError(f"tools[{index}]={item!r}: expected keys, with a name")
        found.setdefault(name, {}).update(item)
    for key in SHORT.keys() & tree.keys():
        told = tree.setdefault(OBSTACLE, {})
        if not isinstance(told, dict):
            raise ScenarioError(f"{OBSTACLE}={told!r}: expected keys and values")
        told[SHORT[key]] = tree.pop(key)
    for name in found.keys() & tree.keys():
        told = tree.pop(name)
        if not isinstance(told, dict):
            raise ScenarioError(f"{name}={told!r}: expected keys and values")
        for key, value in told.items():
            old = found[name].get(key)
            both = isinstance(old, dict) and isinstance(value, dict)
            found[name][key] = old | value if both else value
    tree["tools"] = [{"name": name, **tool} for name, tool in found.items()]


def hands(tools: list[Tool], seed: int) -> dict[str, HandTool]:
    """The surgeon's tools by name, the target first, each with a tremor of its own."""
    held = sorted(
        (tool for tool in tools if isinstance(tool, HandTool)),
        key=lambda tool: tool.role != TARGET,
    )
    return {
        tool.name: replace(tool, tremor_seed=2 * seed + k % 2 + k // 2 * APART)
        for k, tool in enumerate(held)
    }


def logged(run: Any, tool: Tool) -> Any:
    """What was logged of a tool: `shaft`, `estimate`, and so on."""
    return getattr(run, tool.name)


def in_the_way(tools: list[Tool]) -> list[tuple[str, str]]:
    """Name and role of every tool, as clearances have them: obstacles come first."""
    order = (OBSTACLE, TARGET, CAMERA)
    return [(t.name, t.role) for role in order for t in tools if t.role == role]


def gap(run: Any, role: str) -> np.ndarray:
    """The least true clearance to the tools of a role over time (n) [m]."""
    roles = [role for _, role in in_the_way(run.scenario.tools)]
    near: np.ndarray = run.clearance.distance[:, np.array(roles) == role].min(axis=1)
    return near
