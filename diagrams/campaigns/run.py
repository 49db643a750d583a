"""Running a campaign: trial, jobs, rows, early end; started again, it goes on."""

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, replace
import hashlib
import json
from pathlib import Path
import sys
from time import monotonic
from typing import Any

import numpy as np
from tqdm import tqdm
import yaml

from diagrams.campaigns.acts import Job
from diagrams.campaigns.campaign import Campaign, base_of
from diagrams.campaigns.engine import SchedulerLost, cluster, perform
from diagrams.campaigns.expression import failures
from diagrams.campaigns.splitting import Estimate, estimate
from diagrams.campaigns.statistics import running_interval
from diagrams.campaigns.store import Store
from diagrams.campaigns.supervisor import Child
from diagrams.campaigns.tape import Tape
from diagrams.common.results import results
from diagrams.common.scenario import ScenarioError, nearest
from systems.common.archive import whole

_FLUSH = 10.0
"""Seconds between parts."""
_COMPILED = 1200.0
"""Seconds that the kernels may take before the first run, on a slow machine."""
_FREE = ("description", "runs", "measure", "worst", "stop", "time_limit", "tries")
"""What may change in a folder of a campaign that was begun."""


class Interrupted(RuntimeError):
    """A campaign that was stopped; what was finished is kept."""


class Progress:
    """What a terminal shows of a campaign: rate, time left, failures so far."""

    def __init__(self, total: int, done: int, label: str) -> None:
        """Begins.

        Args:
            total: Runs in all.
            done: Those of earlier times.
            label: Before the bar.
        """
        self.failed = 0
        self._bar = tqdm(
            total=total,
            initial=done,
            desc=label,
            unit="run",
            disable=not sys.stderr.isatty(),
            leave=False,
        )

    def add(self, failed: bool) -> None:
        """One more."""
        self.failed += failed
        self._bar.set_postfix_str(f"{self.failed} failed", refresh=False)
        self._bar.update()

    def close(self) -> None:
        """Ends."""
        self._bar.close()


class Ledger:
    """Takes answers, writes rows, and says when it is enough.

    Attributes:
        failed: Whether a run of a variant failed, of all that are done.
        end: Runs from here on are not counted: it was enough before.
    """

    def __init__(self, campaign: Campaign, store: Store) -> None:
        """Reads what is there.

        Args:
            campaign: What is run.
            store: Where its rows are.
        """
        self._campaign, self._store = campaign, store
        head = store.read().select(["run", "variant", "failed"]).to_pylist()
        self.failed = {(r["run"], r["variant"]): bool(r["failed"]) for r in head}
        self.end = campaign.runs
        self._looked = 0
        self._counts = dict.fromkeys(campaign.names, 0)
        self._flushed = monotonic()
        self.is_enough()

    def take(self, job: Job, answer: Mapping[str, Any]) -> bool:
        """Keeps the answer of a job; whether to go on."""
        head, figures = row(self._campaign, job, answer)
        self._store.add(head, figures)
        self.failed[job["run"], job["variant"]] = bool(head["failed"])
        if monotonic() > self._flushed + _FLUSH:
            self._store.flush()
            self._flushed = monotonic()
        return not self.is_enough()

    def is_enough(self) -> bool:
        """Whether the intervals of all variants are as narrow as was wished.

        Runs are looked at in their order, so that it does not matter which come first.
        """
        stop, names = self._campaign.stop, self._campaign.names
        if not stop.width or self.end < self._campaign.runs:
            return self.end < self._campaign.runs
        while all((self._looked, name) in self.failed for name in names):
            for name in names:
                self._counts[name] += self.failed[self._looked, name]
            self._looked += 1
            if self._looked >= stop.least:
                bounds = [
                    running_interval(c, self._looked) for c in self._counts.values()
                ]
                if all(high - low <= stop.width for low, high in bounds):
                    self.end = self._looked
                    return True
        return False


