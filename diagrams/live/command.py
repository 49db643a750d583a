"""`trocar live`, and `trocar run` beside another program: in real time."""

import argparse
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any
import webbrowser

from diagrams.common.progress import progress_bar
from diagrams.common.replay import start_meshcat
from diagrams.common.run import Run, run_scenario
from diagrams.common.scenario import ScenarioError, extra
from diagrams.live.page import Page
from diagrams.live.session import Session
from diagrams.studies import get_study, load_scenario

LONGEST = 600.0
"""Of a session, if it is not said [s]."""


@contextmanager
def links(arguments: argparse.Namespace, scenario: Any) -> Iterator[dict[str, Any]]:
    """The tracker that is listened to and the stream that is sent, if any.

    Raises:
        ScenarioError: If an address is none, or nobody is there.
    """
    live = get_study(scenario.system).live
    found: dict[str, Any] = {}
    with ExitStack() as stack:
        if arguments.tracker or arguments.stream:
            with extra("connect"):
                from diagrams.connect.stream import Stream
                from diagrams.connect.tracker import Tracker
            from diagrams.connect.address import parse
        if arguments.tracker:
            tools = [one.name for one in live.tracked(scenario)] if live else []
            if not tools:
                raise ScenarioError(
                    f"--tracker: nothing in a {scenario.system} is seen by a tracker; "
                    "expected a gauze delivery"
                )
            address = parse(arguments.tracker, "--tracker", tools)
            found["tracker"] = stack.enter_context(closing(Tracker(address, tools)))
        if arguments.stream:
            stream = Stream(parse(arguments.stream, "--stream"))
            found["stream"] = stack.enter_context(closing(stream))
        if "tracker" in found:
            found["tracker"].wait()
        yield found


def live_command(arguments: argparse.Namespace) -> Run:
    """Runs `trocar live`: with a page, until it is ended there."""
    if not 0.0 < arguments.speed <= 20.0:
        raise ScenarioError(f"--speed {arguments.speed}: expected > 0 and <= 20")
    scenario = load_scenario(arguments.name, arguments.overrides, arguments.seed)
    length = arguments.duration or max(LONGEST, scenario.duration)
    scenario = replace(scenario, duration=length)
    with links(arguments, scenario) as found:
        meshcat = start_meshcat(arguments.host)
        session = Session(scenario, Page(meshcat), **found)
        print(f"{meshcat.web_url()}  (Open Controls, at its top right)")
        print("Ctrl-C, or its button, ends it and keeps what was done.")
        webbrowser.open(meshcat.web_url())
        return played(session, arguments.speed, arguments.out or Path("out") / "live")


def beside(arguments: argparse.Namespace, scenario: Any, out: Path) -> Run:
    """Runs a scenario in real time, without a page: another program takes part."""
    told = (not arguments.no_replay, progress_bar, arguments.endoscope)
    with links(arguments, scenario) as found:
        return played(Session(scenario, None, **found), 1.0, out, *told)


def played(session: Session, speed: float, out: Path, *told: Any) -> Run:
    """Plays a session to its end, then runs what was done for its results.

    Args:
        session: Not begun.
        speed: Simulated seconds a second.
        out: Folder of the results.
        *told: What else `run_scenario` takes.
    """
    with suppress(KeyboardInterrupt):
        session.play(session.scenario.duration, speed)
    return run_scenario(session.save(out), out, *(told or (True, progress_bar)))
