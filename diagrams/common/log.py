"""The log of a run: a study's signals, sampled by one sink, and as CSV."""

from collections.abc import Iterable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from pydrake.systems.primitives import LogVectorOutput, Multiplexer

from systems.common import signal


def columns(port: str, kind: Any) -> list[str]:
    """Names of a port's columns in the log.

    Args:
        port: The exported port's name.
        kind: Its signal; of one element the column is the port's name itself.
    """
    parts = signal.columns(kind)
    return [f"{port}.{part}" for part in parts] if len(parts) > 1 else [port]


def named(
    logged: Mapping[str, Any], samples: Mapping[str, np.ndarray], root: str
) -> Any:
    """What was logged below a name: of "planner" there is `guide.rho`.

    Args:
        logged: Ports and their signals.
        samples: Columns of the log, by name.
        root: The first part of the ports' names.

    Raises:
        AttributeError: If no port that was logged begins with it.
    """
    found = {}
    for port, kind in logged.items():
        first, _, rest = port.partition(".")
        if first == root:
            table = np.column_stack([samples[name] for name in columns(port, kind)])
            found[rest] = signal.view(kind, table)
    if not found:
        raise AttributeError(f"nothing is logged as {root!r}")
    return found[""] if "" in found else SimpleNamespace(**found)


def add_log(builder: Any, station: Any, names: Iterable[str], period: float) -> Any:
    """Logs signals of a diagram, one below the other, in one sink.

    One sink for all: each system of a diagram costs time at each of its steps.
    """
    ports = [station.GetOutputPort(name) for name in names]
    bundle = builder.AddNamedSystem(
        "signals", Multiplexer([port.size() for port in ports])
    )
    for index, port in enumerate(ports):
        builder.Connect(port, bundle.get_input_port(index))
    sink = LogVectorOutput(bundle.get_output_port(), builder, period)
    sink.set_name("log")
    return sink


def read_log(
    sink: Any, logged: Mapping[str, Any], context: Any
) -> dict[str, np.ndarray]:
    """All columns of the log; "time" is the first."""
    log = sink.FindLog(context)
    names = [name for port, kind in logged.items() for name in columns(port, kind)]
    signals = {"time": log.sample_times().copy()}
    for name, row in zip(names, log.data(), strict=True):
        signals[name] = row.copy()
    return signals


def first_fault(signals: Mapping[str, np.ndarray]) -> str:
    """The first sample of a log that is no finite number, in words; "" if none is."""
    faults = [
        (samples.argmin(), name)
        for name, samples in ((n, np.isfinite(s)) for n, s in signals.items())
        if not samples.all()
    ]
    if not faults:
        return ""
    row, name = min(faults)
    time, value = signals["time"][row], signals[name][row]
    return f"signal {name!r} is {value} at {time:.3f} s"


def save_signals(signals: dict[str, np.ndarray], path: Path) -> None:
    """Writes the log as CSV, one column a signal: `pandas.read_csv(path)`."""
    table = np.column_stack(list(signals.values()))
    np.savetxt(
        path, table, fmt="%.9g", delimiter=",", header=",".join(signals), comments=""
    )
