"""Go to target, third form: attract or bypass, never their sum.

Sums of potentials stall where the tools must cross: for R's tip the obstacle tool and
everything behind it is one convex wall (`shadow_body`), and straight attraction has a
stable rest point on a wall. Here one potential acts at a time, each the length of a
shortest way: the straight one, or the taut one over an edge of the wall (`top_edge`,
`tip_edge`); `bypass_route` chooses. Every one has gradient one and no rest point but
the goal. The tip's velocity is v = min(v_max, k Gamma) along the way, plus that of the
moving target, and the guide point's v_1 = s v, as in the paper's form (`go_to_target`).
"""

from dataclasses import dataclass
from functools import partial
from math import inf
from typing import Any

import numpy as np

from systems.auto_guidance.go_to_target import guide_point
from systems.bypass import obstacle_tools as tools_around
from systems.bypass import workspace as limits
from systems.bypass.bypass_route import choose_way
from systems.bypass.obstacle_tools import Margins, obstacle_tools
from systems.bypass.workspace import WorkspaceParams
from systems.common.compiled import Numbers, compiled, packed
from systems.common.geometry import Vector, all_finite, along, limited, sub, xyz
from systems.common.signals import (
    CAMERA_EXAMPLE,
    OBSTACLE_EXAMPLE,
    ROBOT_TOOL_EXAMPLE,
    TARGET_EXAMPLE,
    VIEW_CONE_EXAMPLE,
    fulcrum,
    usable,
    velocity,
)
from systems.common.step_block import StepBlock


@dataclass
class ToolBypassParams:
    """Parameters of `ToolBypass`.

    Attributes:
        period: Of the update, s.
        max_speed: v_max of the tip, m/s.
        max_acceleration: Of the tip's commanded velocity, m/s^2.
        approach_rate: k, 1/s: how the speed falls before the goal.
        blocked_room: The goal counts as blocked below D_safe and this, m,
        freed_room: and as free again above D_safe and this, m.
        waiting_room: A pose to wait in is D_safe and this away, m.
        goal_slack: A way is planned this much nearer than its own goal is, m.
        switch_ratio: Another edge is taken if it is shorter than this part
        switch_gain: of the one in use, and shorter by this as well, m.
        proportion_floor: Least s, for shafts that are closest at G_R.
    """

    period: float = 1.0 / 60.0
    max_speed: float = 0.06
    max_acceleration: float = 1.0
    approach_rate: float = 4.0
    blocked_room: float = 0.0003
    freed_room: float = 0.001
    waiting_room: float = 0.001
    goal_slack: float = 0.0002
    switch_ratio: float = 0.85
    switch_gain: float = 0.005
    proportion_floor: float = 0.1

    def check(self) -> None:
        """Checks the values.

        Raises:
            ValueError: With the name, the value and what was expected.
        """
        for name, value in vars(self).items():
            if isinstance(value, float) and not 0.0 <= value < inf:
                raise ValueError(f"tool_bypass: {name}={value} must be finite and >= 0")
        for name in ("period", "max_speed", "max_acceleration", "approach_rate"):
            if not getattr(self, name) > 0.0:
                raise ValueError(
                    f"tool_bypass: {name}={getattr(self, name)} must be > 0"
                )
        if not self.blocked_room < self.freed_room <= self.waiting_room:
            raise ValueError(
                f"tool_bypass: blocked_room={self.blocked_room} m, "
                f"freed_room={self.freed_room} m and waiting_room="
                f"{self.waiting_room} m must increase"
            )
        if not 0.0 < self.switch_ratio <= 1.0:
            raise ValueError(
                f"tool_bypass: switch_ratio={self.switch_ratio} must be in (0, 1]"
            )
        if not 0.0 < self.proportion_floor <= 1.0:
            raise ValueError(
                f"tool_bypass: proportion_floor={self.proportion_floor} must be in "
                f"(0, 1]"
            )


def constants(params: ToolBypassParams) -> np.ndarray:
    """The parameters as the compiled functions take them."""
    params.check()
    return packed(params)


