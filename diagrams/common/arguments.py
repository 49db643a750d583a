"""What the command line takes: commands, their arguments, and help that teaches."""

import argparse
from pathlib import Path
from typing import Any

IMPORTED = ("jigsaws", "dvrk", "plus", "csv", "breathing", "crowd")
"""Kinds of recordings that can be imported."""

EXAMPLES = """\
examples:
  trocar scenarios                          what there is to run
  trocar run gauze_dynamic                  results in out/gauze_dynamic
  trocar run 'pwe_*' nav_crowd              several, one after the other
  trocar live gauze_dynamic                 take part, in the browser
  trocar live gauze_static --tracker igtl://localhost:18944   tools by PLUS or Slicer
  trocar replay out/gauze_dynamic           opens the replay in the browser
  trocar compare out/gauze_static out/printed
  trocar run gauze_static --set go_to_target.form=printed --out out/printed
  trocar run out/gauze_dynamic/scenario.yaml --seed 7
  trocar diagram gauze_static               the block diagram as a picture
  trocar keys gauze_static fuzzy            what can be set, with bounds and meaning
  trocar resect resect_paper --browser      plan a resection by hand
  trocar export out/resect_paper.session --to viewer   what a viewer can load
  trocar import FILE --kind jigsaws         another's recording as one of ours
  trocar access keyhole_resect              entries and trocars, ranked by reach
  trocar campaign operations --runs 200     many runs, and how sure that is
  trocar atlas FOLDER                       every mask of a folder planned
"""

