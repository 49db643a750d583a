"""A campaign's report: one HTML page, and the worst runs as scenarios.

Shares have exact intervals (Clopper and Pearson), medians those of order statistics,
variants are compared on the same draws (McNemar), and what was drawn is ranked by how
differently it is spread among failures (Kolmogorov and Smirnov).
"""

from collections import Counter
from collections.abc import Iterable
from html import escape
import io
import json
import math
from pathlib import Path
from typing import Any

from matplotlib.figure import Figure
import numpy as np
from scipy.stats import ks_2samp
import yaml

from diagrams.campaigns.campaign import Campaign
from diagrams.campaigns.engine import fingerprint
from diagrams.campaigns.statistics import (
    compared,
    median_interval,
    running_interval,
    share_interval,
    upper_bound,
)
from diagrams.common.report import image, page
from systems.common.archive import whole

_WORST = 10
_FEWEST = 5
"""Failures below which nothing is said about what explains them."""
_COLOURS = ("#1f77b4", "#d62728", "#2ca02c", "#9467bd", "#ff7f0e", "#8c564b")

type Rows = list[dict[str, Any]]


def write_report(campaign: Campaign, rows: Rows, out: Path, base: Any) -> Path:
    """Writes `report.html`, `summary.json` and the worst runs' scenarios.

    Args:
        campaign: What was run.
        rows: Of the store.
        out: The campaign's folder.
        base: Plain data of the scenario that was varied.
    """
    by = {n: [r for r in rows if r["variant"] == n] for n in campaign.names}
    worst = worst_runs(campaign, rows)
    commands = save_worst(campaign, worst, out, base)
    found = {name or "all": summary(campaign, some) for name, some in by.items()}
    with whole(out / "summary.json") as draft:
        draft.write_text(json.dumps(found, indent=2) + "\n", encoding="utf-8")
    parts = [
        f"<p>{escape(campaign.description)}</p>",
        f"<p class=note>Scenario <code>{escape(campaign.scenario or campaign.act)}"
        f"</code>, seed {campaign.seed}, code <code>{fingerprint()}</code>.</p>",
        *_shares(campaign, by),
        *_splitting(out),
        *_figures(campaign, by),
        *_pairs(by),
        *_causes(by),
        *_worst_table(campaign, worst, commands),
        "<h2>The campaign</h2><pre>",
        escape((out / "campaign.yaml").read_text(encoding="utf-8")),
        "</pre>",
    ]
    with whole(out / "report.html") as draft:
        draft.write_text(page(out.name, parts), encoding="utf-8")
    return out / "report.html"


def counted(rows: Rows) -> Rows:
    """Runs that count: those of a scenario that can be."""
    return [row for row in rows if row["status"] != "refused"]


def summary(campaign: Campaign, rows: Rows) -> dict[str, Any]:
    """The counts of a variant, as data."""
    kept = counted(rows)
    failed = sum(bool(row["failed"]) for row in kept)
    low, high = share_interval(failed, len(kept)) if kept else (0.0, 1.0)
    return {
        "runs": len(rows),
        **Counter(row["status"] for row in rows),
        "failed": failed,
        "share": failed / len(kept) if kept else None,
        "low": low,
        "high": high,
        "upper_one_sided": upper_bound(failed, len(kept)) if kept else 1.0,
        "by": dict(Counter(part for row in kept for part in _reasons(row))),
    }


def _reasons(row: dict[str, Any]) -> list[str]:
    return row["failed"].split("; ") if row["failed"] else []


