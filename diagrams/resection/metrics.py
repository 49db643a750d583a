"""The figures of a resection: what was planned, and what was really done."""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import ndimage

from diagrams.snake.robot import ball_figures, is_free
from plants.snake.balls import corners_of, turns_of_angles
from plants.snake.kinematics import centreline
from plants.tissue.labels import BRAIN, CAP, CHANNEL, CRITICAL
from plants.tissue.space import SOLID
from systems.resection.planning.next_entry import bored_healthy
from systems.resection.planning.session import STROKES, Session
from systems.resection.wires.procedure_player import played, profile


def carving_of(run: Any) -> Any:
    """The executed tissue of a run (`plants.tissue.tissue_carver.Carving`)."""
    station = run.diagram.GetSubsystemByName("station")
    return station.GetSubsystemByName("tissue_carver").carving


def outside_depth(volume: Any) -> float:
    """How deep into healthy tissue anything was removed, outside the channel, in m."""
    wrong = (volume.tau != SOLID) & np.isin(volume.labels, (BRAIN, CRITICAL))
    for channel in volume.more:
        wrong &= ~volume.tube(channel)
    if not wrong.any():
        return 0.0
    healthy = np.isin(volume.labels, (BRAIN, CRITICAL))
    depth = ndimage.distance_transform_edt(healthy)
    return float(depth[wrong].max() * volume.spacing)


def freeing_runs(session: Session) -> list[NDArray]:
    """Stretches of a plan in which every move frees tumour: how much each, in m3."""
    volume = session.volume
    gone = volume.tau[volume.resected & (volume.tau > 0)]
    gains = np.bincount(gone, minlength=int(session.tree.size[1])) * volume.voxel
    ends = np.flatnonzero(np.diff((gains > 0.0).astype(int), prepend=0, append=0))
    return [gains[first:last] for first, last in ends.reshape(-1, 2)]


def single_step_share(runs: list[NDArray]) -> float:
    """Of what a plan removes, what single moves do between others that free nothing."""
    whole = sum(float(run.sum()) for run in runs)
    single = sum(float(run[0]) for run in runs if len(run) == 1)
    return single / whole if whole > 0.0 else 0.0


def times_of(run: Any) -> NDArray:
    """When each posture of the plan was reached, in s, (n,); 0 for those before."""
    if run.case.choosing is None:
        station = run.diagram.GetSubsystemByName("station")
        times: NDArray = station.GetSubsystemByName("procedure_player").times
        return times
    reached, time = run.plan.progress.posture, run.signals["time"]
    numbers = np.arange(len(run.case.session.postures))
    index = np.minimum(np.searchsorted(reached, numbers), len(time) - 1)
    return np.where(numbers <= run.case.done.posture, 0.0, time[index])


def body_error(run: Any) -> NDArray:
    """How far the snake is from where it is to be, each corner in m, (n, 8).

    The corners are six ball centres, O3 and the tool, `plants.snake.balls.corners_of`.
    """
    case, scenario = run.case, run.scenario
    first = case.done.posture
    x, waits = case.session.postures[first:], case.waits[first:]
    player = replace(scenario.player, lead=scenario.period)
    plan = profile(x, player, waits)
    wanted = np.array([played(x, plan, player, t) for t in run.signals["time"]])
    s, turns = run.snake.posture.q[:, 0], turns_of_angles(run.snake.balls.q)
    true = corners_of(turns, s, scenario.snake)
    error: NDArray = np.linalg.norm(true - centreline(wanted, scenario.snake), axis=2)
    return error


def _free(run: Any) -> dict[str, Any]:
    """What is told of a snake of free balls besides."""
    return {
        "max_body_error": None
        if run.case.choosing  # no profile is that of the whole plan
        else float(body_error(run)[:, :-1].max()),
        **ball_figures(run),
    }


def measure(run: Any) -> dict[str, Any]:
    """The figures of a run, as `metrics.json` keeps them."""
    session, reach, choosing = run.case.session, run.case.reach, run.case.choosing
    planning = run.case.planning_time
    if choosing:
        reach = choosing.console.reach
        planning += choosing.planning_time
    removed, touched = run.tissue.removed, run.tissue.touched
    nearest = float(touched.critical_distance[-1])
    error = np.linalg.norm(run.snake.tool.p - run.tip.reference.p, axis=1)
    volume = session.volume.tumour_volume
    steps, runs = session.steps, freeing_runs(session)
    cap, channel = (
        int(np.count_nonzero(session.volume.labels == label)) * session.volume.voxel
        for label in (CAP, CHANNEL)
    )
    return {
        "tumour_volume": volume,
        "mask_volume": session.volume.mask_volume,
        "cap_volume": cap,
        "channel_volume": channel,
        "reachable_fraction": reach.fraction,
        "planned_fraction": session.fraction,
        "resected_fraction": float(removed.tumour[-1]) / volume,
        "healthy_removed": float(removed.healthy[-1]),
        "max_outside_depth": outside_depth(carving_of(run).volume),
        "entries": 1 + len(session.volume.more),
        "bored_healthy": bored_healthy(session.volume),
        "tool_changes": len(session.tools),
        "tool_change_time": len(session.tools) * run.case.scenario.balls.time,
        "min_critical_distance": nearest if nearest >= 0.0 else None,
        "body_collisions": int(touched.hits[-1]),
        "procedures": sum(step.kind not in ("home", STROKES) for step in steps),
        "strokes": len(runs),
        "single_step_share": single_step_share(runs),
        "access_time": run.case.access_time,
        "planning_time": planning,
        "reach_time": reach.time,
        "execution_time": run.case.done.time + run.simulated,
        "resumed_at": run.case.done.time,
        "path_length": float(run.tissue.way.length[-1]),
        "max_tool_error": float(error.max()),
        "rms_tool_error": float(np.sqrt(np.mean(error**2))),
        **(choosing.figures(run) if choosing else {}),
        **(_free(run) if is_free(run.scenario) else {}),
        "refusals": run.case.refusals,
        "unreached": [
            {"volume": lump.volume, "where": lump.where, "reason": lump.reason}
            for lump in reach.lumps[:12]
        ],
    }
