"""The page of the papers: every statement, where it is, what tests it, the verdict.

`python -m tests.papers` writes `PAPERS.md` from the rows below; `test_papers.py` fails
when a row's file or test is gone, or the page is not what the rows say.
"""

import ast
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "PAPERS.md"
FAITHFUL, CORRECTED, VARIANT, NOT = "faithful", "corrected", "variant", "not modelled"
VERDICTS = (FAITHFUL, CORRECTED, VARIANT, NOT)
"""As printed; as it must have been meant; our reading of the open; left out."""


class Row(NamedTuple):
    """An item of a paper: what it says, file, test (`file::name`), figure, verdict."""

    says: str
    file: str
    test: str
    figure: str
    verdict: str


GUIDE, GAUZE = "systems/auto_guidance", "tests/diagrams/gauze/test_scenarios.py"
GUIDED = f"tests/{GUIDE}"
WRIST, WRISTED = "systems/passive_wrist", "tests/systems/passive_wrist"
BEDSIDE = "tests/diagrams/wrist/test_scenarios.py"
SWITCH, SWITCHED = "systems/switching", "tests/systems/switching"
NAVIGATED = "tests/diagrams/navigation/test_navigation.py"
SNAKE, SNAKED = "plants/snake", "tests/plants/snake"
CUT, RESECTED = "systems/resection/planning", "tests/systems/resection/planning"
OPERATED = "tests/diagrams/resection/test_resection.py"

