"""The command line: `trocar`, or `python -m diagrams`."""

import argparse
from collections.abc import Sequence
from contextlib import suppress
import fnmatch
import json
import logging
import os
from pathlib import Path
import sys
from typing import Any

from diagrams.common.progress import progress_bar
from diagrams.common.scenario import ScenarioError, nearest, scenario_files
from diagrams.common.tree import read_tree

IMPORTED = ("jigsaws", "dvrk", "plus", "csv", "breathing", "crowd")
"""Kinds of recordings that can be imported."""

EXAMPLES = """\
examples:
  trocar scenarios                          what there is to run
  trocar run gauze_dynamic                  results in out/gauze_dynamic
  trocar run 'pwe_*' nav_crowd              several, one after the other
  trocar live gauze_dynamic                 take part, in the browser
  trocar replay out/gauze_dynamic           opens the replay in the browser
  trocar compare out/gauze_static out/printed
  trocar run gauze_static --set go_to_target.form=printed --out out/printed
  trocar run out/gauze_dynamic/scenario.yaml --seed 7
  trocar diagram gauze_static               the block diagram as a picture
  trocar keys gauze_static fuzzy            what can be set, with bounds and meaning
  trocar resect resect_paper                plan a resection by hand
  trocar export out/resect_paper.session --to viewer   what a viewer can load
  trocar import FILE --kind jigsaws         another's recording as one of ours
  trocar access keyhole_resect              entries and trocars, ranked by reach
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
    parser.add_argument("--version", action=Version, nargs=0, help="version and commit")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    commands.add_parser("scenarios", help="list the scenarios, one line each")
    run = commands.add_parser(
        "run",
        help="run a scenario and write figures, plots, log and replay",
        description="Runs a scenario. Writes metrics.json, signals.csv, plots as "
        "PNG, replay.html and scenario.yaml (exactly what ran) into DIR.",
    )
    run.add_argument(
        "names", metavar="NAME", nargs="+", help="a scenario's name, pattern or file"
    )
    run.add_argument(
        "--out", metavar="DIR", type=Path, help="default: out/NAME; of several DIR/NAME"
    )
    run.add_argument("--json", action="store_true", help="print the figures as JSON")
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
    compare = commands.add_parser(
        "compare", help="two runs side by side: figures, and signals over each other"
    )
    compare.add_argument("one", metavar="DIR", type=Path, help="results of a run")
    compare.add_argument("other", metavar="DIR", type=Path, help="of another")
    compare.add_argument(
        "--out", metavar="FILE", type=Path, help="PNG; default: out/compare.png"
    )
    live = commands.add_parser(
        "live",
        help="run a gauze scenario in real time and take part in the browser",
        description="Runs a gauze scenario in real time: the surgeon's tools follow "
        "sliders or the keyboard (W A S D Q E: the obstacle; arrows and page keys: the "
        "target; space: pause). What the hands did is kept as recordings, and run "
        "again at the end for figures and replay.",
    )
    live.add_argument("name", metavar="NAME", help="a scenario's name or its file")
    live.add_argument("--speed", type=float, default=1.0, help="of time; default: 1")
    live.add_argument("--seed", type=int, metavar="N", help="seed of the noise")
    live.add_argument(
        "--set", dest="overrides", action="append", default=[], metavar="KEY.SUB=VALUE"
    )
    live.add_argument("--duration", type=float, metavar="S", help="default: 600 s")
    live.add_argument("--out", metavar="DIR", type=Path, help="default: out/live")
    live.add_argument(
        "--host", default="localhost", help="where it listens; '*' for everyone"
    )
    replay = commands.add_parser("replay", help="open a run's replay in the browser")
    replay.add_argument("folder", metavar="DIR", type=Path, help="results of a run")
    shell = commands.add_parser(
        "completion",
        help="print a shell's completion script",
        description="Prints a completion script: "
        "trocar completion bash > ~/.local/share/bash-completion/completions/trocar",
    )
    shell.add_argument("shell", choices=("bash", "zsh", "tcsh"))
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
    access = commands.add_parser(
        "access",
        help="propose entries and trocars of a keyhole operation",
        description="Tries entries through the scenario's trocar, and trocars on the "
        "wall; a table, and a picture in FILE.",
    )
    access.add_argument("name", metavar="NAME", help="a keyhole scenario")
    access.add_argument(
        "--out", metavar="FILE", type=Path, help="PNG; default: out/NAME.access.png"
    )
    access.add_argument(
        "--set", dest="overrides", action="append", default=[], metavar="KEY.SUB=VALUE"
    )
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
    add_import(commands)
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


def add_import(commands: Any) -> None:
    """Adds `trocar import` to a parser's commands."""
    parser = commands.add_parser(
        "import",
        help="make the project's own file of another's recording",
        description="Reads a recording, says what it holds, and writes a CSV (of a "
        "crowd: a scenario). Nothing of it is kept elsewhere.",
    )
    parser.add_argument("file", metavar="FILE", type=Path)
    parser.add_argument("--kind", choices=IMPORTED, required=True)
    parser.add_argument("--out", metavar="FILE", type=Path, help="default: out/STEM.*")
    parser.add_argument(
        "--place",
        metavar="X,Y,Z",
        default="0,0,-0.11",
        help="of the motion's mean in W [m]",
    )
    parser.add_argument(
        "--yaw", type=float, default=0.0, help="turn about the vertical [deg]"
    )
    parser.add_argument(
        "--arm",
        default="",
        help="jigsaws: master_left ... slave_right; plus: its transform, e.g. "
        "ProbeToTracker; breathing: the column",
    )
    parser.add_argument(
        "--rate", type=float, default=100.0, help="breathing: samples a second"
    )
    parser.add_argument(
        "--start", type=float, default=0.0, help="crowd: first second of it"
    )
    parser.add_argument(
        "--duration", type=float, default=40.0, help="crowd: how long [s]"
    )


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


