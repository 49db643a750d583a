"""The log of a run: a study's signals, sampled by one sink, and as CSV."""

from pathlib import Path
from typing import Any

import numpy as np
from pydrake.systems.primitives import LogVectorOutput, Multiplexer

from diagrams.common.study import Study


def columns(study: Study, port: str) -> list[str]:
    """Names of a port's columns in the log."""
    parts = study.signals[port]
    return [f"{port}.{part}" for part in parts] if len(parts) > 1 else [port]


def logged_ports(station: Any, study: Study) -> list[str]:
    """The study's signals, without the optional ones that this diagram lacks."""
    return [
        name
        for name in study.signals
        if name not in study.optional or station.HasOutputPort(name)
    ]


def add_log(builder: Any, station: Any, names: list[str], period: float) -> Any:
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
    sink: Any, study: Study, ports: list[str], context: Any
) -> dict[str, np.ndarray]:
    """All columns of the log; "time" is the first."""
    log = sink.FindLog(context)
    names = [name for port in ports for name in columns(study, port)]
    signals = {"time": log.sample_times().copy()}
    for name, row in zip(names, log.data(), strict=True):
        signals[name] = row.copy()
    return signals


def save_signals(signals: dict[str, np.ndarray], path: Path) -> None:
    """Writes the log as CSV, one column a signal: `pandas.read_csv(path)`."""
    table = np.column_stack(list(signals.values()))
    np.savetxt(
        path, table, fmt="%.9g", delimiter=",", header=",".join(signals), comments=""
    )