PAPERS: dict[str, list[Row]] = {
    "Bauzano, Muñoz, Garcia-Morales: auto-guided movements": [
        Row(
            "Figures 1, 2: four tools, planner, wrist, arm",
            "diagrams/gauze/diagram.py",
            f"{GAUZE}::test_every_scenario_delivers_without_contact",
            "`trocar diagram gauze_static`",
            FAITHFUL,
        ),
        Row(
            "Figure 2: O's trajectory is estimated by velocity and acceleration",
            "systems/sensing/trajectory_estimator.py",
            "tests/systems/sensing/test_singer.py::"
            "test_prediction_is_the_exact_discretisation",
            "",
            VARIANT,
        ),
        Row(
            "2.1: four degrees of freedom through the fulcrum",
            "systems/motion/tool_navigation.py",
            "tests/systems/motion/test_tool_navigation.py::"
            "test_the_tip_moves_with_the_guide_points_velocity_over_s",
            "",
            FAITHFUL,
        ),
        Row(
            "2.1: R and S stay in the view cone, which follows S",
            "systems/motion/endoscope.py",
            f"{GAUZE}::test_every_scenario_delivers_without_contact",
            "replay",
            FAITHFUL,
        ),
        Row(
            "2.1: the visual servoing problem is solved",
            "systems/sensing/optical_tracker.py",
            "tests/systems/sensing/test_optical_tracker.py::"
            "test_noise_is_that_of_a_fitted_marker_body",
            "",
            VARIANT,
        ),
        Row(
            "3, Figure 3: phi by a spring whose force and stiffness are known",
            f"{WRIST}/wrist_law.py",
            f"{BEDSIDE}::test_breathing_under_a_ventilator_against_the_printed_law",
            "`forces.png`",
            FAITHFUL,
        ),
        Row(
            "3: the fulcrum is estimated by force",
            f"{WRIST}/fulcrum_tracker.py",
            f"{GAUZE}::test_depth_of_the_fulcrum_ten_seconds_after_the_start",
            "`estimate.png`",
            VARIANT,
        ),
        Row(
            "3 i): the force tells whether navigation is accurate, while it runs",
            f"{WRIST}/navigation_monitor.py",
            f"{BEDSIDE}::test_whether_navigation_is_accurate_is_said_while_it_runs",
            "`wrist.accuracy` in `signals.csv`",
            VARIANT,
        ),
        Row(
            "3 ii): breathing and air pressure move the fulcrum",
            f"{WRIST}/breathing_rate.py",
            f"{BEDSIDE}::test_insufflation",
            "`estimate.png`",
            FAITHFUL,
        ),
        Row(
            "Figure 3: arcs from A to B about the believed fulcrum",
            f"{WRIST}/arc_navigation.py",
            f"{BEDSIDE}::test_arcs_about_a_wrong_guess",
            "`pwe_arc`",
            FAITHFUL,
        ),
        Row(
            "4.1, Figure 5: guide point M_R and its target",
            f"{GUIDE}/go_to_target.py",
            f"{GUIDED}/test_go_to_target.py::"
            "test_guide_point_and_its_target_in_a_scene_worked_out_by_hand",
            "`virtual_force.png`",
            FAITHFUL,
        ),
        Row(
            "(1), (2): virtual force with an escape",
            f"{GUIDE}/go_to_target.py",
            f"{GUIDED}/test_go_to_target.py::"
            "test_printed_force_is_equation_2_to_the_letter",
            "`three_forms.png`",
            CORRECTED,
        ),
        Row(
            "(3): conical gain",
            f"{GUIDE}/go_to_target.py",
            f"{GUIDED}/test_go_to_target.py::test_conical_gain",
            "",
            FAITHFUL,
        ),
        Row(
            "(4): velocity from the force",
            f"{GUIDE}/go_to_target.py",
            f"{GUIDED}/test_go_to_target.py::test_printed_form_never_comes_to_rest",
            "`speeds.png`",
            CORRECTED,
        ),
        Row(
            "Table I, read on v_R or v_1",
            f"{GUIDE}/fuzzy_arbiter.py",
            f"{GUIDED}/test_fuzzy_arbiter.py::"
            "test_figure_4_reads_the_current_velocity_and_the_default_the_wanted_one",
            "",
            VARIANT,
        ),
        Row(
            "Table I, its 16 cells",
            f"{GUIDE}/fuzzy_arbiter.py",
            f"{GUIDED}/test_fuzzy_arbiter.py::test_each_cell_of_table_i",
            "",
            FAITHFUL,
        ),
        Row(
            "Table II, its 25 cells, in full",
            f"{GUIDE}/velocity_corrections.py",
            f"{GUIDED}/test_velocity_corrections.py::"
            "test_the_block_keeps_each_cells_share_in_full",
            "",
            FAITHFUL,
        ),
        Row(
            "(5): backward movement",
            f"{GUIDE}/backward_movement.py",
            f"{GUIDED}/test_backward_movement.py::test_the_time_constant_is_one_over_b",
            "",
            CORRECTED,
        ),
        Row(
            "4.3: pushed aside, R follows, waits and goes on",
            "diagrams/gauze/scenarios/gauze_push.yaml",
            f"{GAUZE}::test_push_aside",
            "`speeds.png`",
            FAITHFUL,
        ),
        Row(
            "(6): the weighted sum",
            f"{GUIDE}/fuzzy_arbiter.py",
            f"{GUIDED}/test_fuzzy_arbiter.py::test_equation_6",
            "",
            FAITHFUL,
        ),
        Row(
            "5.1, Figure 7: O stands, a dip of the speed",
            "diagrams/gauze/scenarios/gauze_static.yaml",
            f"{GAUZE}::test_static_surgeon_of_figure_7",
            "`trajectory.png`, `speeds.png`",
            FAITHFUL,
        ),
        Row(
            "5.2, Figure 8: O moves, R follows it",
            "diagrams/gauze/scenarios/gauze_dynamic.yaml",
            f"{GAUZE}::test_dynamic_surgeon_of_figure_8",
            "the same",
            FAITHFUL,
        ),
        Row(
            "5: the gauze's weight, which the wrist is told, and its clearance",
            "plants/instruments/instrument.py",
            f"{GAUZE}::test_gauze_has_its_weight_and_the_wrist_is_told_it",
            "`min_gauze_clearance`",
            VARIANT,
        ),
        Row(
            "6: no tissue collisions (future in the paper)",
            "systems/bypass/organ_route.py",
            "tests/diagrams/gauze/test_organs.py::"
            "test_the_lobe_is_passed_and_nothing_touched",
            "`gauze_organs`",
            VARIANT,
        ),
        Row(
            "6: camera interaction (future in the paper)",
            "systems/motion/camera_planner.py",
            "tests/diagrams/gauze/test_camera.py::"
            "test_it_moves_out_of_what_would_block_it",
            "`camera_blocked`",
            VARIANT,
        ),
    ],
    "Thesis: potenziali artificiali alternati": [
        Row(
            "1.2: discs, seen within R_v",
            f"{SWITCH}/perception.py",
            f"{SWITCHED}/test_perception_and_control.py::"
            "test_perception_sees_within_its_disc_and_adds_noise",
            "",
            FAITHFUL,
        ),
        Row(
            "(1) attractive potential",
            f"{SWITCH}/fields.py",
            f"{SWITCHED}/test_fields.py::test_fields_are_anti_gradients",
            "`figure_04`",
            FAITHFUL,
        ),
        Row(
            "(2) its anti-gradient, printed as a length",
            f"{SWITCH}/classical_planner.py",
            f"{SWITCHED}/test_perception_and_control.py::"
            "test_equation_2_as_printed_leads_nowhere",
            "`figure_05`",
            CORRECTED,
        ),
        Row(
            "(3) repulsive potential, printed without its square",
            f"{SWITCH}/fields.py",
            f"{SWITCHED}/test_fields.py::"
            "test_repulsion_is_continuous_at_its_border_but_not_as_printed",
            "`figure_06a`, `figure_06b`",
            CORRECTED,
        ),
        Row(
            "(4) their sum, Figure 7",
            f"{SWITCH}/classical_planner.py",
            f"{SWITCHED}/test_perception_and_control.py::"
            "test_both_forms_push_away_and_keep_the_speed",
            "`figure_07`",
            FAITHFUL,
        ),
        Row(
            "Figure 8: the sum vanishes half-way; here 0.43 m before",
            "diagrams/navigation/scenarios/nav_local_minimum.yaml",
            f"{SWITCHED}/test_perception_and_control.py::"
            "test_where_the_sum_vanishes_before_a_gap",
            "`potential`, `field_along`",
            VARIANT,
        ),
        Row(
            "(5) to (7), Figures 9, 10: helicoid",
            f"{SWITCH}/fields.py",
            f"{SWITCHED}/test_fields.py::test_helicoid_of_the_thesis",
            "`figure_09a`, `figure_09b`, `figure_10`",
            FAITHFUL,
        ),
        Row(
            "3.2, Figure 11 and the notes' two cases: a reconstruction",
            f"{SWITCH}/statechart_planner.py",
            f"{SWITCHED}/test_statechart_planner.py::"
            "test_circles_are_tangent_and_the_heading_never_jumps",
            "`figure_11`, `notes_two_cases`",
            VARIANT,
        ),
        Row("Figure 12: flowchart, empty on our copy", "", "", "", NOT),
        Row(
            "3.1.1: obstacles, own place and a grid as perceived (headings only)",
            "systems/perception/tracking.py",
            "tests/systems/perception/test_perception.py::"
            "test_who_walks_is_tracked_and_kept_in_mind_while_hidden",
            "`perception`",
            VARIANT,
        ),
        Row(
            "3.1.2: kinematic model, control law (headings only)",
            f"{SWITCH}/heading_law.py",
            f"{SWITCHED}/test_perception_and_control.py::test_heading_law",
            "`motion`",
            VARIANT,
        ),
        Row(
            "5: standing, moving, minima, three moving (headings only)",
            "diagrams/navigation/study.py",
            f"{NAVIGATED}::test_every_scenario_arrives_without_collision",
            "`path`",
            VARIANT,
        ),
    ],
    "Martin, Chapelle, Lemaire, Gogu: neurosurgical robot": [
        Row(
            "II: carrier robot, skull clamp, deployable access robot",
            "",
            "",
            "",
            NOT,
        ),
        Row(
            "III: two balls and nine wires, 8 mm wide",
            f"{SNAKE}/parameters.py",
            f"{SNAKED}/test_snake.py::test_mass_is_that_of_an_8_mm_robot",
            "",
            FAITHFUL,
        ),
        Row(
            "III.B: a rotating wire ring, taken for a ball; its spin is left out",
            f"{SNAKE}/snake_body.py",
            f"{SNAKED}/test_snake_body.py::test_a_way_once_driven_is_open_both_ways",
            "",
            VARIANT,
        ),
        Row("III.B: suction tube (future in the paper)", "", "", "", NOT),
        Row(
            "(1), Figure 4: a module",
            f"{SNAKE}/kinematics.py",
            f"{SNAKED}/test_kinematics.py::"
            "test_module_is_equation_1_and_figure_4_and_smooth_in_a_and_b",
            "",
            FAITHFUL,
        ),
        Row(
            "(2), (3), Figure 6: wire lengths",
            f"{SNAKE}/actuation.py",
            f"{SNAKED}/test_actuation.py::test_lengths_are_those_of_a_taut_string",
            "`wires.png`",
            FAITHFUL,
        ),
        Row(
            "IV.B.2: parameters from two wires, by elimination",
            f"{SNAKE}/two_wires.py",
            f"{SNAKED}/test_actuation.py::test_dialytic_elimination_agrees",
            "",
            FAITHFUL,
        ),
        Row(
            "V.A, Figure 7: elementary volume",
            f"{CUT}/sweep.py",
            "tests/diagrams/snake/test_snake_figures.py::"
            "test_elementary_volume_is_the_reference_pages",
            "replay",
            FAITHFUL,
        ),
        Row(
            "V.B.1: entry procedure, extremum radii",
            f"{CUT}/entry_law.py",
            f"{RESECTED}/test_session.py::test_jam_counts_what_the_plan_keeps",
            "",
            FAITHFUL,
        ),
        Row(
            "V.B.2: elementary procedure, unique posture",
            f"{SNAKE}/inverse_kinematics.py",
            f"{SNAKED}/test_inverse_kinematics.py::test_the_posture_is_unique",
            "",
            FAITHFUL,
        ),
        Row(
            "V.B: the system verifies",
            f"{CUT}/feasibility.py",
            f"{RESECTED}/test_session.py::test_refusals_name_their_reason",
            "",
            FAITHFUL,
        ),
        Row(
            "V.B: procedures chosen off line, possibly on line",
            "diagrams/resection/online.py",
            "tests/diagrams/resection/test_online.py::"
            "test_chosen_ahead_of_need_it_is_the_plan_to_the_last_digit",
            "",
            FAITHFUL,
        ),
        Row(
            "V.B.3, Figure 8: an entry and two procedures with axes of their own",
            "diagrams/resection/scenarios/resect_paper.yaml",
            f"{OPERATED}::test_two_procedures_of_figure_8_have_axes_of_their_own",
            "`figure8.png`",
            VARIANT,
        ),
    ],
}