def row(
    campaign: Campaign, job: Job, answer: Mapping[str, Any]
) -> tuple[dict[str, Any], dict[str, Any]]:
    """The columns of an answer that all rows have, and its figures."""
    figures = answer.get("figures", {})
    status = next(k for k in ("figures", "refused", "error", "died") if k in answer)
    said = "" if status == "figures" else answer[status]
    failed = failures(campaign.expressions, figures) if figures else [status]
    if status == "refused":
        failed = []  # no such patient: neither a success nor a failure
    fixed = campaign.fixed | campaign.variants.get(job["variant"], {})
    drawn = {k: v for k, v in job["overrides"].items() if k not in fixed}
    head = {
        "run": job["run"],
        "variant": job["variant"],
        "seed": job["seed"],
        "status": "done" if status == "figures" else status,
        "failed": "; ".join(failed),
        "said": "\n".join(filter(None, [said, answer.get("said", "")])),
        "draws": json.dumps(drawn),
    }
    return head, figures


def identity(campaign: Campaign, base: Any) -> dict[str, Any]:
    """What tells a campaign from others."""
    told = {k: v for k, v in asdict(campaign).items() if k not in _FREE}
    digest = hashlib.sha256(json.dumps(base, sort_keys=True).encode()).hexdigest()
    return json.loads(json.dumps({**told, "scenario_digest": digest[:16]}))


def claim(out: Path, campaign: Campaign, base: Any) -> None:
    """Makes a folder this campaign's, if it is not another's.

    Raises:
        ScenarioError: If it is; what differs is named.
    """
    path, mine = out / "identity.json", identity(campaign, base)
    if path.is_file():
        theirs = json.loads(path.read_text(encoding="utf-8"))
        for key, value in mine.items():
            if theirs.get(key) != value:
                raise ScenarioError(
                    f"{str(out)!r} belongs to another campaign: its {key} is "
                    f"{theirs.get(key)!r}, not {value!r}; expected another --out"
                )
    elif (out / "runs").exists():
        raise ScenarioError(f"{str(out)!r} has runs of no known campaign")
    with whole(path) as draft:
        draft.write_text(json.dumps(mine, indent=2) + "\n", encoding="utf-8")
    with whole(out / "campaign.yaml") as draft:
        text = yaml.safe_dump(asdict(campaign), sort_keys=False)
        draft.write_text(text, encoding="utf-8")


def trial(out: Path, campaign: Campaign, base: Any) -> dict[str, Any]:
    """The figures of one run before all others: kernels are compiled, names known.

    Raises:
        ScenarioError: If it fails, or a figure of the campaign is not in it.
    """
    path = out / "trial.json"
    if path.is_file():
        figures = json.loads(path.read_text(encoding="utf-8"))
    else:
        tape = Tape([campaign.seed, 0])
        job = campaign.job(base, -1, campaign.names[0], tape)
        if campaign.act == "scenario":
            job["overrides"] = campaign.fixed | campaign.variants.get(
                job["variant"], {}
            )
        limits = campaign.limits
        child = Child(campaign.act, replace(limits, time=limits.time + _COMPILED))
        try:
            answer = child.ask(job)
        finally:
            child.close()
        if "figures" not in answer:
            _, told = next(iter(answer.items()))
            raise ScenarioError(f"the first run, of the scenario as it is: {told}")
        figures = answer["figures"]
        with whole(path) as draft:
            draft.write_text(json.dumps(figures), encoding="utf-8")
    for expression in campaign.expressions:
        expression.check(figures)
    asked = [*campaign.measure, campaign.worst.removeprefix("-")]
    asked += [campaign.splitting.level] if campaign.search == "splitting" else []
    for name in filter(None, asked):
        if name not in figures:
            raise ScenarioError(f"no figure {name!r}: {nearest(name, figures)}")
    return figures


@contextmanager
def kept(store: Store, out: Path) -> Iterator[None]:
    """Whatever ends what is done in this context, rows that were taken are written."""
    try:
        yield
    except (KeyboardInterrupt, SchedulerLost) as error:
        store.flush()
        what = str(error) or "interrupted"
        raise Interrupted(
            f"{what}; {len(store.done())} runs are kept in {out}, "
            "the same command goes on"
        ) from error
    store.flush()