def _table(head: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    lines = ["".join(f"<th>{escape(str(h))}</th>" for h in head)]
    lines += ["".join(f"<td>{escape(str(x))}</td>" for x in row) for row in rows]
    return "<table>" + "".join(f"<tr>{line}</tr>" for line in lines) + "</table>"


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"


def _shares(campaign: Campaign, by: dict[str, Rows]) -> list[str]:
    kinds = [*campaign.fail, "error", "died"]
    lines = []
    for name, rows in by.items():
        kept = counted(rows)
        if not kept:
            continue
        told = summary(campaign, rows)
        sure = (told["low"], told["high"])
        if campaign.stop.width:
            sure = running_interval(told["failed"], len(kept))
        lines.append(
            [name or "all", len(kept), len(rows) - len(kept), told["failed"]]
            + [f"{_percent(sure[0])} to {_percent(sure[1])}"]
            + [_percent(told["upper_one_sided"])]
            + [told["by"].get(kind, 0) for kind in kinds]
        )
    head = ["variant", "runs", "refused", "failed", "95 % interval", "95 % at most"]
    how = (
        "that holds however often one looked"
        if campaign.stop.width
        else "of Clopper and Pearson"
    )
    return [
        "<h2>How often it fails</h2>",
        _table([*head, *kinds], lines),
        f"<p class=note>Intervals are those {how}; the bound is one-sided: zero "
        "failures are no proof that there are none. Refused draws are patients that "
        "cannot be, and do not count.</p>",
    ]


def _splitting(out: Path) -> list[str]:
    path = out / "splitting.json"
    if not path.is_file():
        return []
    told = json.loads(path.read_text(encoding="utf-8"))
    each = ", ".join(f"{p:.2g}" for p in told["each"])
    return [
        "<h2>Splitting</h2>",
        f"<p>Probability of failure <b>{told['probability']:.3g}</b>, 95 % interval "
        f"{told['low']:.2g} to {told['high']:.2g}, from {len(told['each'])} replicates "
        f"({each}) and {told['runs']} runs; worst level {told['worst_level']:.4g}.</p>"
        "<p class=note>Replicates agree on what all of them miss: a second, narrow way "
        "to fail is not seen. Hold it against the plain sample.</p>",
    ]


def _values(rows: Rows, name: str) -> np.ndarray:
    told = [row.get(name) for row in rows]
    values = np.array([x for x in told if isinstance(x, int | float)], dtype=float)
    return values[np.isfinite(values)]


def numeric(campaign: Campaign, rows: Rows) -> list[str]:
    """The figures that are numbers and vary, those to be measured first."""
    head = ("run", "seed")
    names = campaign.measure or [k for k in (rows[0] if rows else {}) if k not in head]
    return [n for n in names if len(set(_values(rows, n).tolist())) > 2]


def _figures(campaign: Campaign, by: dict[str, Rows]) -> list[str]:
    every = [row for rows in by.values() for row in rows]
    names = numeric(campaign, every)
    if not names:
        return []
    lines = []
    for name in names:
        for variant, rows in by.items():
            values = _values(rows, name)
            if len(values):
                middle, low, high = median_interval(values)
                ends = np.percentile(values, [0, 5, 95, 100])
                lines.append(
                    [name, variant or "all", len(values), f"{middle:.4g}"]
                    + [f"{low:.4g} to {high:.4g}", *(f"{x:.4g}" for x in ends)]
                )
    head = ["figure", "variant", "n", "median", "95 % interval of it"]
    return [
        "<h2>Figures</h2>",
        _image(histograms(names, by)),
        _table([*head, "least", "5 %", "95 %", "greatest"], lines),
    ]


def histograms(names: list[str], by: dict[str, Rows]) -> Figure:
    """The spread of each figure, variants over one another."""
    columns = min(3, len(names))
    lines = math.ceil(len(names) / columns)
    figure = Figure(figsize=(4.0 * columns, 2.6 * lines), layout="constrained")
    for place, name in enumerate(names, 1):
        axes = figure.add_subplot(lines, columns, place)
        all_values = np.concatenate([_values(rows, name) for rows in by.values()])
        bins = np.histogram_bin_edges(all_values, 40)
        for (variant, rows), colour in zip(by.items(), _COLOURS * 9, strict=False):
            values = _values(rows, name)
            axes.hist(
                values,
                bins.tolist(),
                histtype="step",
                color=colour,
                label=variant or None,
            )
        axes.set_title(name, fontsize=10)
        axes.set_ylabel("runs", fontsize=8)
        axes.tick_params(labelsize=8)
        axes.spines[["top", "right"]].set_visible(False)
        if place == 1 and len(by) > 1:
            axes.legend(fontsize=8, frameon=False)
    return figure


def _image(figure: Figure) -> str:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=110, metadata={"Software": None})
    return image(buffer.getvalue(), "histograms")


def _pairs(by: dict[str, Rows]) -> list[str]:
    names = list(by)
    lines = []
    for number, one in enumerate(names):
        for other in names[number + 1 :]:
            first = {row["run"]: bool(row["failed"]) for row in counted(by[one])}
            second = {row["run"]: bool(row["failed"]) for row in counted(by[other])}
            both = sorted(first.keys() & second.keys())
            found = compared([first[r] for r in both], [second[r] for r in both])
            lines.append(
                [f"{one} / {other}", len(both), found.only_first, found.only_second]
                + [f"{found.p_value:.2g}"]
            )
    if not lines:
        return []
    head = ["variants", "pairs", "only the first fails", "only the second", "p"]
    return ["<h2>Variants on the same draws</h2>", _table(head, lines)]


