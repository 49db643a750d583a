"""What a plan comes to if the snake strays: executed share and contact against error.

Kinematics alone: how the balls of a run strayed, sampled at the log's period, is scaled
until the tool's rms error is what is asked for, and played on a plan over and over;
what that snake carves and touches is counted as in the diagram.
"""

from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from diagrams.common.plots import COLORS, add_axes, new_figure
from diagrams.resection.metrics import outside_depth
from diagrams.resection.operation import Operation
from plants.snake.balls import ball_posture, corners_of, turns_of_angles
from plants.tissue.tissue_carver import Carving
from systems.resection.wires.procedure_player import played, profile

Floats = NDArray[np.float64]


class Strayed(NamedTuple):
    """What came of a plan.

    Attributes:
        error: Of the tool, rms, in m.
        executed: Tumour removed, as a share of what the plan's clearance lets reach.
        resected: The same of the whole tumour.
        healthy: Other tissue removed, as a share of the tumour.
        depth: Of that, in m.
        contact: Share of the checks that found the body in tissue.
    """

    error: float
    executed: float
    resected: float
    healthy: float
    depth: float
    contact: float


def planned_balls(case: Operation, times: Floats) -> Floats:
    """Ball postures (n, 19) that a plan asks for."""
    player = replace(case.scenario.player, lead=case.scenario.period)
    x = case.session.postures
    plan = profile(x, player, case.waits)
    return np.array([ball_posture(played(x, plan, player, t)) for t in times])


def stray(run: Any) -> Floats:
    """How far the balls of a run were off their plan, (n, 19), at its log's times."""
    true = np.column_stack([run.snake.posture.q[:, 0], run.snake.balls.q])
    return true - planned_balls(run.case, run.signals["time"])


def carried_out(
    case: Operation, off: Floats, log_period: float, error: float
) -> Strayed:
    """Carries a plan out with a snake that strays.

    Args:
        case: The plan.
        off: As `stray` tells it, (n, 19).
        log_period: Between its rows, in s.
        error: The tool's rms error that it is scaled to, in m.
    """
    scenario, session = case.scenario, case.session
    player = replace(scenario.player, lead=scenario.period)
    end = profile(session.postures, player, case.waits).times[-1]
    times = np.arange(0.0, end + player.dwell, scenario.period)
    wanted = planned_balls(case, times)
    rows = np.arange(len(off)) * log_period
    at = np.mod(times, rows[-1])
    strays = np.column_stack([np.interp(at, rows, column) for column in off.T])
    ideal = _tools(wanted, case)
    scale = error / max(_rms(_tools(wanted + strays, case) - ideal), 1e-12)
    x = wanted + scale * strays
    carving = Carving(session.volume, scenario.snake)
    removed, checks = np.zeros(3), 0
    for k in range(1, len(x)):
        move = carving.move(k - 1, x[k - 1], x[k], scenario.carver.pitch)
        removed += move[:3]
        checks += max(1, int(np.ceil(move[4] / scenario.carver.pitch)))
    tumour, healthy = removed[:2] * session.volume.voxel / session.volume.tumour_volume
    fraction = case.reach.fraction if case.reach else 1.0
    return Strayed(
        _rms(_tools(x, case) - ideal),
        float(tumour / fraction),
        float(tumour),
        float(healthy),
        outside_depth(carving.volume),
        float(removed[2] / checks),
    )


def _tools(balls: Floats, case: Operation) -> Floats:
    turns, snake = turns_of_angles(balls[:, 1:]), case.scenario.snake
    return corners_of(turns, balls[:, 0], snake)[:, -1]


def _rms(off: Floats) -> float:
    return float(np.sqrt((off**2).sum(axis=1).mean()))


def error_figure(curves: dict[str, list[Strayed]]) -> Any:
    """Executed share, healthy tissue and contact against the tool's error."""
    figure = new_figure(9.0, 3.0)
    parts = {
        "of what can be reached": "executed",
        "healthy, of the tumour": "healthy",
        "checks with body in tissue": "contact",
    }
    for place, (title, name) in enumerate(parts.items(), 1):
        axes = add_axes(figure, 1, 3, place, title=title)
        axes.set_xlabel("tool error rms [mm]")
        axes.set_ylabel("%")
        for color, (label, rows) in zip(COLORS.values(), curves.items(), strict=False):
            errors = [1e3 * row.error for row in rows]
            shares = [100 * getattr(row, name) for row in rows]
            axes.plot(errors, shares, "o-", color=color, label=label)
        axes.set_ylim(0, 1.1 * axes.get_ylim()[1])
        if place == 1:  # where it hides no curve
            axes.legend(loc="lower right")
    return figure
