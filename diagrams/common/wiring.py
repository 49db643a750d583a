"""Joining named systems: a diagram as a list of wires."""

from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any

from diagrams.common.scenario import ScenarioError, nearest
from plants.faults.fault import Fault
from plants.faults.faulty_wire import FaultyWire

PLACES = {
    "force": "tool_wrench.wrench",
    "frame": "*_tracker.*_measured",
    "estimate": "*_estimator.estimate",
    "tension": "*.tension",
    "arm": "joint_commands.set_point",
    "fulcrum": "fulcrum_estimator.estimate",
}
"""Where a kind of fault is, by its first word: at which outputs."""


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


def with_faults(
    builder: Any,
    systems: Mapping[str, Any],
    wires: Iterable[tuple[str, str]],
    faults: Sequence[Fault],
) -> tuple[dict[str, Any], list[tuple[str, str]]]:
    """Adds a `FaultyWire` for every fault and every output that it is at.

    Returns:
        The systems with those, and the wires through them.

    Raises:
        ScenarioError: If nothing of the kind is in the diagram.
    """
    systems, wires = dict(systems), list(wires)
    for index, fault in enumerate(faults):
        place = PLACES[fault.kind.partition("_")[0]]
        outputs = {source for source, _ in wires if fnmatchcase(source, place)}
        if not outputs:
            raise ScenarioError(
                f"faults[{index}].kind={fault.kind!r}: no wire comes from {place} here"
            )
        for source in sorted(outputs):
            owner, _, port = source.partition(".")
            known = getattr(systems[owner], "signals", {})
            signal = known.get(port) or port_of(systems, source, True).size()
            name = f"fault{index}_{owner}_{port}"
            systems[name] = builder.AddNamedSystem(name, FaultyWire(fault, signal))
            through = f"{name}.told"
            wires = [(through if s == source else s, sink) for s, sink in wires]
            wires.append((source, f"{name}.whole"))
    return systems, wires


def finish(
    builder: Any,
    name: str,
    systems: Mapping[str, Any],
    wires: Iterable[tuple[str, str]],
    signals: Mapping[str, str],
    faults: Sequence[Fault] = (),
) -> Any:
    """Connects all wires, exports all signals, and builds the diagram.

    What is exported is as it is, not as faults tell it.

    Raises:
        ValueError: For a wire or a signal to or from nowhere.
    """
    systems, wires = with_faults(builder, systems, wires, faults)
    connect(builder, systems, wires)
    export(builder, systems, signals)
    diagram = builder.Build()
    diagram.set_name(name)
    return diagram
