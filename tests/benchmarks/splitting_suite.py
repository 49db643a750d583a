"""Splitting against chance: how rarely a bypass comes near, in the kinematic loop.

The draws of the campaign `operations`, whose crossing the paper's corrected field makes
without Drake: the share of runs whose clearance falls under a limit, by a plain sample
and by the splitting that the campaigns use.
"""

from itertools import pairwise
from time import process_time

import numpy as np
from tqdm import tqdm

from diagrams.campaigns.draws import operation
from diagrams.campaigns.splitting import Estimate, SplittingParams, estimate
from diagrams.campaigns.statistics import share_interval
from diagrams.campaigns.tape import Tape
from diagrams.gauze.kinematic_loop import run
from diagrams.gauze.kinematic_planners import PLANNERS
from diagrams.gauze.scenes import Leg, Scene
from systems.common.geometry import norm, sub

PLANNER = "corrected field"
LIMIT = 7.5e-3
"""Clearance that counts as near [m]: some in a thousand runs."""


def clearance(tape: Tape) -> float:
    """Of one operation's crossing [m]."""
    draw = operation(tape)
    times = draw["obstacle.times"]
    points = [tuple(p) for p in draw["obstacle.points"]]
    legs = [
        Leg(a - times[0], p, q, 1.2 * norm(sub(q, p)) / (b - a))
        for (a, p), (b, q) in pairwise(zip(times, points, strict=True))
        if norm(sub(q, p)) > 1e-6
    ]
    scene = Scene(
        (0.0, 0.0, 0.0),
        tuple(draw["robot.p_WP"]),
        tuple(draw["target.points"][0]),
        tuple(draw["obstacle.p_WG"]),
        legs,
    )
    return run(scene, PLANNERS[PLANNER]()).clearance


def split(seed: int, params: SplittingParams) -> Estimate:
    """The share by splitting; each run's further numbers come from its own tape."""
    keys: list[str] = []
    first = 0

    def evaluate(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        nonlocal first
        tapes = [
            Tape([seed, 1, number], dict(zip(keys, point, strict=False)))
            for number, point in enumerate(points, first)
        ]
        first += len(points)
        levels = np.array([clearance(tape) for tape in tapes])
        keys.extend(sorted(set().union(*(t.numbers for t in tapes)) - set(keys)))
        numbers = [[tape.numbers.get(key, np.nan) for key in keys] for tape in tapes]
        return levels, np.array(numbers)

    return estimate(evaluate, 0, params, seed)


def report(seed: int, scenes: int) -> str:
    """The table: a sample of ten times `scenes`, and splitting with a sixth a level."""
    clearance(Tape([seed, 2]))  # compiles
    start, runs = process_time(), 10 * scenes
    sample = tqdm(range(runs), disable=None)
    found = np.array([clearance(Tape([seed, 0, i])) for i in sample])
    near = int(np.sum(found <= LIMIT))
    low, high = share_interval(near, runs)
    middle = process_time()
    params = SplittingParams(
        "clearance", failure=LIMIT, population=max(20, scenes // 3)
    )
    by = split(seed, params)
    return "\n".join(
        [
            f"clearance <= {1e3 * LIMIT} mm, {PLANNER}, draws of `operations`",
            f"chance     {near / runs:.2e}  95 %: {low:.2e} to {high:.2e}  "
            f"{near} of {runs} runs, {middle - start:.0f} s",
            f"splitting  {by.probability:.2e}  95 %: {by.low:.2e} to {by.high:.2e}  "
            f"{by.runs} runs, {process_time() - middle:.0f} s; replicates "
            + " ".join(f"{one:.1e}" for one in by.each),
            f"least clearance: chance {1e3 * found.min():.2f} mm, splitting "
            f"{1e3 * by.lowest:.2f} mm",
        ]
    )
