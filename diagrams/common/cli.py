"""The command line: `trocar`, or `python -m diagrams`."""

import argparse
from collections.abc import Sequence
import fnmatch
import json
import logging
import os
from pathlib import Path
import sys
from typing import Any

from diagrams.common.arguments import make_parser
from diagrams.common.progress import progress_bar
from diagrams.common.scenario import ScenarioError, extra, nearest, scenario_files
from diagrams.common.tree import read_tree


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
    if arguments.tracker or arguments.stream:
        from diagrams.live.command import beside

        run = beside(arguments, scenario, out)
    else:
        told = (not arguments.no_replay, progress_bar, arguments.endoscope)
        run = run_scenario(scenario, out, *told)
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
    from diagrams.common.figures import table
    from diagrams.live.command import live_command

    run = live_command(arguments)
    out = arguments.out or Path("out") / "live"
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
    if arguments.execute:
        return execute(arguments, scenario, file)
    if not arguments.browser:
        run_console(scenario, file, sys.stdin, sys.stdin.isatty())
        return 0
    import webbrowser

    from diagrams.resection.browser import run_browser

    def opened(address: str) -> None:
        print(f"{address}  (Ctrl-C ends it; the session is saved)", flush=True)
        webbrowser.open(address)

    run_browser(scenario, file, arguments.host, opened)
    print(f"session {file}; `trocar export {file} --to DIR` is for a viewer")
    return 0


def execute(arguments: argparse.Namespace, scenario: Any, file: Path) -> int:
    """Runs `trocar resect --execute`."""
    import webbrowser

    from diagrams.common.figures import table
    from diagrams.resection.operate import listened, operate, operate_by_page

    if not 0.0 < arguments.speed <= 100.0:
        raise ScenarioError(f"--speed {arguments.speed}: expected > 0 and <= 100")
    out = arguments.out or Path("out") / default_name(arguments.name)
    if arguments.browser:

        def opened(address: str) -> None:
            print(f"{address}  (Ctrl-C ends it; what was done is saved)", flush=True)
            webbrowser.open(address)

        run = operate_by_page(
            scenario, file, out, arguments.speed, arguments.host, opened
        )
    else:
        print(f"session {file}; `help` lists the commands")
        speed = arguments.speed if sys.stdin.isatty() else 0.0
        run = operate(scenario, file, out, listened(sys.stdin, speed))
    if run.metrics:
        print(table(run.metrics))
    print(f"\n{out}/: trocar replay {out}, trocar run {out / 'scenario.yaml'}")
    return 1 if run.error else 0


def export_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar export`."""
    with extra("images"):
        from diagrams.resection.export import export, session_of
    for path in export(session_of(arguments.source), arguments.to):
        print(path)
    return 0


def campaign_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar campaign`."""
    with extra("campaigns"):
        from diagrams.campaigns import command
    return command.campaign_command(arguments)


def atlas_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar atlas`."""
    with extra("campaigns"):
        from diagrams.resection import atlas
    return atlas.atlas_command(arguments)


def rehearse_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar rehearse`."""
    from diagrams.resection import rehearsal

    return rehearsal.rehearse_command(arguments)


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
    "atlas": atlas_command,
    "rehearse": rehearse_command,
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