def _flat(value: Any, key: str) -> dict[str, float]:
    if isinstance(value, bool | int | float):
        return {key: float(value)}
    if isinstance(value, list):
        parts = [_flat(item, f"{key}[{i}]") for i, item in enumerate(value[:3])]
        return {k: v for one in parts for k, v in one.items()}
    return {}


def causes(rows: Rows) -> list[tuple[str, float, float]]:
    """What of the draws is spread differently among failures.

    Returns:
        Key, Kolmogorov-Smirnov distance and p-value (Bonferroni), most telling first.
    """
    drawn = [
        {
            k: v
            for key, value in json.loads(row["draws"]).items()
            for k, v in _flat(value, key).items()
        }
        for row in rows
    ]
    failed = np.array([bool(row["failed"]) for row in rows])
    if min(failed.sum(), (~failed).sum()) < _FEWEST:
        return []
    common = set.intersection(*(set(one) for one in drawn))
    found = []
    for key in sorted(common):
        values = np.array([one[key] for one in drawn])
        if np.ptp(values) > 0.0:
            told = ks_2samp(values[failed], values[~failed])
            p = min(1.0, float(told.pvalue) * len(common))
            found.append((key, float(told.statistic), p))
    return sorted(found, key=lambda one: -one[1])


def _causes(by: dict[str, Rows]) -> list[str]:
    parts = []
    for name, rows in by.items():
        found = causes(counted(rows))[:8]
        if found:
            lines = [[key, f"{d:.2f}", f"{p:.2g}"] for key, d, p in found]
            head = ["drawn", "distance", "p, for all of them"]
            parts += [f"<h3>{escape(name or 'all')}</h3>", _table(head, lines)]
    note = "<p class=note>Too few failures to tell.</p>"
    return ["<h2>What of the draws goes with failure</h2>", *(parts or [note])]


def worst_runs(campaign: Campaign, rows: Rows) -> Rows:
    """The ten worst runs: failures first, then by the campaign's figure."""
    sign = -1.0 if campaign.worst.startswith("-") else 1.0
    name = campaign.worst.removeprefix("-")

    def badness(row: dict[str, Any]) -> tuple[bool, float, int]:
        value = row.get(name)
        level = sign * value if isinstance(value, int | float) else math.inf
        return not row["failed"], level, row["run"]

    return sorted(counted(rows), key=badness)[:_WORST]


def save_worst(campaign: Campaign, worst: Rows, out: Path, base: Any) -> list[str]:
    """Saves runs as scenarios of their own; returns the commands that repeat them."""
    if campaign.act != "scenario":
        return ["" for _ in worst]
    from dataclasses import asdict

    from diagrams.campaigns.acts import texts
    from diagrams.studies import scenario_of

    commands = []
    for row in worst:
        fixed = campaign.fixed | campaign.variants.get(row["variant"], {})
        overrides = texts(json.loads(row["draws"]) | fixed)
        tree = json.loads(json.dumps(base))
        scenario = asdict(scenario_of(tree, overrides, row["seed"]))
        name = "_".join(filter(None, [f"run_{row['run']:06d}", row["variant"]]))
        path = out / "worst" / f"{name.replace(' ', '_')}.yaml"
        path.parent.mkdir(exist_ok=True)
        with whole(path) as draft:
            draft.write_text(yaml.safe_dump(scenario, sort_keys=False), "utf-8")
        commands.append(f"trocar run {path}")
    return commands


def _worst_table(campaign: Campaign, worst: Rows, commands: list[str]) -> list[str]:
    name = campaign.worst.removeprefix("-")
    lines = [
        [row["run"], row["variant"], row["failed"] or "-"]
        + (
            [f"{row[name]:.4g}" if isinstance(row.get(name), float) else "-"]
            if name
            else []
        )
        + [command or row["draws"][:80]]
        for row, command in zip(worst, commands, strict=True)
    ]
    head = ["run", "variant", "failed by", *([name] if name else []), "again"]
    return ["<h2>The worst runs</h2>", _table(head, lines)]
