"""Go to target, third form: attract or bypass, never their sum.

Sums of potentials stall where the tools must cross: for R's tip the obstacle tool and
everything behind it is one convex wall (`shadow_body`), and straight attraction has a
stable rest point on a wall. Here one potential acts at a time, each the length of a
shortest way: the straight one, or the taut one over an edge of the wall (`top_edge`,
`tip_edge`); `bypass_route` chooses. Every one has gradient one and no rest point but
the goal. The tip's velocity is v = min(v_max, k Gamma) along the way, plus that of the
moving target, and the guide point's v_1 = s v, as in the paper's form (`go_to_target`).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, NamedTuple

import numpy as np

from plants.organs.distance import Organs
from plants.organs.organs import OrganSet, arrays, port
from systems.auto_guidance.go_to_target import (
    NOWHERE,
    at_the_tip,
    guide_point,
    known_places,
)
from systems.auto_guidance.nearest import nearest_obstacle
from systems.bypass import obstacle_tools as tools_around
from systems.bypass import workspace as limits
from systems.bypass.bypass_route import Choice, choose_way
from systems.bypass.obstacle_tools import Margins, obstacle_tools
from systems.bypass.organ_route import Found, choose_way_over, on_the_way
from systems.bypass.workspace import WorkspaceParams
from systems.common.compiled import compiled, packed
from systems.common.geometry import limited, norm, plus, scaled, sub
from systems.common.parameter import Rules, check, parameter
from systems.common.reach_limits import ReachLimits
from systems.common.signal import Field, Many, Vector
from systems.common.signals import (
    Estimate,
    Guide,
    RobotTool,
    Velocity,
    ViewCone,
    all_usable,
    finite_cone,
    finite_tool,
    usable,
)
from systems.common.step_block import StepBlock

_LOOKS = 4
"""Every which step looks for a way among organs; it is followed in between."""
_AT_CORNER = 0.003
"""So near to a corner of the way it looks as well, m."""


class Way(NamedTuple):
    """The way that R's tip goes."""

    way: Annotated[
        float,
        Field(
            "1",
            "0 straight, -1 up and over, 1 and 2 the top and the tip edge of the "
            "first obstacle, 3 and 4 of the second, then of S and of the endoscope; "
            "among organs -2 back, -3 over what is in the way, -4 and on beside it",
            0.0,
        ),
    ]
    waiting: Annotated[
        float, Field("1", "pose that R waits in, 0 for none; 90 before an organ", 0.0)
    ]
    aim: Annotated[Vector, Field("m", "where it goes to", (0.05, 0.0, -0.1))]
    switches: Annotated[float, Field("1", "times it changed from edge to edge", 0.0)]


class State(NamedTuple):
    """v_1 / s in m/s, the time of the last update in s, and what `Way` says.

    Among organs also the first corner of the way, and how far it is from there, m.
    """

    v_tip: Vector
    time: float
    way: float
    waiting: float
    switches: float
    corner: Vector = NOWHERE
    rest: float = 0.0
    aim: Vector = NOWHERE


@dataclass
class ToolBypassParams:
    """Parameters of `ToolBypass`."""

    period: float = parameter(1 / 60, "of the update", "s", above=0.0, most=1.0)
    max_speed: float = parameter(0.06, "v_max of the tip", "m/s", above=0.0, most=0.5)
    max_acceleration: float = parameter(
        1.0, "of the tip's commanded velocity", "m/s^2", above=0.0, most=10.0
    )
    approach_rate: float = parameter(
        4.0, "k: how the speed falls before the goal", "1/s", above=0.0, most=50.0
    )
    blocked_room: float = parameter(
        0.0003, "the goal is blocked below D_safe and this", "m", least=0.0, most=0.02
    )
    freed_room: float = parameter(
        0.001, "and free again above D_safe and this", "m", least=0.0, most=0.02
    )
    waiting_room: float = parameter(
        0.001, "a pose to wait in is D_safe and this away", "m", least=0.0, most=0.02
    )
    goal_slack: float = parameter(
        0.0002,
        "a way is planned this much nearer than its own goal is",
        "m",
        least=0.0,
        most=0.002,
    )
    switch_ratio: float = parameter(
        0.85,
        "another edge is taken if shorter than this part",
        above=0.0,
        most=1.0,
    )
    switch_gain: float = parameter(
        0.005,
        "of the one in use, and by this as well",
        "m",
        least=0.0,
        most=0.1,
    )
    proportion_floor: float = parameter(
        0.1, "least s, for shafts that are closest at G_R", above=0.0, most=1.0
    )

    def rules(self) -> Rules:
        """What must hold across the parameters."""
        yield (
            self.blocked_room < self.freed_room,
            "freed_room",
            f"more than blocked_room={self.blocked_room} m",
        )
        yield (
            self.freed_room <= self.waiting_room,
            "waiting_room",
            f"at least freed_room={self.freed_room} m",
        )


