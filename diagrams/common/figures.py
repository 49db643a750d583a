"""What the figures of a run are: unit and meaning of each key of `metrics.json`.

Files keep SI units; people are shown millimetres, minutes and per cent.
"""

from typing import Any, NamedTuple


class Figure(NamedTuple):
    """A figure: its SI unit, "%" for a share of 1, "" for none; and what it is."""

    unit: str
    meaning: str


FIGURES = {
    "system": Figure("", "the study that ran it"),
    "seed": Figure("", "of all randomness of the run"),
    "duration": Figure("s", "simulated"),
    "real_time_factor": Figure("x", "simulated over wall time"),
    "planner_step_median": Figure("s", "wall time of one instant of all blocks"),
    "error": Figure("", "why the run ended early or failed"),
    # gauze
    "reached": Figure("", "whether the target was reached, without contact"),
    "contact": Figure("", "whether the tools touched"),
    "time_to_target": Figure("s", "until the tip was at its target to stay"),
    "final_tip_error": Figure("m", "of the tip from its target at the end"),
    "recording_played": Figure("%", "of the tools' recordings, of the shortest share"),
    "min_tool_clearance": Figure("m", "least true gap to the obstacle tools"),
    "min_gauze_clearance": Figure("m", "least true gap of gauze to the obstacle tools"),
    "unavoidable": Figure("", "whether no dodge by who is told the future kept clear"),
    "registration_error": Figure("m", "of the tool as the tracker has it, at the end"),
    "rms_bend": Figure("m", "of the tip by the shaft's bend, rms"),
    "max_bend": Figure("m", "the same, greatest"),
    "rms_bend_error": Figure("m", "of the tip that is told, from the true one, rms"),
    "max_hand_force": Figure("N", "greatest of the robot's tool on the obstacle tools"),
    "max_grip_force": Figure("N", "of it in the hand that holds the tool"),
    "rms_tip_force_error": Figure("N", "of the force told at the tip, rms"),
    "min_target_clearance": Figure("m", "least true gap to the surgeon's tool"),
    "min_camera_clearance": Figure("m", "least true gap to the endoscope"),
    "max_lateral_force": Figure("N", "greatest true force of the wall, across"),
    "rms_lateral_force": Figure("N", "the same, root mean square"),
    "max_lateral_force_3s": Figure("N", "greatest true force after the first 3 s"),
    "rms_lateral_force_3s": Figure("N", "the same, root mean square"),
    "max_lateral_force_ever": Figure("N", "greatest from the start on, probing too"),
    "max_fulcrum_error": Figure("m", "greatest distance of shaft and fulcrum"),
    "max_fulcrum_error_3s": Figure("m", "the same after the first 3 s"),
    "rms_fulcrum_error": Figure("m", "distance of shaft and fulcrum, rms"),
    "time_in_view": Figure("%", "share of the time with the tip in the view cone"),
    "max_speed": Figure("m/s", "greatest of the tip"),
    "joint_limit_time": Figure("s", "with a joint at a limit"),
    "stops": Figure("", "every stop of the robot: why, when, how long"),
    "evasion_condition_held": Figure("%", "share of the time the promise is kept"),
    "dodging_time": Figure("s", "spent dodging"),
    "target_touched_before_hand_over": Figure("", "whether S was touched on the way"),
    "edge_switches": Figure("", "changes of the side that is passed"),
    "waiting_time": Figure("s", "spent waiting for a way"),
    "time_ratio": Figure("x", "time to target against that without the obstacle"),
    "min_organ_clearance": Figure("m", "least true gap of shaft and gauze to an organ"),
    "max_tissue_force": Figure("N", "greatest true force of an organ on the tool"),
    "press_force_mean": Figure("N", "true force on the organ while it is held, mean"),
    "press_force_worst": Figure("N", "the same, farthest from what is wanted"),
    "tips_in_view": Figure("%", "share of the time that both tips are seen, unblocked"),
    "camera_path": Figure("m", "of the endoscope's tip"),
    # passive wrist
    "wrist": Figure("", "how the wrist is led"),
    "time_over_warning": Figure("s", "with the force over the warning"),
    "time_over_limit": Figure("s", "with the force over the limit"),
    "rms_estimate_error": Figure("m", "of the estimated fulcrum, rms"),
    "rms_lateral_estimate_error": Figure("m", "the same, across the shaft"),
    "rms_depth_estimate_error": Figure("m", "the same, along the shaft"),
    "probe_peak_force": Figure("N", "greatest before the figures start"),
    "fulcrum_convergence_time": Figure(
        "s", "from the start until the estimate is within 1 mm to stay"
    ),
    "lateral_convergence_time": Figure("s", "the same, across the shaft"),
    "depth_convergence_time": Figure("s", "the same, along the shaft"),
    "fulcrum_error_3s": Figure("m", "of the estimate after 3 s"),
    "nees_above_95": Figure("%", "share of normalised errors above the 95 % point"),
    "stiffness_estimate": Figure("N/m", "of the trocar, as learnt"),
    "breathing_rate_estimate": Figure("Hz", "as learnt; 0 if none"),
    "jumps_followed": Figure("", "of the wall"),
    "estimates_refused": Figure("", "estimates that were not believed"),
    "time_frozen": Figure("s", "with the estimate held"),
    "time_inaccurate": Figure("s", "in which navigation was not said to be accurate"),
    "accuracy_alarms": Figure("", "times that it was found not to be"),
    "mean_speed_scale": Figure("%", "of the speed that the wrist allowed"),
    "time_to_2N": Figure("s", "until the force is down to 2 N"),
    "time_to_02N": Figure("s", "until it is down to 0.2 N"),
    # keyhole
    "rms_tool_error": Figure("m", "tool from its reference, rms"),
    "max_tool_error": Figure("m", "the same, greatest"),
    "time_at_work": Figure("s", "with the tool at its plan"),
    "rms_organ_error": Figure("m", "of the estimated organ, rms"),
    "max_organ_error": Figure("m", "the same, greatest"),
    "max_body_deviation": Figure("m", "of the snake's body off its plan, by the tube"),
    "max_coupler_error": Figure("rad", "greatest between the balls of a module"),
    "gate_opened": Figure("s", "when the snake was let out"),
    "max_stray": Figure("m", "of the tool from its way while it is halted"),
    "withdrawal_time": Figure("s", "longest that drawing back took"),
    "ik_refused": Figure("%", "share of poses without a posture"),
    "drums_limited": Figure("%", "share of the time with a drum at its limit"),
    "phases": Figure("", "each phase: when, and why it was entered"),
    "max_body_error": Figure("m", "greatest of the snake's body from its plan"),
    # navigation
    "collided": Figure("", "whether the robot touched anything"),
    "min_clearance": Figure("m", "least gap to an obstacle"),
    "path_ratio": Figure("x", "path against the straight line"),
    "mode_switches": Figure("", "changes between the two potentials"),
    "outrun_time": Figure("s", "with a faster obstacle too near to be avoided"),
    "faster_obstacles": Figure("", "obstacles that outran the robot"),
    "goal_miss": Figure("m", "of the true place from the goal at the end"),
    "max_place_error": Figure("m", "greatest of the believed place"),
    "max_heading_error": Figure("rad", "greatest of the believed heading"),
    "place_within_3_sigma": Figure("%", "share of the time it is as sure as it says"),
    "walkers_tracked": Figure("%", "of who moves within the vision, hidden or not"),
    "median_track_error": Figure("m", "of the tracks' places"),
    "median_track_velocity_error": Figure("m/s", "of the tracks' velocities"),
    # snake
    "max_pose_error": Figure("m", "of the tool, greatest"),
    "rms_pose_error": Figure("m", "the same, rms"),
    "max_axis_error": Figure("rad", "of the tool's axis, greatest"),
    "max_split": Figure("rad", "greatest between the bends of a module's balls"),
    "max_torsion": Figure("rad", "greatest of a ball"),
    "loop_width": Figure("m", "tool there and back at the same bend, greatest"),
    "least_eigenvalue": Figure("N m/rad", "least of the energy's Hessian"),
    "buckled_at": Figure("s", "when the snake was noticed to be lost"),
    "min_tension": Figure("N", "least of any wire"),
    "max_tension": Figure("N", "greatest of any wire"),
    "tension_inside": Figure("%", "share of tip tensions within their bounds"),
    "tension_width": Figure("N", "between those bounds, median"),
    "cell_code": Figure("", "why load cells are not believed, 0 if they are"),
    "contact_at": Figure("s", "when the sensor under the drive pack first told one"),
    "false_contacts": Figure("", "times that it told one without a force"),
    "break_detection_time": Figure("s", "from a wire's break to the alarm"),
    "false_alarms": Figure("", "alarms without a break"),
    "refused_poses": Figure("", "poses out of reach"),
    # resection
    "tumour_volume": Figure("m3", "as operated on"),
    "mask_volume": Figure("m3", "of the mask itself"),
    "cap_volume": Figure("m3", "of the tumour that the channel takes"),
    "channel_volume": Figure("m3", "of brain that the channels bore, on the grid"),
    "reachable_fraction": Figure("%", "of the tumour that can be reached"),
    "planned_fraction": Figure("%", "of the tumour that the plan takes"),
    "resected_fraction": Figure("%", "of the tumour that was taken"),
    "healthy_removed": Figure("m3", "healthy tissue that was taken"),
    "max_outside_depth": Figure("m", "greatest depth of that"),
    "min_critical_distance": Figure("m", "least of the robot to what is critical"),
    "body_collisions": Figure("", "of the robot's body with tissue"),
    "procedures": Figure("", "that were planned"),
    "strokes": Figure("", "continuous passes of the tool that finish"),
    "single_step_share": Figure("%", "of the resected volume, by single steps"),
    "entries": Figure("", "channels that were used"),
    "tool_changes": Figure("", "of the tool, in the plan"),
    "tool_change_time": Figure("s", "that tool changes take"),
    "bored_healthy": Figure("m3", "healthy tissue that further channels bored"),
    "critical_touched": Figure("", "whether anything critical was touched"),
    "planning_time": Figure("s", "wall time of the plan"),
    "reach_time": Figure("s", "wall time of the reachable part"),
    "access_time": Figure("s", "wall time of the proposed access"),
    "execution_time": Figure("s", "simulated"),
    "resumed_at": Figure("s", "where an interrupted execution went on"),
    "path_length": Figure("m", "of the tool"),
    "time_waited": Figure("s", "of the robot, with no procedure to be begun"),
    "choices": Figure("", "made while it worked: when, the line, the answer"),
    "refusals": Figure("", "procedures that cannot be, and why"),
    "unreached": Figure("", "parts that stay"),
}
"""By key. A figure that several systems have means the same in all."""

