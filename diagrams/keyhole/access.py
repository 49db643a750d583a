"""Access through a trocar: where it should be, and at what the tube should aim.

A rigid tube through a trocar reaches a point of the organ from one direction alone. So
the entries that are tried are points of the tumour, and where they lie on its skin
follows; what arm and trocar do not allow over a breath is left out, and the rest is
ranked by the share of the tumour that the snake can reach. Trocars are tried on the
wall about the one that the scenario has, aiming at the tumour's middle.
"""

from dataclasses import dataclass
import math
from typing import Any

from matplotlib.figure import Figure
import numpy as np

from diagrams.common.plots import COLORS, add_axes, new_figure
from diagrams.common.scenario import ScenarioError
from diagrams.keyhole.scenario import KeyholeScenario
from diagrams.resection.operation import tissue_of
from plants.tissue.volume import Access, channel_frame
from systems.common.reach_limits import ReachLimits
from systems.resection.planning.access import reachable_share

RING, RINGS = 6, 1
"""Points that are aimed at: so many about the middle, at so many distances."""
PITCH, ROWS = 0.03, 2
"""Between trocars that are tried, in m, and rows of them to each side."""
EFFORT = 0.05
"""Of the search for what is reached."""
MM = 1e3


@dataclass
class Way:
    """A way in.

    Attributes:
        p_WG: The trocar.
        p_WE: The entry.
        direction: z_E in W.
        point: Aimed at, in P.
        tilt: Greatest of the tube over a breath, in rad.
        depth: Of the entry from the trocar, in m.
        share: Of the tumour that is reached; none if arm or trocar do not allow it.
        reason: Why not.
    """

    p_WG: np.ndarray
    p_WE: np.ndarray
    direction: np.ndarray
    point: list[float]
    tilt: float
    depth: float
    share: float | None = None
    reason: str = ""


@dataclass
class Ways:
    """What was tried, the best first.

    Attributes:
        entries: Through the scenario's trocar, at points of the tumour.
        trocars: Elsewhere on the wall, at the tumour's middle.
    """

    entries: list[Way]
    trocars: list[Way]


def find_ways(scenario: KeyholeScenario, progress: Any = None) -> Ways:
    """Tries entries and trocars.

    Args:
        scenario: Its tumour lies as the mask has it, P's axes along W's, where its own
            entry puts it.
        progress: Called with the share that is done.

    Raises:
        ScenarioError: If the scenario's own access makes no sense.
    """
    tissue = tissue_of(scenario.operation)
    own = scenario.operation.access
    if own.direction is None:
        raise ScenarioError("operation.access.direction: expected one, of z_E in P")
    p_PE = channel_frame(tissue, own)[:3, 3]
    X = np.subtract(scenario.entry.p_WE, p_PE)  # p_WP: P's origin in W
    middle = tissue.centre() + X
    half = 0.5 * float(np.ptp(tissue.points(), axis=0).max())
    own_trocar = np.array(scenario.robot.p_WG)
    tries = [(own_trocar, aim) for aim in aims(middle, own_trocar, half)]
    count = len(tries)
    for i in range(-ROWS, ROWS + 1):
        for j in range(-ROWS, ROWS + 1):
            tries.append((own_trocar + PITCH * np.array([i, j, 0.0]), middle))
    found = []
    for number, (p_WG, aim) in enumerate(tries):
        found.append(_tried(scenario, tissue, p_WG, aim, X))
        if progress:
            progress((number + 1) / len(tries))
    order = [sorted(ways, key=_rank) for ways in (found[:count], found[count:])]
    return Ways(*order)


def _rank(way: Way) -> float:
    return -way.share if way.share is not None else 1.0


def aims(middle: np.ndarray, p_WG: np.ndarray, half: float) -> list[np.ndarray]:
    """Points to aim at: the middle, and rings about it across the line of sight."""
    z = middle - p_WG
    z /= np.linalg.norm(z)
    x = np.cross(z, [0.0, 1.0, 0.0])
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    found = [middle]
    for ring in range(1, RINGS + 1):
        for k in range(RING):
            angle = 2.0 * math.pi * (k + 0.5 * ring) / RING
            radius = 0.5 * half * ring / RINGS
            found.append(middle + radius * (math.cos(angle) * x + math.sin(angle) * y))
    return found


