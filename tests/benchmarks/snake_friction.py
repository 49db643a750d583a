"""Friction of the snake: what helps its tool, free and under 0.3 N."""

from typing import Any

from diagrams.common.run import simulate
from diagrams.studies import load_scenario

STIFF = "core={bend: 0.08, twist: 0.062}"
ROWS = {
    "drums as for the paper's snake": ["compensation=none"],
    "a model without friction": ["compensation=model", "hysteresis.friction={}"],
    "friction 30 % too small": ["compensation=model"],
    "the same, tracked": [],
    "the same, a core of 0.08": [STIFF],
    "the same, geared pairs": ["core.kind=coupled"],
    "the same, dither of 0.02 mm": ["hysteresis.dither=2e-5"],
    "right friction and force": [
        "hysteresis.friction={wire: 0.1, socket: 0.1}",
        "hysteresis.cutting=0.3",
    ],
    "no force known": ["hysteresis.cutting=0"],
}
WAYS: dict[str, tuple[list[str], float]] = {
    "circle": ([], 5.0),
    "scan": (["tip.way=scan", "tip.scan.rings=3", "tip.circle.period=3.0"], 7.5),
}
FREE = ["load.cutting=0", "hysteresis.cutting=0"]


def error(seed: int, overrides: list[str], duration: float) -> str:
    """Tool error, rms and largest, in mm; whether it stopped."""
    figures: dict[str, Any] = simulate(
        load_scenario("snake_cut", overrides, seed, duration)
    ).metrics
    rms, most = (1e3 * figures[f"{kind}_tool_error"] for kind in ("rms", "max"))
    return f"{rms:.2f} / {most:.2f}" + (" stopped" if figures["stops"] else "")


def report(seed: int = 1, scenes: int = 0) -> str:
    """The table, with a seed of the tracker's noise; `scenes` is for others."""
    del scenes
    cases = [(way, free) for free in (True, False) for way in WAYS]
    names = [f"{way}, {'free' if free else '0.3 N'}" for way, free in cases]
    lines = [
        f"{'tool error in mm, rms / max':<34}" + "".join(f"{n:>20}" for n in names)
    ]
    for name, overrides in ROWS.items():
        found = [
            error(
                seed, [*overrides, *WAYS[way][0], *(FREE if free else [])], WAYS[way][1]
            )
            for way, free in cases
        ]
        lines.append(f"{name:<34}" + "".join(f"{f:>20}" for f in found))
    return "\n".join(lines)