@compiled
def bypass(
    params: Any,
    workspace: Any,
    view_cone: Numbers,
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
        view_cone: Apex, axis, half angle (7).
        v_tip: The tip's velocity before the step, m/s.
        dt: Length of the step, s.
        g: Fulcrum G_R, m.
        p: Tip of R, m.
        goal: The target, m.
        v_goal: Its velocity, m/s.
        tools: Obstacle tools (n, 11).
        edge: The way in use.
        waits: Number of the pose that R waits in, 0 if it does not wait.

    Returns:
        The tip's velocity after the step in m/s, the way in use, the pose that R waits
        in, and where it goes to.
    """
    direction, length, edge, waits, aim = choose_way(
        params, workspace, view_cone, g, p, goal, tools, edge, waits
    )
    speed = min(params.max_speed, params.approach_rate * length)
    wanted = along((0.0, 0.0, 0.0), speed, direction)
    if waits == 0:
        wanted = limited(along(wanted, 1.0, v_goal), params.max_speed)
    change = limited(sub(wanted, v_tip), params.max_acceleration * dt)
    return along(v_tip, 1.0, change), edge, waits, aim


@compiled
def _step(
    record: np.ndarray,
    margins: np.ndarray,
    workspace: np.ndarray,
    state: np.ndarray,
    time: float,
    robot_tool: np.ndarray,
    obstacle: np.ndarray,
    target: np.ndarray,
    camera: np.ndarray,
    view_cone: np.ndarray,
) -> np.ndarray:
    """The next state (7), v_1 (3), the guide signal (12) and the way (6)."""
    params = record[0]
    v_tip, dt = xyz(state, 0), time - state[3]
    g, p, p_s = xyz(robot_tool, 0), xyz(robot_tool, 3), xyz(target, 0)
    stop = limited((-v_tip[0], -v_tip[1], -v_tip[2]), params.max_acceleration * dt)
    v_tip_stopping = along(v_tip, 1.0, stop)
    edge, waits, aim = int(state[4]), int(state[5]), p
    switches = state[6]
    if not all_finite(robot_tool):
        zero = (0.0, 0.0, 0.0)
        guide: tuple[float, ...] = zero + zero + (0.0, 1.0, 1.0) + zero
        v_tip, aim = v_tip_stopping, zero
    elif not (all_finite(xyz(obstacle, 0) + fulcrum(obstacle)) and all_finite(p_s)):
        guide = p + p + (0.0, 1.0, 1.0) + p
        v_tip = v_tip_stopping
    else:
        guide = guide_point(robot_tool, obstacle, p_s, params.proportion_floor)
        if usable(obstacle) and usable(target) and all_finite(view_cone):
            before = edge
            tools = obstacle_tools(margins[0], g, obstacle, target, camera)
            v_tip, edge, waits, aim = bypass(
                params,
                workspace[0],
                view_cone,
                v_tip,
                dt,
                g,
                p,
                p_s,
                velocity(target),
                tools,
                edge,
                waits,
            )
            if before > 0 and edge > 0 and edge != before:
                switches += 1.0
        else:
            v_tip = v_tip_stopping
    v1 = along((0.0, 0.0, 0.0), guide[7], v_tip)
    memory = (time, float(edge), float(waits), switches)
    way = (float(edge), float(waits)) + aim + (switches,)
    return np.array(v_tip + memory + v1 + guide + way)


class ToolBypass(StepBlock):
    """Leads R's tip to the target: straight, or over an edge of the tools in its way.

    A third form of the paper's "Go-to Target" (section 4.1); see the module.

    Port ``robot_tool`` accepts the robot's instrument: fulcrum G_R and tip P_R
    (6), m, in W.
    Port ``obstacle`` accepts the estimate (17) of the obstacle tool O.
    Port ``target`` accepts the estimate (17) of the target tool S.
    Port ``camera`` accepts the estimate (17) of the endoscope.
    Port ``view_cone`` accepts apex p_WC, axis, half angle (7).
    Port ``v1`` emits the guide point's velocity v_1 (3), m/s, in W.
    Port ``guide`` emits the guide signal (12): M_R, M_O, rho, s, l/L, M_R^f.
    Port ``way`` emits the way in use (0 straight, -1 up and over, 1 and 2 the top and
    the tip edge of O, then of S and of the endoscope), the number of the pose that R
    waits in, 0 if it does not wait, where it goes to, m, in W, and how often it has
    gone from one edge to another (6).

    The discrete state is v_1 / s (3), the time of the last update, the way in use, the
    pose that R waits in, and the changes of edge. The outputs are those of the step
    from then to now.
    """

    def __init__(
        self,
        params: ToolBypassParams | None = None,
        margins: Margins | None = None,
        workspace: WorkspaceParams | None = None,
    ) -> None:
        """Builds the block.

        Args:
            params: Parameters; the defaults if None.
            margins: Distances to the tools; the defaults if None.
            workspace: Limits of R's tip; the defaults if None.

        Raises:
            ValueError: If a parameter is out of range.
        """
        super().__init__()
        params = params or ToolBypassParams()
        step = partial(
            _step,
            constants(params),
            tools_around.constants(margins or Margins()),
            limits.constants(workspace or WorkspaceParams()),
        )
        self.declare_step(
            step,
            {
                "robot_tool": ROBOT_TOOL_EXAMPLE,
                "obstacle": OBSTACLE_EXAMPLE,
                "target": TARGET_EXAMPLE,
                "camera": CAMERA_EXAMPLE,
                "view_cone": VIEW_CONE_EXAMPLE,
            },
            [0.0, 0.0, 0.0, -params.period, 0.0, 0.0, 0.0],
            {"v1": 3, "guide": 12, "way": 6},
            params.period,
        )