def find_names(patterns: Sequence[str]) -> list[str]:
    """Names and files as they are; a pattern becomes the names that match it.

    Raises:
        ScenarioError: If a pattern matches none.
    """
    names: list[str] = []
    for pattern in patterns:
        is_pattern = set("*?[") & set(pattern) and not Path(pattern).exists()
        found = fnmatch.filter(scenario_files(), pattern) if is_pattern else [pattern]
        if not found:
            raise ScenarioError(
                f"no scenario matches {pattern!r}: {nearest(pattern, scenario_files())}"
            )
        names += [name for name in found if name not in names]
    return names


def run_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar run`."""
    names = find_names(arguments.names)
    codes = []
    for name in names:
        out = arguments.out or Path("out")
        if len(names) > 1 or not arguments.out:
            out /= default_name(name)
        if len(names) > 1 and not arguments.json:
            print(f"\n{name}")
        codes.append(run_one(arguments, name, out))
    return max(codes)


def run_one(arguments: argparse.Namespace, name: str, out: Path) -> int:
    """Runs a scenario and prints its figures."""
    from diagrams.common.figures import table
    from diagrams.common.run import run_scenario
    from diagrams.studies import load_scenario

    scenario = load_scenario(
        name, arguments.overrides, arguments.seed, arguments.duration
    )
    run = run_scenario(scenario, out, not arguments.no_replay, progress_bar)
    if arguments.json:
        print(json.dumps(run.metrics, indent=2))
    else:
        if run.metrics:
            print(table(run.metrics))
        print(
            f"\n{', '.join(sorted(path.name for path in out.glob('[!.]*.*')))}: {out}/"
        )
        if sys.stdout.isatty():
            print(f"Look at {out / 'report.html'}, or: trocar replay {out}")
    if run.error:
        end = f"ended early at {run.simulated:.3f} s"
        print(
            f"trocar: the run {'failed' if run.is_over else end}: {run.error}",
            file=sys.stderr,
        )
        return 1
    return 0


def compare_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar compare`."""
    from diagrams.common.compare import overlay, read, table
    from diagrams.common.plots import save_figure

    folders = (arguments.one, arguments.other)
    (one, first), (other, second) = map(read, folders)
    names = (str(arguments.one), str(arguments.other))
    print(table(one, other, names))
    out = arguments.out or Path("out") / "compare.png"
    out.parent.mkdir(parents=True, exist_ok=True)
    save_figure(overlay(first, second, names), out)
    print(out)
    return 0


def live_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar live`."""
    import webbrowser

    from diagrams.common.figures import table
    from diagrams.common.replay import start_meshcat
    from diagrams.common.run import run_scenario
    from diagrams.live.session import Session
    from diagrams.studies import load_scenario

    if not 0.0 < arguments.speed <= 20.0:
        raise ScenarioError(f"--speed {arguments.speed}: expected > 0 and <= 20")
    scenario = load_scenario(arguments.name, arguments.overrides, arguments.seed)
    out = arguments.out or Path("out") / "live"
    meshcat = start_meshcat(arguments.host)
    session = Session(scenario, meshcat)
    print(f"{meshcat.web_url()}  (Ctrl-C ends it and keeps what was done)")
    webbrowser.open(meshcat.web_url())
    with suppress(KeyboardInterrupt):
        session.play(arguments.duration or 600.0, arguments.speed)
    run = run_scenario(session.save(out), out, progress=progress_bar)
    print(table(run.metrics))
    print(f"\n{out}/: trocar replay {out}, trocar run {out / 'scenario.yaml'}")
    return 1 if run.error else 0


