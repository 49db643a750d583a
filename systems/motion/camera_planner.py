"""Camera planner: an endoscope that keeps both tips in view, and moves only if it must.

Section 2.1 follows S with the camera and nothing else. Here the camera stands still
while both tips, R's and S's, are seen with some margin, wherever S and the obstacles
stop on the way that they are on (`sight: swept_margin`). If not, places are tried: aims
round the middle of the tips, at several depths through the camera's own fulcrum. What
counts first is how long a tip will be lost on the way and there, in the mean over when
the tools stop (`camera_way: expected_loss`); among equals those that are good enough,
and of them the nearest. The camera's own shaft keeps clear of organs and tools there
and on the way. It goes as `Endoscope` does, slowly. While R is at S, where the surgeon
works, less margin will do. The picture's upright is the world's: no roll.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import exp
from typing import Any

import numpy as np

from plants.organs.distance import Organs
from plants.organs.organs import OrganSet, arrays
from systems.common.compiled import compiled, packed
from systems.common.geometry import (
    along,
    any_perpendicular,
    cross,
    limited,
    norm,
    plus,
    row_of,
    scaled,
    sub,
    unit,
    xyz,
)
from systems.common.parameter import Rules, check, parameter
from systems.common.signal import Many, Vector, vector
from systems.common.signals import (
    Estimate,
    MovingPoint,
    RobotTool,
    Shaft,
    ViewCone,
    all_usable,
    finite_tool,
    read_estimate,
    usable,
)
from systems.common.step_block import StepBlock
from systems.motion.camera_way import (
    THERE,
    expected_loss,
    least_margin,
    seen_from,
    way_clear,
)
from systems.motion.endoscope import EndoscopeParams, wanted_tip
from systems.motion.endoscope import constants as endoscope_constants
from systems.motion.sight import Sight, tip_margin

_DEPTHS = 7
_AIMS = (-0.045, -0.03, -0.015, 0.0, 0.015, 0.03, 0.045)
"""Aims stand round the middle of the tips, across the view, m."""
_NEAR = 0.05
"""The farther tip is this far from the lens at least, m."""
_FARTHEST = 0.025
"""S is not thought to go farther while the camera looks ahead, m."""
_SURE = 2.0
"""So many standard deviations of a velocity count as its error."""


@dataclass
class CameraPlannerParams:
    """Parameters of `CameraPlanner`; speeds are the endoscope's."""

    active: bool = parameter(False, "whether the camera plans; else it follows S")
    margin: float = parameter(
        0.03, "with less, a better place is looked for", "rad", least=0.0, most=0.5
    )
    working_margin: float = parameter(
        0.01, "the same while R is at S", "rad", least=0.0, most=0.5
    )
    gain: float = parameter(
        0.03,
        "so much more a place must have, and is good with",
        "rad",
        least=0,
        most=0.5,
    )
    working_distance: float = parameter(
        0.02, "of the tips, within it R is at S", "m", least=0.0, most=0.1
    )
    horizon: float = parameter(0.8, "it looks ahead", "s", least=0.0, most=5.0)
    clearance: float = parameter(
        0.004, "of its own shaft from organs and tools", "m", least=0.0, most=0.03
    )

    def rules(self) -> Rules:
        """What must hold across fields."""
        most = self.margin
        yield self.working_margin <= most, "working_margin", f"<= margin, {most} rad"


