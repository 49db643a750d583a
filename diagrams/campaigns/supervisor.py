"""A child process that does runs, watched: what dies or hangs costs its own run only.

A run of a simulator can end its process: an error in native code, a demand that is
not met, memory that is not there, a loop without end. No scheduler can tell which
task was to blame when a worker dies with several. A child that is given one job at a
time can.
"""

from collections.abc import Mapping
from dataclasses import dataclass
import json
import os
from pathlib import Path
import selectors
import signal
import subprocess
import sys
import tempfile
from time import monotonic
from typing import Any

_POLL = 0.2
"""How often a child is looked at [s]."""
_START = 300.0
"""What a process may take before it can be asked [s]: no run is to blame for that."""
_TOLD = 2000
"""What is kept of its last words, in characters."""
ROOT = str(Path(__file__).parents[2])


@dataclass(frozen=True)
class Limits:
    """What a run may take.

    Attributes:
        time: Of a run, in s.
        memory: Of the process, in bytes.
        tries: Of a run that takes its process with it.
        kept: Memory of a process between runs, in bytes, beyond which a new one is
            begun, for not all is given back; and half as much again as after its first.
    """

    time: float = 600.0
    memory: float = 3e9
    tries: int = 3
    kept: float = 6e8


class Child:
    """The process; begun when there is something to do."""

    def __init__(self, act: str, limits: Limits) -> None:
        """Begins nothing yet.

        Args:
            act: What it does, see `acts.find_act`.
            limits: Of every run.
        """
        self._act, self._limits = act, limits
        self._process: subprocess.Popen[bytes] | None = None
        self._words: Any = None
        self._most = 0.0

    def ask(self, job: Mapping[str, Any]) -> dict[str, Any]:
        """Does a job.

        Returns:
            `figures`, `refused` or `error` as the act had it; or `died`, why the
            process is no more, and `said`, its last words.
        """
        if self._process is None:
            self._begin()
            why, _ = self._line(_START)
            if why is not None:
                return self._buried(why)
        assert self._process and self._process.stdin
        try:
            self._process.stdin.write(json.dumps(job).encode() + b"\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            return self._buried("")
        why, line = self._line(self._limits.time)
        if why is not None:
            return self._buried(why)
        held = _resident(self._process.pid)
        self._most = self._most or max(self._limits.kept, 1.5 * held)
        if held > self._most:
            self.close()
        told: dict[str, Any] = json.loads(line)
        return told

    def _line(self, time: float) -> tuple[str | None, bytes]:
        """A line of the process, or why there is none: "" if it is no more."""
        assert self._process and self._process.stdout
        end, line = monotonic() + time, b""
        with selectors.DefaultSelector() as ready:
            ready.register(self._process.stdout, selectors.EVENT_READ)
            while not line.endswith(b"\n"):
                if ready.select(_POLL):
                    piece = os.read(self._process.stdout.fileno(), 1 << 16)
                    if not piece:
                        return "", line
                    line += piece
                elif monotonic() > end:
                    return f"no answer in {time:g} s", line
                elif _resident(self._process.pid) > self._limits.memory:
                    gigabytes = self._limits.memory / 1e9
                    return f"more than {gigabytes:.3g} GB of memory", line
        return None, line

    def insist(self, job: Mapping[str, Any]) -> dict[str, Any]:
        """Does a job; one that takes its process with it is tried again."""
        for _ in range(self._limits.tries):
            told = self.ask(job)
            if "died" not in told:
                break
        return told

    def close(self) -> None:
        """Ends the process."""
        if self._process is not None:
            self._process.kill()
            self._process.communicate()
            self._words.close()
        self._process, self._most = None, 0.0

    def _begin(self) -> None:
        if self._process is None:
            self._words = tempfile.TemporaryFile()  # noqa: SIM115
            path = os.pathsep.join(filter(None, [ROOT, os.environ.get("PYTHONPATH")]))
            # Beyond what it may hold there is what is only promised to it.
            most = str(2.0 * self._limits.memory)
            self._process = subprocess.Popen(
                [sys.executable, "-m", f"{__package__}.child", self._act, most],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=self._words,
                start_new_session=True,
                env={**os.environ, "PYTHONPATH": path, "OMP_NUM_THREADS": "1"},
            )

    def _buried(self, why: str) -> dict[str, Any]:
        """Ends the process and says why it did, or had to."""
        assert self._process
        if not why:
            status = self._process.wait()
            why = f"exit {status}" if status >= 0 else signal.Signals(-status).name
        self._process.kill()
        self._process.wait()
        self._words.seek(0)
        said = self._words.read().decode("utf-8", "replace")[-_TOLD:]
        self.close()
        return {"died": why, "said": said}


def _resident(pid: int) -> float:
    """Memory of a process [bytes]; 0 if it is no more."""
    try:
        pages = int(Path(f"/proc/{pid}/statm").read_text().split()[1])
    except (OSError, IndexError):
        return 0.0
    return pages * float(os.sysconf("SC_PAGE_SIZE"))