def replay_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar replay`."""
    import webbrowser

    page = arguments.folder / "replay.html"
    if not page.is_file():
        raise ScenarioError(
            f"{str(page)!r}: no such file; `trocar run` writes it without --no-replay"
        )
    webbrowser.open(page.resolve().as_uri())
    print(page)
    return 0


def completion_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar completion`."""
    import shtab

    print(shtab.complete(make_parser(), arguments.shell))
    return 0


class Version(argparse.Action):
    """Prints the version and the commit, and ends."""

    def __call__(self, parser: argparse.ArgumentParser, *more: object) -> None:
        """Called for `--version`."""
        from diagrams.common.provenance import commit, release

        print(" ".join(filter(None, ["trocar", release(), commit()])))
        parser.exit()


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


def access_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar access`."""
    from diagrams.common.plots import save_figure
    from diagrams.keyhole.access import draw, find_ways, table
    from diagrams.studies import load_scenario

    scenario = load_scenario(arguments.name, arguments.overrides)
    if scenario.system != "keyhole":
        raise ScenarioError(f"{arguments.name!r} is no keyhole operation")
    with progress_bar("entries and trocars", "tried") as show:
        ways = find_ways(scenario, lambda share: show(share, 1.0))
    name = default_name(arguments.name)
    out = arguments.out or Path("out") / f"{name}.access.png"
    out.parent.mkdir(parents=True, exist_ok=True)
    save_figure(draw(ways), out)
    print(table(ways))
    print(out)
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


def import_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar import`."""
    from diagrams.common.importing import import_file

    import_file(arguments)
    return 0


COMMANDS = {
    "scenarios": list_scenarios,
    "run": run_command,
    "compare": compare_command,
    "live": live_command,
    "replay": replay_command,
    "completion": completion_command,
    "diagram": diagram_command,
    "keys": keys_command,
    "access": access_command,
    "resect": resect_command,
    "export": export_command,
    "campaign": campaign_command,
    "import": import_command,
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
    except BrokenPipeError:  # `trocar keys ... | head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except Exception as error:
        if sys.flags.dev_mode:  # `python -X dev -m diagrams` shows where
            raise
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        print(f"trocar: error: {reason}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        before = " before the run began" if arguments.command == "run" else ""
        print(f"trocar: interrupted{before}", file=sys.stderr)
        return 130