@compiled
def best_place(
    params: Any,
    scope: Any,
    p: Vector,
    shafts: np.ndarray,
    later: np.ndarray,
    organs: Organs,
    enough: float,
) -> tuple[Vector, float, float]:
    """Where the camera's tip should be, m, the margin there, rad, and the loss, s.

    Args:
        params: Of the planner.
        scope: Of the endoscope.
        p: Where it is, m.
        shafts: Tools, rows of fulcrum and tip (n, 6), R first, then S, m.
        later: The same at the horizon.
        organs: The organs.
        enough: A place with such a margin is good, rad.
    """
    g = xyz(scope.p_WG, 0)
    middle = scaled(0.5, plus(row_of(shafts[:, 3:], 0), row_of(shafts[:, 3:], 1)))
    axis = unit(sub(middle, g))
    e1 = any_perpendicular(axis)
    e2 = cross(axis, e1)
    best, least, most, shortest = p, 1e9, -1.0, 1e9
    apart = norm(sub(middle, g))
    for x in _AIMS:
        for y in _AIMS:
            u = unit(sub(along(along(middle, x, e1), y, e2), g))
            for k in range(_DEPTHS):
                q = scope.min_insertion + (apart - _NEAR - scope.min_insertion) * k / (
                    _DEPTHS - 1.0
                )
                if not scope.min_insertion <= q <= scope.max_insertion:
                    continue
                place = along(g, q, u)
                way = norm(sub(place, p))
                if shortest <= 0.0 and most >= enough and way >= least:
                    continue
                view = ViewCone(place, u, scope.half_angle)
                margin = least_margin(view, shafts, later, organs, enough)
                good, was_good = margin >= enough, most >= enough
                better = margin > most
                if good or was_good:
                    better = good and (way < least or not was_good)
                if shortest <= 0.0 and not better:
                    continue
                lost = expected_loss(
                    scope, p, place, params.horizon, shafts, later, organs, shortest
                )
                if lost > shortest or (lost >= shortest and not better):
                    continue
                if way_clear(g, p, place, shafts, later, organs, params.clearance):
                    best, least, most, shortest = place, way, margin, lost
    return best, most, shortest


@compiled
def known_velocity(tool: Estimate) -> Vector:
    """The part of a tool's velocity that is not its error, m/s."""
    speed = norm(tool.v)
    return scaled(max(0.0, 1.0 - _SURE * tool.sigma_v / max(speed, 1e-9)), tool.v)


@compiled
def shafts_of(
    robot: RobotTool, target: Estimate, obstacles: np.ndarray, ahead: float
) -> np.ndarray:
    """Tools as rows of fulcrum and tip (n, 6), R first, then S; `ahead` s later."""
    rows = np.empty((2 + len(obstacles), 6))
    # S stops where it works.
    goes = limited(scaled(ahead, known_velocity(target)), _FARTHEST)
    for i in range(3):
        rows[0, i], rows[0, 3 + i] = robot.fulcrum[i], robot.tip[i]
        rows[1, i] = target.fulcrum[i]
        rows[1, 3 + i] = target.p[i] + goes[i]
        for k in range(len(obstacles)):
            tool = read_estimate(obstacles[k])
            rows[2 + k, i] = tool.fulcrum[i]
            rows[2 + k, 3 + i] = tool.p[i] + ahead * known_velocity(tool)[i]
    return rows


