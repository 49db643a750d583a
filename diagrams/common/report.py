"""A run on one page: figures in words, plots, replay, and what was set."""

import base64
from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import Any

from diagrams.common.figures import FIGURES, in_words
from systems.common.parameter import keys

STYLE = """
body {font: 16px/1.5 system-ui, sans-serif; max-width: 62rem; margin: 2rem auto;
      padding: 0 1rem; color: #222}
table {border-collapse: collapse; margin: 1rem 0; font-variant-numeric: tabular-nums}
th, td {padding: .25rem .8rem; text-align: right; border-bottom: 1px solid #ddd}
th:first-child, td:first-child, .words td {text-align: left}
code, pre {background: #f4f4f4; padding: .1rem .3rem; font-size: .9em}
img {max-width: 100%} h2 {margin-top: 2.5rem} .note {color: #666}
"""
"""Of all pages that the project writes."""


def page(title: str, parts: list[str]) -> str:
    """A page of HTML that needs no other file."""
    return (
        f"<!doctype html><html lang=en><meta charset=utf-8><title>{escape(title)}"
        f"</title><style>{STYLE}</style><h1>{escape(title)}</h1>{''.join(parts)}</html>"
    )


def image(content: bytes, words: str) -> str:
    """A picture (PNG) within a page."""
    data = base64.b64encode(content).decode()
    return f'<img src="data:image/png;base64,{data}" alt="{escape(words)}">'


def run_page(run: Any, folder: Path, made_by: dict[str, Any]) -> str:
    """The page of a run whose results lie in a folder.

    Args:
        run: Measured.
        folder: With the plots, and `replay.html` if there is one.
        made_by: Its provenance.
    """
    scenario, error = run.scenario, run.error
    parts = [f"<p>{escape(scenario.description)}</p>"]
    if error:
        parts.append(f"<p><b>Ended early or failed: {escape(error)}</b></p>")
    if (folder / "replay.html").is_file():
        parts.append('<p><a href="replay.html">Replay</a></p>')
    if (folder / "endoscope.mp4").is_file():
        parts.append('<p><a href="endoscope.mp4">Film of the endoscope</a></p>')
    parts += ["<h2>Figures</h2>", figures_table(run.metrics)]
    plots = sorted(folder.glob("*.png"))
    parts += ["<h2>Plots</h2>"] if plots else []
    parts += [image(plot.read_bytes(), plot.stem) for plot in plots]
    parts += [
        "<h2>What was set</h2>",
        rows(["key", "value", "default", ""], set_keys(scenario)),
    ]
    told = ", ".join(f"{key} {value}" for key, value in made_by.items() if value)
    parts.append(f"<p class=note>{escape(told)}</p>")
    return page(folder.name, parts)


def rows(head: list[str], lines: Iterator[list[str]] | list[list[str]]) -> str:
    """A table of texts."""
    told = ["".join(f"<th>{escape(cell)}</th>" for cell in head)]
    told += ["".join(f"<td>{escape(cell)}</td>" for cell in line) for line in lines]
    return "<table class=words>" + "".join(f"<tr>{x}</tr>" for x in told) + "</table>"


def figures_table(figures: dict[str, Any]) -> str:
    """Figures with units and meanings."""
    lines = [
        [key, in_words(key, value), FIGURES[key].meaning if key in FIGURES else ""]
        for key, value in figures.items()
    ]
    return rows(["figure", "value", "what it is"], lines)


def set_keys(scenario: Any) -> Iterator[list[str]]:
    """Keys that differ from their defaults: key, value, default, meaning."""
    for key in keys(scenario):
        if key.value is not None and key.value != key.default:
            told = key.parameter
            value = f"{key.value} {told.unit}".rstrip()
            default = "" if key.default is None else str(key.default)
            yield [key.name, value, default, told.meaning]
