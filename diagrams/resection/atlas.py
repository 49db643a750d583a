"""`trocar atlas`: every mask of a folder planned; what each leaves, and why.

It is a campaign whose runs are masks: planned by supervised processes on Dask, each
with a session's file of its own, and gone on with when it is started again. A mask that
cannot be read costs its own row, which says why.
"""

import argparse
from collections import Counter
from collections.abc import Iterator
import csv
from dataclasses import asdict, dataclass
from html import escape
import itertools
import json
import os
from pathlib import Path
import re
import sys
from typing import Any

import numpy as np

from diagrams.campaigns.acts import Job, texts
from diagrams.campaigns.campaign import Campaign
from diagrams.campaigns.engine import cluster
from diagrams.campaigns.run import Interrupted, claim, kept, sample
from diagrams.campaigns.store import Store
from diagrams.campaigns.tape import Tape
from diagrams.common.plots import COLORS, add_axes, new_figure, png
from diagrams.common.report import image, page, rows
from diagrams.common.results import results
from diagrams.common.scenario import ScenarioError, refusals
from diagrams.common.tree import read_yaml
from diagrams.resection.planned import ENTRIES, NOTHING
from diagrams.resection.plots import CUT, section
from plants.tissue.mask_reader import READERS
from plants.tissue.segments import is_dicom, kind_of
from systems.common.archive import whole
from systems.common.parameter import parameter
from systems.resection.planning.resumed import load_session
from systems.resection.planning.session import Session

type Rows = list[dict[str, Any]]


@dataclass
class Atlas(Campaign):
    """A campaign whose runs are masks."""

    masks: list[str] = parameter([], "files", shape=(-1,))
    sessions: str = parameter("", "folder of their sessions")

    def drawn(self, tape: Tape) -> dict[str, Any]:
        """The mask of a run."""
        return {"mask": self.masks[tape.run]}

    def job(self, base: Any, run: int, variant: str, tape: Tape) -> Job:
        """A mask's, with the file that its plan is saved to."""
        job = super().job(base, run, variant, tape)
        job["overrides"]["session"] = str(self.session(run, variant))
        return job

    def session(self, run: int, variant: str) -> Path:
        """Of a mask, and a variant of the robot."""
        return Path(self.sessions) / f"{run:04d}-{self.names.index(variant)}.session"


# A folder of them --------------------------------------------------------------


def masks_in(folder: Path) -> list[Path]:
    """All masks below a folder, by how their names end, or of DICOM by their kind.

    Raises:
        ScenarioError: If there are none.
    """
    found = []
    for path in sorted(p for p in folder.rglob("[!.]*") if p.is_file()):
        if path.name.lower().endswith(tuple(READERS)):
            found.append(path)
        elif is_dicom(path):
            with refusals():
                if kind_of(path) in ("SEG", "RTSTRUCT"):
                    found.append(path)
    if not found:
        raise ScenarioError(
            f"{str(folder)!r} has no masks: expected files that end in "
            f"{', '.join(READERS)}, or DICOM's SEG or RTSTRUCT"
        )
    return found


def variants_of(texts: list[str]) -> dict[str, dict[str, Any]]:
    """All combinations of what `--vary KEY=[VALUES]` names.

    Raises:
        ScenarioError: If a text has no such form.
    """
    each = []
    for text in texts:
        key, equals, told = text.partition("=")
        values = read_yaml(told, f"--vary {text!r}") if equals else None
        if not isinstance(values, list) or not values:
            raise ScenarioError(f"--vary {text!r}: expected KEY.SUB=[VALUE, ...]")
        each.append([(key.strip(), value) for value in values])
    some = [dict(pairs) for pairs in itertools.product(*each)] if each else []
    return {", ".join(f"{k}={v}" for k, v in one.items()): one for one in some}