def run_campaign(
    campaign: Campaign, out: Path, workers: int = 2, scheduler: str = ""
) -> dict[str, Any]:
    """Runs what is left of a campaign, and writes its report.

    Args:
        campaign: What to run.
        out: Folder of its results; it goes on with what is there.
        workers: Processes on this machine.
        scheduler: Of a cluster that exists, instead.

    Returns:
        How it went: `runs` done now, `busy` and `wall` seconds.

    Raises:
        ScenarioError: For what is wrong before it begins.
        Interrupted: By Ctrl-C or the loss of the cluster.
    """
    base = base_of(campaign)
    with results(out):
        claim(out, campaign, base)
        figures = trial(out, campaign, base)
        store = Store(out / "runs", figures)
        with kept(store, out), cluster(workers, scheduler) as client:
            if campaign.search == "splitting":
                done = split(campaign, base, store, client, out)
            else:
                done = sample(campaign, base, store, client)
        store.compact()
    return done


def sample(campaign: Campaign, base: Any, store: Store, client: Any) -> dict[str, Any]:
    """Runs all draws, or as many as it takes."""
    ledger = Ledger(campaign, store)
    total = campaign.runs * len(campaign.names)
    bar = Progress(total, len(ledger.failed), "campaign")

    def take(job: Job, answer: dict[str, Any]) -> bool:
        go_on = ledger.take(job, answer)
        bar.add(ledger.failed[job["run"], job["variant"]])
        return go_on

    jobs = () if ledger.is_enough() else campaign.jobs(base, set(ledger.failed))
    try:
        done = perform(jobs, client, campaign.act, campaign.limits, take)
    finally:
        bar.close()
    store.flush()
    store.keep(ledger.end)
    return asdict(done)


def split(
    campaign: Campaign, base: Any, store: Store, client: Any, out: Path
) -> dict[str, Any]:
    """Looks for rare failures; runs that are there already are not done again."""
    keys: list[str] = []
    params = campaign.splitting
    sign = -1.0 if params.rises else 1.0
    known = {r["run"]: r for r in store.read().to_pylist()}
    bar = Progress(
        params.population * (1 + (params.levels // 4) * params.moves), 0, "splitting"
    )
    spent = {"runs": 0, "busy": 0.0, "wall": 0.0}
    first = 0

    def evaluate(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        nonlocal first
        tapes, jobs = [], []
        for number, point in enumerate(points, first):
            tape = Tape([campaign.seed, number], dict(zip(keys, point, strict=False)))
            jobs.append(campaign.job(base, number, "", tape))
            tapes.append(tape)

        def take(job: Job, answer: dict[str, Any]) -> bool:
            head, figures = row(campaign, job, answer)
            store.add(head, figures)
            known[job["run"]] = {**head, **figures}
            bar.add(bool(head["failed"]))
            return True

        left = [job for job in jobs if job["run"] not in known]
        done = perform(left, client, campaign.act, campaign.limits, take)
        for key, value in asdict(done).items():
            if key in spent:
                spent[key] += value
        store.flush()
        new = sorted(set().union(*(tape.numbers for tape in tapes)) - set(keys))
        keys.extend(new)
        numbers = [[tape.numbers.get(k, np.nan) for k in keys] for tape in tapes]
        told = [known[job["run"]].get(params.level) for job in jobs]
        levels = [np.inf if x is None else sign * x for x in told]
        first += len(points)
        return np.array(levels), np.array(numbers)

    falling = replace(params, failure=sign * params.failure)
    try:
        found = estimate(evaluate, 0, falling, campaign.seed)
    finally:
        bar.close()
    write_estimate(out, found, keys, sign)
    return spent


def write_estimate(out: Path, found: Estimate, keys: list[str], sign: float) -> None:
    """Writes what splitting found, and the worst draw's numbers."""
    told = {
        "probability": found.probability,
        "low": found.low,
        "high": found.high,
        "each": found.each,
        "runs": found.runs,
        "levels": [sign * level for level in found.ladder.levels],
        "steps": found.ladder.steps,
        "worst_level": sign * found.lowest,
        "worst": dict(zip(keys, found.worst.tolist(), strict=False)),
    }
    with whole(out / "splitting.json") as draft:
        draft.write_text(json.dumps(told, indent=2) + "\n", encoding="utf-8")
