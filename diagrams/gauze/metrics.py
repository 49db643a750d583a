"""The figures of a gauze delivery, all from true quantities."""

from typing import Any

import numpy as np

from diagrams.bedside.wrist_metrics import (
    AFTER,
    most,
    rms,
    true_tip,
    wrist_figures,
)
from diagrams.gauze.bypass_metrics import bypass_figures
from diagrams.gauze.contact import contact_figures
from diagrams.gauze.foresight import Reach, unavoidable
from diagrams.gauze.organs import organ_figures
from diagrams.gauze.scenes import CONTACT
from diagrams.gauze.sight import sight_figures
from diagrams.gauze.tools import TARGET, gap, logged
from plants.instruments.instrument import GAUZE_RADIUS
from plants.surgeon.recording import load_recording
from systems.common.geometry import closest_on_segment
from systems.common.signal import vector
from systems.common.stops import Stop

REACHED_DISTANCE = 0.002
"""The gauze is delivered while the tip is this close to S's true tip [m] ..."""
REACHED_TIME = 0.5
"""... for this long [s]."""


def spans(flags: np.ndarray) -> list[tuple[int, int]]:
    """First and last index of each run of true values."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(int), [0]])))
    return [(int(a), int(b) - 1) for a, b in edges.reshape(-1, 2)]


def time_to_target(time: np.ndarray, tip_error: np.ndarray) -> float | None:
    """When the tip first came within 2 mm to stay for 0.5 s; None if never."""
    for first, last in spans(tip_error <= REACHED_DISTANCE):
        if time[last] - time[first] >= REACHED_TIME - 1e-9:
            return float(time[first])
    return None


def stops(time: np.ndarray, codes: np.ndarray) -> list[dict[str, Any]]:
    """Every stop of the robot: reason, start [s] and duration [s].

    Waiting for the tracker's first frame is no stop: the robot has not moved yet.
    """
    found = []
    for stop in set(Stop) - {Stop.MOVING, Stop.WAITING}:
        for first, last in spans(np.round(codes) == stop):
            end = time[min(last + 1, len(time) - 1)]
            start = float(time[first])
            found.append(
                {"reason": stop.text, "start": start, "duration": float(end) - start}
            )
    return sorted(found, key=lambda one: one["start"])


def recordings_played(run: Any) -> float | None:
    """The least share of a tool's recording that the run played; None without one."""
    time = float(run.signals["time"][-1])
    tools = [*run.scenario.of_role(TARGET), *run.scenario.obstacles]
    ends = [float(load_recording(t.recording)[0][-1]) for t in tools if t.recording]
    return min((min(time / end, 1.0) for end in ends), default=None)


def in_cone(points: np.ndarray, cone: Any) -> np.ndarray:
    """Whether each point (n, 3) lies in its view cone, shape (n,)."""
    rays = points - cone.apex
    cosine = np.einsum("ni,ni->n", rays, cone.u) / np.linalg.norm(rays, axis=1)
    return np.arccos(np.clip(cosine, -1.0, 1.0)) <= cone.half


def tool_lines(run: Any) -> tuple[np.ndarray, np.ndarray]:
    """True tips and shafts' inner ends of the obstacles over time (n, tools, 3) [m]."""
    shafts = [logged(run, tool).shaft for tool in run.scenario.obstacles]
    tips = np.stack([shaft.tip for shaft in shafts], axis=1)
    # Where each axis is at its trocar's height: the wall's own breath is small there.
    u = np.stack([shaft.u for shaft in shafts], axis=1)
    high = np.array([tool.p_WG[2] for tool in run.scenario.obstacles])
    back = (tips[..., 2] - high) / np.minimum(u[..., 2], -0.1)
    return tips, tips - back[..., None] * u


def gauze_clearance(run: Any) -> float:
    """Least distance of the gauze's surface at R's tip from an obstacle's [m]."""
    tips, ends = tool_lines(run)
    ways = zip(true_tip(run), tips, ends, strict=True)
    least = min(
        closest_on_segment(vector(p), vector(a), vector(b))[1]
        for p, each, inner in ways
        for a, b in zip(each, inner, strict=True)
    )
    return least - GAUZE_RADIUS - CONTACT / 2.0


def could_not_be_avoided(run: Any) -> bool:
    """Whether a robot that knew the future would have been touched as well."""
    s = run.scenario
    nav = s.navigation
    reach = Reach(
        nav.escape_speed,
        nav.escape_acceleration,
        nav.wrist_speed / (nav.shaft_length - nav.min_insertion),
        nav.min_insertion,
        nav.max_tilt,
    )
    tips, fulcrums = tool_lines(run)
    start = vector(s.robot.p_WP)
    time = run.signals["time"]
    return unavoidable(
        reach, CONTACT, time, vector(s.robot.p_WG), start, tips, fulcrums
    )


def registration_error(run: Any) -> float:
    """By how much S's tip is misplaced at the end by tracker and alignment [m]."""
    told, believed = run.scenario.tracker, run.tracker.alignment
    p = logged(run, run.scenario.target).shaft.tip[-1]
    off = np.array(told.shift) - believed.t[-1]
    turned = np.array(told.turn) - believed.theta[-1]
    return float(np.linalg.norm(off + np.cross(turned, p)))


def measure(run: Any) -> dict[str, Any]:
    """The figures of a run, as `metrics.json` keeps them."""
    time = run.signals["time"]
    tip = true_tip(run)
    tip_error = np.linalg.norm(tip - logged(run, run.scenario.target).shaft.tip, axis=1)
    force = np.linalg.norm(run.wall.force.f, axis=1)
    arrival = time_to_target(time, tip_error)
    touched = bool(gap(run, "obstacle").min() <= 0.0)
    speed = np.linalg.norm(np.gradient(tip, time, axis=0), axis=1)
    figures = {
        "reached": arrival is not None and not touched,
        "contact": touched,
        "time_to_target": arrival,
        "final_tip_error": float(tip_error[-1]),
        "min_tool_clearance": float(gap(run, "obstacle").min()),
        "min_target_clearance": float(gap(run, "target").min()),
        "min_camera_clearance": float(gap(run, "camera").min()),
        "max_lateral_force": float(force.max()),
        "rms_lateral_force": float(np.sqrt(np.mean(force**2))),
        "max_fulcrum_error": float(run.wall.fulcrum_error.distance.max()),
        "max_lateral_force_3s": most(force[time >= AFTER]),
        "rms_lateral_force_3s": rms(force[time >= AFTER]),
        "min_gauze_clearance": gauze_clearance(run),
        "unavoidable": could_not_be_avoided(run),
        "time_in_view": float(
            in_cone(tip, logged(run, run.scenario.camera).view_cone).mean()
        ),
        "max_speed": float(speed.max()),
        "joint_limit_time": float(np.mean(run.joints.status.code == 1) * time[-1]),
        "stops": stops(time, run.navigation.stop.code),
    }
    played = recordings_played(run)
    if played is not None:
        figures["recording_played"] = played
    if run.scenario.registration.active:
        figures["registration_error"] = registration_error(run)
    figures |= bypass_figures(run, arrival, tip_error) | organ_figures(run)
    figures |= sight_figures(run) | contact_figures(run)
    if run.scenario.emulated:
        figures |= wrist_figures(run, run.scenario.measure_from)
    return figures
