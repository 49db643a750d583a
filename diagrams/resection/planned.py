"""What the plan for a mask comes to, by the number of entries."""

from dataclasses import replace
from time import process_time
from typing import Any

import numpy as np

from diagrams.common.progress import silent
from diagrams.common.scenario import refusals
from diagrams.resection.operation import Operation, prepare
from diagrams.resection.scenario import ResectionScenario
from plants.tissue.labels import CAP
from systems.resection.planning.next_entry import bored_by
from systems.resection.wires.procedure_player import schedule

ENTRIES = 3
"""That have columns."""

EACH = ("reachable", "resected", "time", "bored")
NOTHING: dict[str, Any] = {
    "tumour_volume": 0.0,
    "mask_volume": 0.0,
    "cap_volume": 0.0,
    "entries": 0.0,
    **{f"{name}_{n}": 0.0 for name in EACH for n in range(1, ENTRIES + 1)},
    "processor_time": 0.0,
    "unreached": [],
}
"""A row's figures, in SI units; shares are of the tumour without the cap."""


def planned(scenario: ResectionScenario) -> dict[str, Any]:
    """The figures of a scenario's plan, which is saved to its session's file.

    Raises:
        ScenarioError: If the mask cannot be read, or has no room for a channel.
    """
    start = process_time()
    with refusals():
        case = prepare(scenario, silent)
    return {**figures(case), "processor_time": process_time() - start}


def figures(case: Operation) -> dict[str, Any]:
    """What a plan comes to after one, two, three entries; more do not count."""
    session, scenario = case.session, case.scenario
    volume = session.volume
    ends = [channel.time for channel in volume.more] + [len(session.postures)]
    player = replace(scenario.player, lead=scenario.period)
    times = schedule(session.postures, player, case.waits)
    frames = [np.eye(4)] + [channel.X_WE for channel in volume.more]
    bored = [0.0] + [
        bored_by(volume, frames[k], frames[:k]) for k in range(1, len(frames))
    ]
    told = {
        "tumour_volume": volume.tumour_volume,
        "mask_volume": volume.mask_volume,
        "cap_volume": np.count_nonzero(volume.labels == CAP) * volume.voxel,
        "entries": len(ends),
        "unreached": [
            {"volume": lump.volume, "reason": lump.reason}
            for lump in (case.reach.lumps if case.reach else ())
        ],
    }
    for n in range(1, ENTRIES + 1):
        k = min(n, len(ends))
        gone = np.count_nonzero(volume.resected & (volume.tau < ends[k - 1]))
        resected = gone * volume.voxel / volume.tumour_volume
        told |= {
            f"reachable_{n}": session.reached[k - 1],
            f"resected_{n}": resected,
            f"time_{n}": float(times[ends[k - 1] - 1]),
            f"bored_{n}": sum(bored[:k]),
        }
    return told
