"""The switching planner as a block; its rules are in `switching_rules`."""

from collections.abc import Sequence

from systems.switching.arcs import Obstacle
from systems.switching.navigation_planner import PERIOD, NavigationPlanner
from systems.switching.signals import CAPACITY, velocity
from systems.switching.switching_rules import plan
from systems.switching.switching_state import SwitchingParams, SwitchingState


class SwitchingPlanner(NavigationPlanner):
    """Follows one potential at a time: the goal's, or one obstacle's on one side.

    Sections 2.2 and 3.2 of the thesis, with the involute-helicoid potential in the
    obstacle's frame; see `systems.switching.switching_rules`.

    Port ``robot`` accepts the body's x, y, heading, speed and turn rate (5).
    Port ``seen`` accepts the obstacles in sight: track identity, x, y, radius, v_x,
    v_y of each (6 each; identity -1 for none).
    Port ``goal`` accepts the goal x, y in m (2); another goal starts afresh.
    Port ``v_R`` emits the velocity to take in m/s, world frame (2).
    Port ``mode`` emits the state: its number in `MODES`, the obstacle followed (-1
    for none), the sense about it (+1 counter-clockwise), whether the body may
    retreat backwards, and whether an obstacle in sight is as fast as the body (5).
    """

    def __init__(
        self,
        params: SwitchingParams | None = None,
        capacity: int = CAPACITY,
        period: float = PERIOD,
    ) -> None:
        """Makes the block.

        Raises:
            ValueError: If a parameter is out of range.
        """
        super().__init__()
        self.params = params or SwitchingParams()
        self.params.check()
        self.declare(
            [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, *SwitchingState()],
            lambda held: [*held[6:9], held[4], held[5]],
            capacity,
            period,
        )

    def plan(
        self,
        held: list[float],
        robot: list[float],
        goal: list[float],
        seen: list[Obstacle],
    ) -> Sequence[float]:
        """The velocity to take (2), goal (2), retreat, outrun, then the state."""
        same = goal == held[2:4]
        state = SwitchingState(*held[6:]) if same else SwitchingState()
        here, there = (robot[0], robot[1]), (goal[0], goal[1])
        step = plan(self.params, state, here, velocity(robot), there, seen)
        flags = (float(step.retreat), float(step.outrun))
        return [step.v_x, step.v_y, *goal, *flags, *step.state]