@compiled
def _update(
    params: Any,
    scope: Any,
    values: np.ndarray,
    table: np.ndarray,
    view: ViewCone,
    shaft: Shaft,
    camera: Estimate,
    next_view: ViewCone,
    sight: Sight,
    place: Any,
    target: Estimate,
    robot: RobotTool,
    obstacles: np.ndarray,
    moved: np.ndarray,
) -> tuple[ViewCone, Shaft, Estimate, ViewCone, Sight, np.ndarray]:
    none = (0.0, 0.0, 0.0)
    wanted, moves, goal = none, sight.moves, (place[0], place[1], place[2])
    on_robot, on_target, waited = sight.robot, sight.target, place[3]
    if usable(target) and all_usable(obstacles) and finite_tool(robot):
        organs = Organs(values, table, moved)
        shafts = shafts_of(robot, target, obstacles, 0.0)
        later = shafts_of(robot, target, obstacles, params.horizon)
        at_work = norm(sub(robot.tip, target.p)) < params.working_distance
        needed = params.working_margin if at_work else params.margin
        enough = needed + params.gain
        on_robot = tip_margin(view, robot.tip, shafts, organs, enough)
        on_target = tip_margin(view, target.p, shafts, organs, enough)
        # On the way it counts what will be seen from where it goes to.
        there = goal if moves > 0.5 else camera.p
        here = least_margin(seen_from(scope, there), shafts, later, organs, enough)
        lost = expected_loss(
            scope, camera.p, there, params.horizon, shafts, later, organs, 1e3
        )
        waited += scope.period
        if (here < needed or lost > 0.0) and waited >= params.look_period:
            waited = 0.0
            found, margin, less = best_place(
                params, scope, camera.p, shafts, later, organs, enough
            )
            if less < lost or (less <= lost and margin > here + params.gain):
                goal, moves = found, 1.0
        if norm(sub(goal, camera.p)) < THERE:
            moves = 0.0
        if moves > 0.5:
            away = sub(goal, camera.p)
            wanted = limited(scaled(scope.rate, away), scope.max_speed)
    change = limited(sub(wanted, camera.v), scope.max_acceleration * scope.period)
    v = plus(camera.v, change)
    p = along(camera.p, scope.period, v)
    g = xyz(scope.p_WG, 0)
    q = max(scope.min_insertion, norm(sub(p, g)))
    p = along(g, q, unit(sub(p, g)))
    view = seen_from(scope, p)
    after = Estimate(p, v, none, g, 0.0, 0.0, 0.0, 1.0, 0.0)
    soon = p
    if moves > 0.5:
        soon = along(p, 1.0 - exp(-scope.rate), sub(goal, p))
    status = Sight(on_robot, on_target, moves)
    told = np.array((goal[0], goal[1], goal[2], waited))
    return view, Shaft(p, view.u), after, seen_from(scope, soon), status, told


class CameraPlanner(StepBlock):
    """Leads the endoscope so that both tips are seen; see the module.

    In the place of `Endoscope`: the same ports and more.

    Port ``target`` accepts the `Estimate` of S.
    Port ``robot_tool`` accepts the `RobotTool`.
    Port ``obstacles`` accepts the `Estimate` of every obstacle tool.
    Port ``organs`` accepts the `MovingPoint` of each organ; they rest without a wire.
    Port ``view_cone`` emits the `ViewCone`.
    Port ``shaft`` emits the endoscope's own `Shaft`.
    Port ``estimate`` emits what is known of it as of a surgeon's tool, an `Estimate`.
    Port ``next_view`` emits the `ViewCone` of a second later, for who plans the tool.
    Port ``sight`` emits the margins, `Sight`.
    """

    def __init__(
        self,
        params: CameraPlannerParams | None = None,
        scope: EndoscopeParams | None = None,
        obstacles: Sequence[str] = ("obstacle",),
        organs: OrganSet | None = None,
    ) -> None:
        """Makes the block.

        Args:
            params: Parameters; the defaults if None.
            scope: The endoscope and its limits; the defaults if None.
            obstacles: Names of the obstacle tools.
            organs: What else may be in the way; nothing if None.
        """
        super().__init__()
        params, scope = params or CameraPlannerParams(), scope or EndoscopeParams()
        check(params)
        organs = organs or OrganSet.nothing()
        record = endoscope_constants(scope)
        p = wanted_tip(record[0], np.array(scope.p_WS, float))
        g = vector(scope.p_WG)
        none = (0.0, 0.0, 0.0)
        view = ViewCone(p, unit(sub(p, g)), scope.half_angle)
        at_rest = MovingPoint(none, none)
        self.declare_update(
            _update,
            [packed(params, look_period=0.15), record, *arrays(organs)],
            {
                "target": Estimate,
                "robot_tool": RobotTool,
                "obstacles": Many(Estimate, tuple(obstacles)),
                "organs": Many(MovingPoint, organs.names),
            },
            {
                "view_cone": view,
                "shaft": Shaft(p, view.u),
                "estimate": Estimate(p, none, none, g, 0.0, 0.0, 0.0, 1.0, 0.0),
                "next_view": view,
                "sight": Sight(0.0, 0.0, 0.0),
                "_place": np.array([*p, 0.0]),
            },
            scope.period,
            timed=False,
            defaults={"organs": (at_rest,) * len(organs.names)},
        )
