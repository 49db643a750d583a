"""Joining named systems: a diagram as a list of wires."""

from collections.abc import Iterable, Mapping
from typing import Any

from diagrams.common.scenario import nearest


def port_of(systems: Mapping[str, Any], signal: str, output: bool) -> Any:
    """The port that `system.port` names.

    Raises:
        ValueError: If there is no such system or port; the nearest is named.
    """
    name, _, port = signal.partition(".")
    if name not in systems:
        raise ValueError(
            f"wire {signal!r}: no system {name!r}: {nearest(name, systems)}"
        )
    system = systems[name]
    if output:
        count, get, find = (
            system.num_output_ports(),
            system.get_output_port,
            system.GetOutputPort,
        )
    else:
        count, get, find = (
            system.num_input_ports(),
            system.get_input_port,
            system.GetInputPort,
        )
    names = [get(i).get_name() for i in range(count)]
    if port not in names:
        kind = "output" if output else "input"
        raise ValueError(
            f"wire {signal!r}: {name!r} has no {kind} {port!r}: {nearest(port, names)}"
        )
    return find(port)


def has_input(systems: Mapping[str, Any], signal: str) -> bool:
    """Whether the input that `system.port` names is there."""
    name, _, port = signal.partition(".")
    return name in systems and systems[name].HasInputPort(port)


def has_output(systems: Mapping[str, Any], signal: str) -> bool:
    """Whether the output that `system.port` names is there."""
    name, _, port = signal.partition(".")
    return name in systems and systems[name].HasOutputPort(port)


def connect(
    builder: Any, systems: Mapping[str, Any], wires: Iterable[tuple[str, str]]
) -> None:
    """Connects each wire `("system.output", "system.input")` in the builder.

    Raises:
        ValueError: For a wire to or from nowhere.
    """
    for source, sink in wires:
        builder.Connect(port_of(systems, source, True), port_of(systems, sink, False))


def export(
    builder: Any, systems: Mapping[str, Any], signals: Mapping[str, str]
) -> None:
    """Exports outputs: exported name to `system.output`.

    Raises:
        ValueError: For an output that is not there.
    """
    for name, source in signals.items():
        builder.ExportOutput(port_of(systems, source, True), name)


def add_blocks(
    builder: Any, blocks: Mapping[str, Any], swaps: Mapping[str, Any] | None
) -> dict[str, Any]:
    """Adds blocks by their names, some of them replaced.

    Returns:
        What was added.

    Raises:
        ValueError: If a replacement has the name of no block.
    """
    for name in swaps or {}:
        if name not in blocks:
            raise ValueError(f"no block {name!r} to swap: {nearest(name, blocks)}")
    added = {**blocks, **(swaps or {})}
    for name, block in added.items():
        builder.AddNamedSystem(name, block)
    return added


def finish(
    builder: Any,
    name: str,
    systems: Mapping[str, Any],
    wires: Iterable[tuple[str, str]],
    signals: Mapping[str, str],
) -> Any:
    """Connects all wires, exports all signals, and builds the diagram.

    Raises:
        ValueError: For a wire or a signal to or from nowhere.
    """
    connect(builder, systems, wires)
    export(builder, systems, signals)
    diagram = builder.Build()
    diagram.set_name(name)
    return diagram