def constants(params: ToolBypassParams) -> np.ndarray:
    """The parameters as the compiled functions take them."""
    check(params)
    return packed(params)


@compiled
def bypass(
    params: Any,
    workspace: Any,
    view_cone: ViewCone,
    v_tip: Vector,
    dt: float,
    g: Vector,
    p: Vector,
    goal: Vector,
    v_goal: Vector,
    tools: np.ndarray,
    edge: int,
    waits: int,
) -> tuple[Vector, int, int, Vector]:
    """One step of the behaviour.

    Args:
        params: A record of `constants`.
        workspace: A record of `workspace.constants`.
        view_cone: What the endoscope sees.
        v_tip: The tip's velocity before the step, m/s.
        dt: Length of the step, s.
        g: Fulcrum G_R, m.
        p: Tip of R, m.
        goal: The target, m.
        v_goal: Its velocity, m/s.
        tools: Rows of `ObstacleTool`.
        edge: The way in use.
        waits: Number of the pose that R waits in, 0 if it does not wait.

    Returns:
        The tip's velocity after the step in m/s, the way in use, the pose that R waits
        in, and where it goes to.
    """
    way = choose_way(params, workspace, view_cone, g, p, goal, tools, edge, waits)
    return follow(params, v_tip, dt, v_goal, way), way.edge, way.waits, way.aim


@compiled
def follow(
    params: Any, v_tip: Vector, dt: float, v_goal: Vector, way: Choice
) -> Vector:
    """The tip's velocity after a step along a way, m/s; see `bypass`."""
    speed = min(params.max_speed, params.approach_rate * way.length)
    wanted = scaled(speed, way.direction)
    if way.waits == 0:
        wanted = limited(plus(wanted, v_goal), params.max_speed)
    change = limited(sub(wanted, v_tip), params.max_acceleration * dt)
    return plus(v_tip, change)


@compiled
def lead(
    params: Any,
    margins: Any,
    workspace: Any,
    organs: Organs | None,
    state: State,
    time: float,
    robot: RobotTool,
    obstacles: np.ndarray,
    target: Estimate,
    camera: Estimate,
    view_cone: ViewCone,
) -> tuple[State, Velocity, Guide, Way]:
    """One step of the block, among organs or, None, without."""
    dt, g, p = time - state.time, robot.fulcrum, robot.tip
    obstacle = nearest_obstacle(robot, obstacles)
    stop = limited(scaled(-1.0, state.v_tip), params.max_acceleration * dt)
    v_tip, aim = plus(state.v_tip, stop), p
    edge, waits, switches = int(state.way), int(state.waiting), state.switches
    corner, rest = state.corner, state.rest
    if not finite_tool(robot):
        guide, aim = at_the_tip(NOWHERE), NOWHERE
    elif not known_places(obstacle, target):
        guide = at_the_tip(p)
    else:
        guide = guide_point(robot, obstacle, target.p, params.proportion_floor)
        if all_usable(obstacles) and usable(target) and finite_cone(view_cone):
            tools = obstacle_tools(margins, g, obstacles, target, camera)
            before = edge
            if organs is None:
                v_tip, edge, waits, aim = bypass(
                    params,
                    workspace,
                    view_cone,
                    state.v_tip,
                    dt,
                    g,
                    p,
                    target.p,
                    target.v,
                    tools,
                    edge,
                    waits,
                )
            else:
                found = Found(corner, rest, edge, waits, state.aim)
                is_there = edge != 0 and norm(sub(corner, p)) < _AT_CORNER
                if is_there or round(time / params.period) % _LOOKS == 0:
                    found = choose_way_over(
                        params,
                        workspace,
                        view_cone,
                        organs,
                        g,
                        p,
                        target.p,
                        tools,
                        edge,
                        waits,
                    )
                way = on_the_way(found, p, target.p)
                v_tip = follow(params, state.v_tip, dt, target.v, way)
                corner, rest = found.corner, found.rest
                edge, waits, aim = way.edge, way.waits, way.aim
            if before > 0 and edge > 0 and edge != before:
                switches += 1.0
    told = Way(float(edge), float(waits), aim, switches)
    after = State(v_tip, time, told.way, told.waiting, switches, corner, rest, aim)
    return after, Velocity(scaled(guide.s, v_tip)), guide, told


