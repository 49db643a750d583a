"""Runs on as many processes as there are: batches on a Dask cluster, nothing lost.

A batch of jobs is a task of the cluster; its worker hands them, one after another, to
a supervised child. Batches are as long as takes some seconds, so that the scheduler
costs next to nothing.
"""

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from functools import cache
import gc
import hashlib
from itertools import islice
import logging
from pathlib import Path
from time import perf_counter
from typing import Any

import dask
from distributed import Client, LocalCluster, as_completed
from distributed.client import FutureCancelledError
from distributed.scheduler import KilledWorker

from diagrams.campaigns.acts import Job
from diagrams.campaigns.supervisor import ROOT, Child, Limits
from diagrams.common.scenario import ScenarioError

_BATCH_TIME = 10.0
"""Of a batch [s], once it is known how long a run takes."""
_LONGEST_BATCH = 200
_AHEAD = 2
"""Batches in flight for each worker."""
_DEATHS = 20
"""Workers that a batch may outlive."""
PATIENCE = "5s"
"""With a scheduler that does not answer."""

_QUIET = {
    "distributed.worker.profile.enabled": False,
    "distributed.admin.tick.interval": "1s",
    "distributed.admin.system-monitor.interval": "10s",
    "distributed.scheduler.active-memory-manager.start": False,
}
"""What Dask watches of itself costs a tenth of a core while it waits."""

type Take = Callable[[Job, dict[str, Any]], bool]
"""Takes a job and its answer; says whether to go on."""


@cache
def fingerprint() -> str:
    """Of all code that a run depends on: scheduler and workers must have the same."""
    digest = hashlib.sha256()
    for package in ("systems", "plants", "diagrams"):
        for path in sorted(Path(ROOT, package).rglob("*.py")):
            digest.update(str(path.relative_to(ROOT)).encode() + path.read_bytes())
    return digest.hexdigest()[:16]


@cache
def _child(act: str, limits: Limits) -> Child:
    """The worker's own."""
    return Child(act, limits)


def work(act: str, limits: Limits, jobs: list[Job]) -> tuple[list[Any], float]:
    """Does a batch on a worker: the answers, and the seconds it took."""
    start, child = perf_counter(), _child(act, limits)
    return [child.insist(job) for job in jobs], perf_counter() - start


@contextmanager
def frozen() -> Iterator[None]:
    """Keeps what is there already from being collected by another thread.

    Some of Drake's objects end the process if they go in a thread that is not the
    main one, and the cluster's threads collect garbage like any other.
    """
    gc.collect()
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()


@contextmanager
def cluster(workers: int, scheduler: str = "") -> Iterator[Client]:
    """A cluster: one of processes on this machine, or one that exists.

    Args:
        workers: Number of processes.
        scheduler: Address of one that exists, `tcp://HOST:PORT`.

    Raises:
        ScenarioError: If it cannot be reached, or has other code than this process.
    """
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    if not scheduler:
        with (
            dask.config.set(_QUIET),
            frozen(),
            LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address="127.0.0.1:0",
                memory_limit=0,  # the supervisor's business
                silence_logs=logging.CRITICAL,
            ) as local,
            Client(local) as client,
        ):
            yield client
        return
    try:
        client = Client(scheduler, timeout=PATIENCE)
    except (OSError, ValueError) as error:
        raise ScenarioError(
            f"--scheduler {scheduler}: cannot be reached; expected tcp://HOST:PORT"
        ) from error
    with frozen(), client:
        others = set(client.run(fingerprint).values())
        if others != {fingerprint()}:
            raise ScenarioError(
                f"--scheduler {scheduler}: expected workers with this code, "
                f"{fingerprint()}; they have {', '.join(sorted(others)) or 'none'}"
            )
        yield client


@dataclass
class Work:
    """What was done so far.

    Attributes:
        runs: Number of them.
        busy: Seconds of all workers together.
        wall: Seconds that went by.
    """

    runs: int = 0
    busy: float = 0.0
    wall: float = 0.0
    _start: float = field(default_factory=perf_counter)

    def add(self, runs: int, seconds: float) -> None:
        """Counts a batch."""
        self.runs += runs
        self.busy += seconds
        self.wall = perf_counter() - self._start

    @property
    def batch(self) -> int:
        """How many runs to give at a time."""
        if not self.runs:
            return 1
        wanted = _BATCH_TIME * self.runs / max(self.busy, 1e-9)
        return max(1, min(int(wanted), _LONGEST_BATCH, 2 * self.runs))


class SchedulerLost(RuntimeError):
    """The cluster is gone; what was finished is kept."""


def perform(
    jobs: Iterable[Job], client: Client, act: str, limits: Limits, take: Take
) -> Work:
    """Does jobs on a cluster, in any order.

    Args:
        jobs: What is to be done; taken as workers get free.
        client: Of the cluster.
        act: What a run does, see `acts`.
        limits: Of every run.
        take: Called here with each answer as it comes.

    Raises:
        SchedulerLost: If the cluster is gone.
    """
    done, waiting = Work(), iter(jobs)
    deaths: dict[Any, int] = {}
    flying: dict[Any, list[Job]] = {}
    queue = as_completed(with_results=False)

    def send(batch: list[Job], died: int = 0) -> None:
        future = client.submit(work, act, limits, batch, pure=False)
        flying[future.key], deaths[future.key] = batch, died
        queue.add(future)

    def fill() -> None:
        workers = max(1, len(client.scheduler_info(n_workers=-1)["workers"]))
        while len(flying) < _AHEAD * workers:
            batch = list(islice(waiting, done.batch))
            if not batch:
                return
            send(batch)

    try:
        fill()
        for future in queue:
            batch, died = flying.pop(future.key), deaths.pop(future.key)
            try:
                answers, seconds = future.result()
            except KilledWorker as error:
                if died >= _DEATHS:
                    raise SchedulerLost(f"workers die: {error}") from error
                send(batch, died + 1)
                continue
            future.release()
            done.add(len(batch), seconds)
            # All answers are taken, even when one of them ends the campaign.
            told = [take(job, one) for job, one in zip(batch, answers, strict=True)]
            if not all(told):
                break
            fill()
    except (FutureCancelledError, OSError) as error:
        raise SchedulerLost(f"the cluster is gone: {error}") from error
    finally:
        with suppress(Exception):
            client.cancel(list(queue.futures), force=True)
    return done
