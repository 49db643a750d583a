"""The command line: `trocar`, or `python -m diagrams`."""

import argparse
from collections.abc import Sequence
import logging
from pathlib import Path
import sys

from diagrams.common.progress import progress_bar
from diagrams.common.scenario import ScenarioError, scenario_files
from diagrams.common.tree import read_tree

EXAMPLES = """\
examples:
  trocar scenarios                          what there is to run
  trocar run gauze_dynamic                  results in out/gauze_dynamic
  trocar run gauze_static --set go_to_target.form=printed --out out/printed
  trocar run out/gauze_dynamic/scenario.yaml --seed 7
  trocar diagram gauze_static               the block diagram as a picture
  trocar keys gauze_static fuzzy            what can be set, with bounds and meaning
  trocar resect resect_paper                plan a resection by hand
  trocar export out/resect_paper.session --to viewer   what a viewer can load
  trocar campaign operations --runs 200     many runs, and how sure that is
"""


def make_parser() -> argparse.ArgumentParser:
    """The parser of the command line."""
    parser = argparse.ArgumentParser(
        prog="trocar",
        description="An open testbed for autonomous keyhole surgery on Drake.",
        epilog=EXAMPLES,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    commands.add_parser("scenarios", help="list the scenarios, one line each")
    run = commands.add_parser(
        "run",
        help="run a scenario and write figures, plots, log and replay",
        description="Runs a scenario. Writes metrics.json, signals.csv, plots as "
        "PNG, replay.html and scenario.yaml (exactly what ran) into DIR.",
    )
    run.add_argument("name", metavar="NAME", help="a scenario's name or its file")
    run.add_argument("--out", metavar="DIR", type=Path, help="default: out/NAME")
    run.add_argument("--seed", type=int, metavar="N", help="seed of the noise")
    run.add_argument(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="KEY.SUB=VALUE",
        help="change a value of the scenario, e.g. abdomen.stiffness=800; repeatable",
    )
    run.add_argument("--duration", type=float, metavar="S", help="simulated seconds")
    run.add_argument(
        "--no-replay", action="store_true", help="do not record replay.html"
    )
    draw = commands.add_parser("diagram", help="draw a scenario's block diagram")
    draw.add_argument("name", metavar="NAME", help="a scenario's name or its file")
    draw.add_argument(
        "--out", metavar="FILE", type=Path, help="SVG or PNG; default: out/NAME.svg"
    )
    keys = commands.add_parser(
        "keys",
        help="list a scenario's keys with value, unit, bounds and meaning",
        description="Lists what `--set` can change in a scenario.",
    )
    keys.add_argument("name", metavar="NAME", help="a scenario's name or its file")
    keys.add_argument(
        "pattern", metavar="PATTERN", nargs="?", default="", help="part of the key"
    )
    keys.add_argument("--json", action="store_true", help="for programs")
    resect = commands.add_parser(
        "resect",
        help="plan a resection by hand, line by line",
        description="Proposes, checks, commits and undoes procedures; `help` lists "
        "the commands. The session is saved after every commit, and resumed.",
    )
    resect.add_argument("name", metavar="NAME", help="a resection scenario")
    resect.add_argument(
        "--session", metavar="FILE", type=Path, help="default: out/NAME.session"
    )
    resect.add_argument(
        "--set", dest="overrides", action="append", default=[], metavar="KEY.SUB=VALUE"
    )
    export = commands.add_parser(
        "export",
        help="write a resection's session for a viewer: label maps, path, channels",
        description="Writes label maps on the mask's own grid (NRRD, NIfTI) and on "
        "the plan's, the tool's path (VTK), the channels (OBJ), in LPS and mm, and "
        "the plan (JSON). Needs the extra `images`.",
    )
    export.add_argument(
        "source", metavar="SESSION", type=Path, help="a session's file, or a run's DIR"
    )
    export.add_argument(
        "--to", metavar="FOLDER", type=Path, required=True, help="is made if missing"
    )
    campaign = commands.add_parser(
        "campaign",
        help="run a scenario many times, varied, and say how sure the answer is",
        description="Runs a campaign; started again with the same DIR it goes on. "
        "Writes runs/ (Parquet), report.html, summary.json and the worst runs as "
        "scenarios. Needs the extra `campaigns`.",
    )
    campaign.add_argument("name", metavar="NAME", help="a campaign's name or its file")
    campaign.add_argument("--runs", type=int, metavar="N", help="of each variant")
    campaign.add_argument(
        "--workers", type=int, metavar="N", help="processes; default: one a core"
    )
    campaign.add_argument(
        "--scheduler", metavar="ADDRESS", default="", help="of a Dask cluster"
    )
    campaign.add_argument("--out", metavar="DIR", type=Path, help="default: out/NAME")
    campaign.add_argument("--seed", type=int, metavar="N", help="of the draws")
    campaign.add_argument(
        "--planner",
        metavar="MODULE:CLASS",
        default="",
        help="a planner of one's own as a further variant of `crossing`",
    )
    return parser


def list_scenarios(arguments: argparse.Namespace) -> int:
    """Runs `trocar scenarios`: every scenario's name and description."""
    files = scenario_files()
    width = max(map(len, files), default=0)
    for name, path in files.items():
        print(f"{name:<{width}}  {read_tree(path).get('description', '')}")
    return 0


def default_name(name: str) -> str:
    """The results' name: a scenario's own, or that of its file's folder."""
    path = Path(name)
    if path.suffix and path.stem == "scenario":
        return f"{path.resolve().parent.name}_again"
    return path.stem


def run_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar run`."""
    from diagrams.common.metrics import table
    from diagrams.common.run import run_scenario
    from diagrams.studies import load_scenario

    scenario = load_scenario(
        arguments.name, arguments.overrides, arguments.seed, arguments.duration
    )
    out = arguments.out or Path("out") / default_name(arguments.name)
    run = run_scenario(scenario, out, not arguments.no_replay, progress_bar)
    if run.metrics:
        print(table(run.metrics))
    print(f"\n{', '.join(sorted(path.name for path in out.glob('[!.]*.*')))}: {out}/")
    if run.error:
        end = f"ended early at {run.simulated:.3f} s"
        print(
            f"trocar: the run {'failed' if run.is_over else end}: {run.error}",
            file=sys.stderr,
        )
        return 1
    return 0


def diagram_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar diagram`."""
    from diagrams.common.block_diagram import draw_block_diagram
    from diagrams.studies import build, load_scenario

    scenario = load_scenario(arguments.name)
    out = arguments.out or Path("out") / f"{default_name(arguments.name)}.svg"
    draw_block_diagram(build(scenario), out)
    print(out)
    return 0


def keys_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar keys`."""
    from diagrams.common.keys import as_json, as_text, matching
    from diagrams.studies import load_scenario

    found = matching(load_scenario(arguments.name), arguments.pattern)
    print(as_json(found) if arguments.json else as_text(found))
    return 0


def resect_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar resect`."""
    from diagrams.resection.console import run_console
    from diagrams.studies import load_scenario

    scenario = load_scenario(arguments.name, arguments.overrides)
    if scenario.system != "resection":
        raise ScenarioError(f"{arguments.name!r} is no resection")
    name = default_name(arguments.name)
    file = arguments.session or Path("out") / f"{name}.session"
    run_console(scenario, file, sys.stdin, sys.stdin.isatty())
    return 0


def export_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar export`."""
    try:
        from diagrams.resection.export import export, session_of
    except ModuleNotFoundError as error:
        raise ScenarioError(
            f"no module {error.name!r}: export needs the extra, "
            "pip install 'trocar[images]'"
        ) from error
    for path in export(session_of(arguments.source), arguments.to):
        print(path)
    return 0


def campaign_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar campaign`."""
    try:
        from diagrams.campaigns import command
    except ModuleNotFoundError as error:
        raise ScenarioError(
            f"no module {error.name!r}: campaigns need the extra, "
            "pip install 'trocar[campaigns]'"
        ) from error
    return command.campaign_command(arguments)


COMMANDS = {
    "scenarios": list_scenarios,
    "run": run_command,
    "diagram": diagram_command,
    "keys": keys_command,
    "resect": resect_command,
    "export": export_command,
    "campaign": campaign_command,
}


def main(argv: Sequence[str] | None = None) -> int:
    """Runs the command line.

    Returns:
        0 when the scenario ran to its end, 1 when it did not or something failed
        then, 2 if it could not begin, 130 if it was interrupted before it began.
    """
    logging.getLogger("drake").setLevel(logging.WARNING)
    arguments = make_parser().parse_args(argv)
    try:
        return COMMANDS[arguments.command](arguments)
    except ScenarioError as error:
        print(f"trocar: error: {error}", file=sys.stderr)
        return 2
    except Exception as error:
        if sys.flags.dev_mode:  # `python -X dev -m diagrams` shows where
            raise
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        print(f"trocar: error: {reason}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("trocar: interrupted before the run began", file=sys.stderr)
        return 130