def _tried(
    s: KeyholeScenario, tissue: Any, p_WG: np.ndarray, aim: np.ndarray, X: np.ndarray
) -> Way:
    """A way in through a trocar towards a point of the tumour."""
    n = (aim - p_WG) / np.linalg.norm(aim - p_WG)
    clearance = s.operation.access.clearance
    access = Access((aim - X).tolist(), n.tolist(), clearance)
    limits = ReachLimits()
    swing = np.abs(s.wall_motion.breathing) + np.abs(s.organ_motion.breathing)
    try:
        p_WE = channel_frame(tissue, access)[:3, 3] + X
    except ValueError as error:
        return Way(p_WG, aim, n, [], math.nan, math.nan, None, str(error))
    depth = float(np.linalg.norm(p_WE - p_WG))
    # Wall and organ may move against each other.
    tilt = math.acos(min(1.0, -n[2])) + math.atan(float(np.linalg.norm(swing)) / depth)
    way = Way(p_WG, p_WE, n, (aim - X).tolist(), tilt, depth)
    least, most = depth - s.tube_task.standoff, depth - s.instrument.gap
    if tilt > limits.max_tilt:
        way.reason = "the tube tilts too far"
    elif least < limits.min_insertion + float(np.linalg.norm(swing)):
        way.reason = "too near to the trocar"
    elif most > limits.max_insertion:
        way.reason = "too far from the trocar"
    else:
        margin = s.operation.margin
        snake = s.planned.snake
        try:
            way.share = reachable_share(tissue, access, snake, margin, s.seed, EFFORT)
        except ValueError as error:
            way.reason = str(error)
    return way


def table(ways: Ways, most: int = 8) -> str:
    """What was found, as text."""
    lines = []
    for title, rows in (
        ("entries through this trocar", ways.entries),
        ("trocars, at the tumour's middle", ways.trocars),
    ):
        good = sum(way.share is not None for way in rows)
        lines.append(f"{title}: {good} of {len(rows)} allowed")
        lines.append("  reached  trocar [mm]          entry [mm]           tilt  depth")
        for way in rows[:most]:
            if way.share is None:
                lines.append(f"       -  {_mm(way.p_WG)}  {way.reason}")
                continue
            lines.append(
                f"  {100 * way.share:5.1f} %  {_mm(way.p_WG)}  {_mm(way.p_WE)}  "
                f"{math.degrees(way.tilt):4.0f}  {MM * way.depth:5.0f}"
            )
    best = next((way for way in ways.entries if way.share is not None), None)
    if best is not None:
        place = [round(float(x), 4) for x in best.p_WE]
        n = [round(float(x), 4) for x in best.direction]
        aim = [round(x, 4) for x in best.point]
        lines.append(
            f"--set entry.p_WE={place} --set operation.access.direction={n} "
            f"--set operation.access.point={aim}"
        )
    return "\n".join(lines)


def _mm(p: np.ndarray) -> str:
    return "(" + ", ".join(f"{MM * x:5.0f}" for x in p) + ")"


def draw(ways: Ways) -> Figure:
    """Where entries and trocars lie, coloured by what they reach."""
    figure = new_figure(9.0, 4.0)
    for number, (title, rows) in enumerate(
        (("entries through this trocar", ways.entries), ("trocars", ways.trocars))
    ):
        axes = add_axes(figure, 1, 2, number + 1)
        good = [way for way in rows if way.share is not None]
        bad = [way for way in rows if way.share is None]
        for chosen, look in (
            (bad, {"marker": "x", "color": COLORS["muted"]}),
            (
                good,
                {
                    "c": [100 * (way.share or 0.0) for way in good],
                    "cmap": "viridis",
                    "s": 90,
                },
            ),
        ):
            place = [way.p_WG if number else way.p_WE for way in chosen]
            if place:
                x, y, _ = (MM * np.array(place)).T
                drawn = axes.scatter(x, y, **look)
        if good:
            figure.colorbar(drawn, ax=axes, label="reached [%]")
        axes.set(xlabel="x [mm]", ylabel="y [mm]", title=title, aspect="equal")
    return figure
