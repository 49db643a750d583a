"""A diagram as a picture: its blocks, and the wires between them."""

from pathlib import Path
from typing import Any

import pygraphviz

from diagrams.common.scenario import ScenarioError
from systems.common.archive import whole

FILLS = {"systems": "#dbe7f5", "plants": "#f6e3d3"}
"""Colour of a block by the floor of the house it comes from; Drake's own are grey."""


def picture(diagram: Any) -> pygraphviz.AGraph:
    """The graph of a diagram: one node a block, one edge a wire.

    Only connected ports are shown; an edge carries its output port's name. (Drake's
    own picture draws every port there is.)

    Args:
        diagram: The diagram; its subsystems are drawn as single blocks.
    """
    graph = pygraphviz.AGraph(directed=True, rankdir="LR", ranksep=0.7, nodesep=0.25)
    graph.node_attr.update(
        shape="box", style="filled,rounded", fontname="Helvetica", fontsize=12
    )
    graph.edge_attr.update(fontname="Helvetica", fontsize=9, color="#555555")
    for system in diagram.GetSystems():
        kind = type(system)
        fill = FILLS.get(kind.__module__.partition(".")[0], "#eeeeee")
        label = f"{system.get_name()}\n{kind.__name__.partition('_')[0]}"
        graph.add_node(system.get_name(), label=label, fillcolor=fill)
    labels: dict[tuple[str, str], list[str]] = {}
    for (sink, _), (source, index) in diagram.connection_map().items():
        port = source.get_output_port(index).get_name()
        names = labels.setdefault((source.get_name(), sink.get_name()), [])
        if port not in names:
            names.append(port)
    for (tail, head), ports in labels.items():
        graph.add_edge(tail, head, label="\n".join(sorted(ports)))
    return graph


def draw_block_diagram(diagram: Any, path: Path) -> None:
    """Draws a Drake diagram's blocks and wires into an SVG or PNG file.

    Args:
        diagram: The diagram.
        path: Ends in `.svg` or `.png`.

    Raises:
        ScenarioError: If the file's ending is another, or it cannot be written.
    """
    if path.suffix not in (".svg", ".png"):
        raise ScenarioError(f"{path}: expected a file that ends in .svg or .png")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole(path) as draft:
            draft.write_bytes(picture(diagram).draw(format=path.suffix[1:], prog="dot"))
    except OSError as error:
        raise ScenarioError(f"cannot write {path}: {error.strerror}") from error