_SCALES = {
    "m": [(1.0, 1.0, "m"), (1e-3, 1e3, "mm"), (0.0, 1e6, "um")],
    "m/s": [(1.0, 1.0, "m/s"), (0.0, 1e3, "mm/s")],
    "m3": [(1e-6, 1e6, "cm3"), (0.0, 1e9, "mm3")],
    "s": [
        (180.0, 1.0 / 60.0, "min"),
        (1.0, 1.0, "s"),
        (1e-3, 1e3, "ms"),
        (0.0, 1e6, "us"),
    ],
    "rad": [(0.02, 57.29577951308232, "deg"), (0.0, 1e3, "mrad")],
    "%": [(-1e9, 100.0, "%")],
}


def in_words(key: str, value: Any) -> str:
    """A figure as people say it: `7.6 mm`, not 0.007589."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value is None:
        return "-"
    if isinstance(value, dict):
        return ", ".join(
            f"{name} {in_words(name, item)}" for name, item in value.items()
        )
    if isinstance(value, list):
        items = [in_words(_PARTS.get(key, ""), item) for item in value]
        return "; ".join(items) if items else "none"
    if not isinstance(value, int | float):
        return str(value)
    unit = FIGURES[key].unit if key in FIGURES else _UNITS.get(key, "")
    if value == 0:
        return f"0 {unit}".rstrip()
    for least, scale, name in _SCALES.get(unit, []):
        if abs(value) >= least:
            return f"{value * scale:.3g} {name}"
    text = f"{value:.4g}" if isinstance(value, float) else str(value)
    return f"{text} {unit}".rstrip()


_PARTS = {"where": "length"}
_UNITS = {"start": "s", "end": "s", "volume": "m3", "depth": "m", "length": "m"}
"""Of figures within figures."""


def table(figures: dict[str, Any]) -> str:
    """The figures of a run as a table, lists one line an item."""
    width = max(len(key) for key in figures)
    lines = []
    for key, value in figures.items():
        items = value if isinstance(value, list) and value else [value]
        for index, item in enumerate(items):
            lines.append(f"  {'' if index else key:<{width}}  {in_words(key, item)}")
    return "\n".join(lines)
