"""`trocar campaign`."""

import argparse
import os
from pathlib import Path
import sys

from diagrams.campaigns.campaign import base_of, load_campaign
from diagrams.campaigns.report import summary, write_report
from diagrams.campaigns.run import Interrupted, run_campaign
from diagrams.campaigns.store import Store
from diagrams.common.scenario import ScenarioError


def campaign_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar campaign`: 0 when it is complete, 1 if it was stopped."""
    campaign = load_campaign(
        arguments.name, arguments.planner, runs=arguments.runs, seed=arguments.seed
    )
    workers = arguments.workers or os.cpu_count() or 1
    if workers < 1:
        raise ScenarioError(f"--workers {workers}: expected at least 1")
    out = arguments.out or Path("out") / Path(arguments.name).stem
    try:
        done = run_campaign(campaign, out, workers, arguments.scheduler)
    except Interrupted as error:
        print(f"trocar: {error}", file=sys.stderr)
        return 1
    rows = Store(out / "runs", {}).rows()
    page = write_report(campaign, rows, out, base_of(campaign))
    for name in campaign.names:
        told = summary(campaign, [row for row in rows if row["variant"] == name])
        print(
            f"{name or 'all':<20} {told['failed']} of {told['runs']} failed, 95 %: "
            f"{told['low']:.2%} to {told['high']:.2%}"
        )
    if done["runs"]:
        hourly = 3600.0 * done["runs"] / max(done["busy"], 1e-9)
        print(f"{done['runs']} runs, {hourly:.0f} a core-hour, {done['wall']:.0f} s")
    print(page)
    return 0