def names(path: Path) -> set[str]:
    """Names of the functions that a module declares."""
    tree = ast.parse(path.read_text())
    return {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)}


def missing() -> list[str]:
    """What the rows name and is not there."""
    lost = []
    for row in (row for rows in PAPERS.values() for row in rows):
        if (row.verdict == NOT) != (not row.test) or row.verdict not in VERDICTS:
            lost.append(f"{row.says}: a test, or {NOT!r}")
        if row.file and not (ROOT / row.file).is_file():
            lost.append(row.file)
        if row.test:
            file, name = row.test.split("::")
            if not (ROOT / file).is_file() or name not in names(ROOT / file):
                lost.append(row.test)
    return lost


def page() -> str:
    """Makes the text."""
    lines = [
        "# Papers",
        "",
        "Every item of the three papers, made by `python -m tests.papers` from "
        "`tests/papers.py`; the test suite fails when an item's test is gone.",
        "",
        *(
            "faithful: as printed. corrected: as it must have been meant. variant: our "
            "reading of what is left open. not modelled: left out."
        ).splitlines(),
    ]
    for title, rows in PAPERS.items():
        count = {v: sum(row.verdict == v for row in rows) for v in VERDICTS}
        counted = ", ".join(f"{n} {v}" for v, n in count.items() if n)
        lines += ["", f"## {title}", "", f"{counted}.", ""]
        lines += [
            "| the paper | file | test | figure | verdict |",
            "|---|---|---|---|---|",
        ]
        for says, file, test, figure, verdict in rows:
            place, _, name = test.partition("::")
            shown = f"`{place}: {name}`" if name else ""
            code = f"`{file}`" if file else ""
            lines.append(f"| {says} | {code} | {shown} | {figure} | {verdict} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page())
    print(*missing(), sep="\n")