def atlas_command(arguments: argparse.Namespace) -> int:
    """Runs `trocar atlas`: 0 when all masks were tried, 1 if it was stopped."""
    from diagrams.studies import load_scenario

    folder, out = arguments.folder, arguments.out or Path("out") / "atlas"
    if not folder.is_dir():
        raise ScenarioError(f"{str(folder)!r}: expected a folder with masks in it")
    workers = arguments.workers or os.cpu_count() or 1
    if workers < 1:
        raise ScenarioError(f"--workers {workers}: expected at least 1")
    told = [f"entries.most={ENTRIES}", *arguments.overrides]  # theirs come last
    base = load_scenario(arguments.scenario, told)
    if base.system != "resection":
        raise ScenarioError(f"{arguments.scenario!r} is no resection")
    variants = variants_of(arguments.vary)
    for variant in variants.values():  # wrong keys are known before
        load_scenario(arguments.scenario, told + texts(variant))
    masks = masks_in(folder)
    atlas = Atlas(
        description=f"Masks of {folder.name}",
        scenario=arguments.scenario,
        act="plan",
        runs=len(masks),
        variants=variants,
        masks=[str(path.absolute()) for path in masks],
        sessions=str((out / "sessions").absolute()),
        time_limit=86_400.0,
    )
    try:
        lines = run_atlas(atlas, asdict(base), out, workers, arguments.scheduler)
    except Interrupted as error:
        print(f"trocar: {error}", file=sys.stderr)
        return 1
    names = [str(path.relative_to(folder)) for path in masks]
    print(as_text(atlas, lines, names))
    write_csv(out / "atlas.csv", atlas, lines, names)
    with whole(out / "atlas.html") as draft:
        draft.write_text(page(atlas.description, parts(atlas, lines, names)), "utf-8")
    print(out / "atlas.html")
    return 0


def run_atlas(
    atlas: Atlas, base: dict[str, Any], out: Path, workers: int, scheduler: str = ""
) -> Rows:
    """Plans what is not planned yet; all rows, by mask and variant.

    Raises:
        Interrupted: By Ctrl-C or the loss of the cluster; what is done is kept.
    """
    with results(out):
        claim(out, atlas, base)
        store = Store(out / "runs", NOTHING)
        if len(store.done()) < atlas.runs * len(atlas.names):
            with kept(store, out), cluster(workers, scheduler) as client:
                sample(atlas, base, store, client)
        store.compact()
    return store.rows()


# What comes of it --------------------------------------------------------------

HEAD = [
    *("mask", "tumour [cm³]", "reachable [%]", "resected [%]", "time [min]"),
    *("bored [cm³]", "what stays"),
]
SCALES = {"reachable": (100.0, ".1f"), "resected": (100.0, ".1f")}
SCALES |= {"time": (1 / 60, ".1f"), "bored": (1e6, ".2f")}


def reasons(row: dict[str, Any]) -> Counter[str]:
    """Volume that stays, in m3, by why it does."""
    found: Counter[str] = Counter()
    for lump in json.loads(row["unreached"] or "[]"):
        found[lump["reason"]] += lump["volume"]
    return found


def line(row: dict[str, Any], name: str) -> list[str]:
    """A row as people read it."""
    if row["status"] != "done":
        why = " ".join(row["said"].split())
        return [name, *[""] * (len(HEAD) - 2), re.sub("^mask '[^']*': ", "", why)]
    each = [
        " / ".join(f"{scale * row[f'{key}_{n}']:{form}}" for n in range(1, ENTRIES + 1))
        for key, (scale, form) in SCALES.items()
    ]
    stays = [
        f"{100 * v / row['tumour_volume']:.1f} % {why}"
        for why, v in reasons(row).most_common(2)
    ]
    volume = f"{1e6 * row['tumour_volume']:.2f}"
    return [name, volume, *each, "; ".join(stays) or "nothing"]


def by_variant(atlas: Atlas, lines: Rows) -> Iterator[tuple[str, Rows]]:
    """Rows of each variant."""
    for name in atlas.names:
        yield name, [row for row in lines if row["variant"] == name]


def as_text(atlas: Atlas, lines: Rows, names: list[str]) -> str:
    """The table for a terminal."""
    told = []
    for variant, some in by_variant(atlas, lines):
        table = [HEAD, *(line(row, names[row["run"]]) for row in some)]
        wide = [max(map(len, column)) for column in zip(*table, strict=True)][:-1]
        told += [f"\n{variant}"] if variant else []
        for cells in table:
            first, *rest = [f"{c:>{w}}" for c, w in zip(cells, wide, strict=False)]
            told.append("  ".join([f"{first.strip():<{wide[0]}}", *rest, cells[-1]]))
    return "\n".join(told)


