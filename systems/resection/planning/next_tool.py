"""Another tool: whether a larger or a smaller ball removes what this one cannot.

A smaller ball covers corners, a larger one lets the body follow where it has cut. What
each adds is searched in thought, less what the present one would still add.
"""

from dataclasses import dataclass

from systems.common.parameter import parameter
from systems.resection.planning.next_entry import SECOND_LOOK, gain_of
from systems.resection.planning.session import Session


@dataclass
class ToolsParams:
    """Tools that the robot may change to."""

    radii: list[float] = parameter(
        [], "of their balls", "m", least=5e-4, most=0.02, shape=(-1,)
    )
    most: int = parameter(1, "changes through one entry", least=0, most=10)
    least_gain: float = parameter(
        0.005, "of the tumour that a change must add", least=0.0, most=1.0
    )
    # The robot stands at home meanwhile.
    time: float = parameter(
        60.0, "in which a tool is changed", "s", least=0.0, most=7200.0
    )


@dataclass
class NextTool:
    """A proposed tool.

    Attributes:
        radius: Of its ball in m.
        gained: Tumour that it would add at least, in m3.
    """

    radius: float
    gained: float

    def text(self) -> str:
        """In words."""
        return f"a ball of {1e3 * self.radius:.1f} mm adds {1e9 * self.gained:.0f} mm3"


def next_tools(session: Session, params: ToolsParams, seed: int = 1) -> list[NextTool]:
    """Tools that add enough, best first; nothing changes."""
    others = [r for r in params.radii if r != session.params.tool_radius]
    if not others:
        return []
    control = gain_of(session, lambda s: None, seed, SECOND_LOOK)
    least = params.least_gain * session.volume.tumour_volume

    def gained(radius: float) -> float:
        return gain_of(session, lambda s: s.change_tool(radius), seed, SECOND_LOOK)

    found = [NextTool(radius, gained(radius) - control) for radius in others]
    good = [tool for tool in found if tool.gained >= least]
    return sorted(good, key=lambda tool: -tool.gained)