RESECT = """\
Plans a resection by hand: proposes, checks, commits and undoes procedures. The session
is saved after every commit, and resumed.

  trocar resect resect_paper               line by line; `help` lists the commands
  trocar resect resect_paper < lines.txt   the same lines again
  trocar resect resect_paper --browser     by sliders and buttons
  trocar resect resect_mask --browser --set mask=tumour.nii.gz --set image=t1.nii.gz
  trocar resect resect_paper --execute     the robot works while one chooses the next

In the browser sliders place the procedure, and how it would go is shown at once: what
it frees in green, or red if it is refused, with the first thing in the way marked in
pink and named below. A click into a slice moves the procedure there. The buttons are
the console's commands, and what they did is listed as its lines: planned by clicks or
by lines, the session is the same. `stop` ends a long `finish`, Ctrl-C or `end` all.

With --execute the robot begins what is committed, goes on with what is committed
meanwhile, and waits while nothing is. `stop` lets it begin no further step, `go` lets
it go on, `end` or `quit` sends it home when all is done. Lines of a pipe are all said
at the beginning; with times, see `trocar keys resect_paper choices`.
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
    named, changed, seeded = (argparse.ArgumentParser(add_help=False) for _ in range(3))
    named.add_argument("name", metavar="NAME", help="a scenario's name or its file")
    seeded.add_argument("--seed", type=int, metavar="N", help="seed of the noise")
    changed.add_argument(
        "--set",
        dest="overrides",
        action="append",
        default=[],
        metavar="KEY.SUB=VALUE",
        help="change a value of the scenario, e.g. abdomen.stiffness=800; repeatable",
    )
    linked = argparse.ArgumentParser(add_help=False)
    linked.add_argument(
        "--tracker",
        metavar="igtl://HOST:PORT",
        help="tools are where a tracker of PLUS or 3D Slicer sees them; real time",
    )
    linked.add_argument(
        "--stream",
        metavar="igtl://:PORT",
        help="tell 3D Slicer and others where everything is; real time",
    )
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    commands.add_parser("scenarios", help="list the scenarios, one line each")
    run = commands.add_parser(
        "run",
        parents=[changed, seeded, linked],
        help="run a scenario and write figures, plots, log and replay",
        description="Runs a scenario. Writes metrics.json, signals.csv, plots as "
        "PNG, replay.html, report.html and scenario.yaml (exactly what ran) into DIR.",
    )
    run.add_argument(
        "names", metavar="NAME", nargs="+", help="a scenario's name, pattern or file"
    )
    run.add_argument(
        "--out", metavar="DIR", type=Path, help="default: out/NAME; of several DIR/NAME"
    )
    run.add_argument("--json", action="store_true", help="print the figures as JSON")
    run.add_argument("--duration", type=float, metavar="S", help="simulated seconds")
    run.add_argument(
        "--no-replay", action="store_true", help="do not record replay.html"
    )
    run.add_argument(
        "--endoscope",
        action="store_true",
        help="render what the endoscope saw: endoscope.mp4 and a film strip",
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
        parents=[named, changed, seeded, linked],
        help="run a scenario in real time and take part in the browser",
        description="Runs a scenario in real time: what can be guided follows sliders, "
        "the keyboard (W A S D Q E, arrows and page keys; space: pause) or a gamepad, "
        "and buttons let things fail. What was done is kept as recordings, and run "
        "again at the end for figures and replay.",
    )
    live.add_argument("--speed", type=float, default=1.0, help="of time; default: 1")
    live.add_argument("--duration", type=float, metavar="S", help="default: 600 s")
    live.add_argument("--out", metavar="DIR", type=Path, help="default: out/live")
    listens(live)
    replay = commands.add_parser("replay", help="open a run's replay in the browser")
    replay.add_argument("folder", metavar="DIR", type=Path, help="results of a run")
    shell = commands.add_parser(
        "completion",
        help="print a shell's completion script",
        description="Prints a completion script: "
        "trocar completion bash > ~/.local/share/bash-completion/completions/trocar",
    )
    shell.add_argument("shell", choices=("bash", "zsh", "tcsh"))
    draw = commands.add_parser(
        "diagram", parents=[named], help="draw a scenario's block diagram"
    )
    draw.add_argument(
        "--out", metavar="FILE", type=Path, help="SVG or PNG; default: out/NAME.svg"
    )
    keys = commands.add_parser(
        "keys",
        parents=[named],
        help="list a scenario's keys with value, unit, bounds and meaning",
        description="Lists what `--set` can change in a scenario.",
    )
    keys.add_argument(
        "pattern", metavar="PATTERN", nargs="?", default="", help="part of the key"
    )
    keys.add_argument("--json", action="store_true", help="for programs")
    access = commands.add_parser(
        "access",
        parents=[named, changed],
        help="propose entries and trocars of a keyhole operation",
        description="Tries entries through the scenario's trocar, and trocars on the "
        "wall; a table, and a picture in FILE.",
    )
    access.add_argument(
        "--out", metavar="FILE", type=Path, help="PNG; default: out/NAME.access.png"
    )
    resect = commands.add_parser(
        "resect",
        parents=[named, changed],
        help="plan a resection by hand: line by line, or in the browser",
        description=RESECT,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    resect.add_argument(
        "--session", metavar="FILE", type=Path, help="default: out/NAME.session"
    )
    resect.add_argument(
        "--browser", action="store_true", help="sliders, buttons and slices instead"
    )
    resect.add_argument(
        "--execute",
        action="store_true",
        help="the robot carries out what is committed, at once",
    )
    resect.add_argument(
        "--speed", type=float, default=1.0, help="of its time; default: 1"
    )
    resect.add_argument(
        "--out", metavar="DIR", type=Path, help="of what it did; default: out/NAME"
    )
    listens(resect)
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
    rehearse = commands.add_parser(
        "rehearse",
        parents=[named, changed, seeded],
        help="rehearse a resection on tissue that yields, with scans of the cavity",
        description="Plans and carries out a resection in rounds, on tissue that moves "
        "as the tumour goes; between them the cavity is scanned and the plan mended, "
        "e.g. --set shift.most=0.002. Writes rehearsal.json and rehearsal.png.",
    )
    rehearse.add_argument(
        "--out", metavar="DIR", type=Path, help="default: out/rehearsal"
    )
    spread = argparse.ArgumentParser(add_help=False)
    spread.add_argument(
        "--workers", type=int, metavar="N", help="processes; default: one a core"
    )
    spread.add_argument(
        "--scheduler", metavar="ADDRESS", default="", help="of a Dask cluster"
    )
    atlas = commands.add_parser(
        "atlas",
        parents=[changed, spread],
        help="plan every mask of a folder: what is reached, how long, what stays",
        description="Plans every mask of a folder through one, two and three entries; "
        "started again with the same DIR it goes on. Writes atlas.html, atlas.csv, "
        "runs/ (Parquet) and sessions/. Needs the extra `campaigns`.",
    )
    atlas.add_argument("folder", metavar="FOLDER", type=Path, help="with masks in it")
    atlas.add_argument(
        "--scenario", metavar="NAME", default="resect_mask", help="default: resect_mask"
    )
    atlas.add_argument(
        "--vary",
        action="append",
        default=[],
        metavar="KEY.SUB=[VALUES]",
        help="plan with each, e.g. snake.tool_radius=[0.003,0.0035]; repeatable",
    )
    atlas.add_argument("--out", metavar="DIR", type=Path, help="default: out/atlas")
    campaign = commands.add_parser(
        "campaign",
        parents=[spread],
        help="run a scenario many times, varied, and say how sure the answer is",
        description="Runs a campaign; started again with the same DIR it goes on. "
        "Writes runs/ (Parquet), report.html, summary.json and the worst runs as "
        "scenarios. Needs the extra `campaigns`.",
    )
    campaign.add_argument("name", metavar="NAME", help="a campaign's name or its file")
    campaign.add_argument("--runs", type=int, metavar="N", help="of each variant")
    campaign.add_argument("--out", metavar="DIR", type=Path, help="default: out/NAME")
    campaign.add_argument("--seed", type=int, metavar="N", help="of the draws")
    campaign.add_argument(
        "--planner",
        metavar="MODULE:CLASS",
        default="",
        help="a planner of one's own as a further variant of `crossing`",
    )
    return parser


def listens(parser: argparse.ArgumentParser) -> None:
    """Adds where a page's server listens to a command's parser."""
    parser.add_argument(
        "--host", default="localhost", help="where it listens; '*' for everyone"
    )


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


class Version(argparse.Action):
    """Prints the version and the commit, and ends."""

    def __call__(self, parser: argparse.ArgumentParser, *more: object) -> None:
        """Called for `--version`."""
        from diagrams.common.provenance import commit, release

        print(" ".join(filter(None, ["trocar", release(), commit()])))
        parser.exit()