def write_csv(path: Path, atlas: Atlas, lines: Rows, names: list[str]) -> None:
    """Writes all rows, in SI units."""
    keys = ["variant", "status", "said", *NOTHING]
    with whole(path) as draft, draft.open("w", newline="", encoding="utf-8") as stream:
        out = csv.writer(stream)
        out.writerow(["mask", *keys])
        for row in lines:
            out.writerow([names[row["run"]], *(row[key] for key in keys)])


def parts(atlas: Atlas, lines: Rows, names: list[str]) -> list[str]:
    """The page: table, the cohort in pictures, each mask cut open."""
    told = [
        "<p class=note>Planned, not carried out. Shares are of the tumour without the "
        "cap in the channel. a / b / c: through one, two, three entries, each "
        "proposed. time: of carrying it out, with the changes. bored: healthy tissue "
        "that further channels take.</p>"
    ]
    for variant, some in by_variant(atlas, lines):
        table = [line(row, names[row["run"]]) for row in some]
        told += [f"<h2>{escape(variant)}</h2>" if variant else "", rows(HEAD, table)]
    done = [row for row in lines if row["status"] == "done"]
    if done:
        picture = png(cohort(atlas, done, names))
        told += ["<h2>All of them</h2>", image(picture, "all")]
    told.append("<h2>Each, cut along the first channel, as planned</h2>")
    told.append(
        "<p class=note>Ochre: tumour that stays. White: resected. Blue: the channel "
        "and its cap. Red: critical. Violet: bored, or removed beside the tumour.</p>"
    )
    for row in done:
        file = atlas.session(row["run"], row["variant"])
        if file.is_file():
            name = " ".join(filter(None, [names[row["run"]], row["variant"]]))
            cut = png(cuts(load_session(file)))
            told += [
                "<figure style='display: inline-block; width: 47%; margin: 1%'>",
                f"{image(cut, name)}<figcaption>{escape(name)}</figcaption></figure>",
            ]
    return told


def cohort(atlas: Atlas, done: Rows, names: list[str]) -> Any:
    """Resected by entries, time by volume, and what stays by reason."""
    figure = new_figure(11.0, 2.0 + max(0.28 * len(done), 2.0))
    left, middle, right = (add_axes(figure, 1, 3, n) for n in (1, 2, 3))
    place = np.arange(len(done))[::-1]
    shades = (COLORS["robot"], COLORS["accent"], COLORS["target"])
    before = np.zeros(len(done))
    for n, shade in enumerate(shades[:ENTRIES], 1):
        share = 100 * np.array([row[f"resected_{n}"] for row in done])
        left.barh(place, share - before, left=before, color=shade, label=f"entry {n}")
        before = share
    labels = [f"{names[row['run']]} {row['variant']}".strip() for row in done]
    left.set_yticks(place, labels, fontsize=7)
    left.set(xlabel="resected in the plan [%]", xlim=(0, 100))
    left.legend(fontsize=7)
    for variant, some in by_variant(atlas, done):
        volume = [1e6 * row["tumour_volume"] for row in some]
        time = [row["time_1"] / 60 for row in some]
        middle.plot(volume, time, "o", label=variant or None)
    middle.set(xlabel="tumour [cm³]", ylabel="through one entry [min]")
    middle.axis((0.0, 1.1 * middle.get_xlim()[1], 0.0, 1.1 * middle.get_ylim()[1]))
    if atlas.variants:
        middle.legend(fontsize=7)
    total: Counter[str] = sum((reasons(row) for row in done), Counter())
    stays = total.most_common(8)[::-1]
    right.barh(
        [why for why, _ in stays], [1e6 * v for _, v in stays], color=COLORS["muted"]
    )
    right.set(xlabel="stays [cm³]")
    right.tick_params(axis="y", labelsize=7)
    return figure


def cuts(session: Session) -> Any:
    """Two cuts along the first channel as the plan leaves them."""
    volume = session.volume
    figure = new_figure(5.0, 2.6)
    size = 1e3 * np.array(volume.labels.shape) * volume.spacing
    for number, axis in enumerate((1, 0), 1):
        axes = add_axes(figure, 1, 2, number)
        axes.imshow(
            section(volume, volume.tau, axis).T,
            extent=(0, size[1 - axis], size[2], 0),
            cmap=CUT,
            vmin=-0.5,
            vmax=5.5,
            interpolation="nearest",
        )
        axes.grid(False)
        axes.set(xlabel=f"{'xy'[1 - axis]} [mm]")
    return figure