@compiled
def _step(
    params: Any,
    margins: Any,
    workspace: Any,
    state: State,
    time: float,
    robot: RobotTool,
    obstacles: np.ndarray,
    target: Estimate,
    camera: Estimate,
    view_cone: ViewCone,
) -> tuple[State, Velocity, Guide, Way]:
    around = (robot, obstacles, target, camera, view_cone)
    return lead(params, margins, workspace, None, state, time, *around)


@compiled
def _step_among(
    params: Any,
    margins: Any,
    workspace: Any,
    values: np.ndarray,
    table: np.ndarray,
    state: State,
    time: float,
    robot: RobotTool,
    obstacles: np.ndarray,
    target: Estimate,
    camera: Estimate,
    view_cone: ViewCone,
    moved: np.ndarray,
) -> tuple[State, Velocity, Guide, Way]:
    organs = Organs(values, table, moved)
    around = (robot, obstacles, target, camera, view_cone)
    return lead(params, margins, workspace, organs, state, time, *around)


class ToolBypass(StepBlock):
    """Leads R's tip to the target: straight, or over an edge of the tools in its way.

    A third form of the paper's "Go-to Target" (section 4.1); see the module.

    Port ``robot_tool`` accepts the `RobotTool`.
    Port ``obstacles`` accepts the `Estimate` of every obstacle tool.
    Port ``target`` accepts the `Estimate` of the target tool S.
    Port ``camera`` accepts the `Estimate` of the endoscope.
    Port ``view_cone`` accepts the `ViewCone`.
    Port ``organs``, if there are any, accepts the `MovingPoint` of each.
    Port ``v1`` emits the guide point's `Velocity` v_1.
    Port ``guide`` emits the `Guide`.
    Port ``way`` emits the `Way`.

    The outputs are those of the step from the last update to now.
    """

    def __init__(
        self,
        params: ToolBypassParams | None = None,
        margins: Margins | None = None,
        reach: ReachLimits | None = None,
        workspace: WorkspaceParams | None = None,
        obstacles: Sequence[str] = ("obstacle",),
        organs: OrganSet | None = None,
    ) -> None:
        """Builds the block.

        Args:
            params: Parameters; the defaults if None.
            margins: Distances to the tools; the defaults if None.
            reach: What the navigation behind it keeps to; the defaults if None.
            workspace: Further limits of R's tip; the defaults if None.
            obstacles: Names of the obstacle tools.
            organs: What else is in the way; nothing if None.

        Raises:
            ParameterError: If a parameter is out of range.
        """
        super().__init__()
        params = params or ToolBypassParams()
        self.declare_step(
            _step if organs is None else _step_among,
            [
                constants(params),
                tools_around.constants(margins or Margins()),
                limits.constants(reach, workspace),
                *arrays(organs),
            ],
            {
                "robot_tool": RobotTool,
                "obstacles": Many(Estimate, tuple(obstacles)),
                "target": Estimate,
                "camera": Estimate,
                "view_cone": ViewCone,
                **port(organs),
            },
            State((0.0, 0.0, 0.0), -params.period, 0.0, 0.0, 0.0),
            {"v1": Velocity, "guide": Guide, "way": Way},
            params.period,
        )
