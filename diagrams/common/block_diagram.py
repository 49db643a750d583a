"""A diagram as a picture."""

from pathlib import Path
from typing import Any

import pygraphviz

from diagrams.common.scenario import ScenarioError


def draw_block_diagram(diagram: Any, path: Path) -> None:
    """Draws a Drake diagram's blocks and wires into an SVG or PNG file.

    Args:
        diagram: The diagram; its subsystems are drawn as single blocks.
        path: Ends in `.svg` or `.png`.

    Raises:
        ScenarioError: If the file's ending is another, or it cannot be written.
    """
    if path.suffix not in (".svg", ".png"):
        raise ScenarioError(f"{path}: expected a file that ends in .svg or .png")
    graph = pygraphviz.AGraph(string=diagram.GetGraphvizString(max_depth=1))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(graph.draw(format=path.suffix[1:], prog="dot"))
    except OSError as error:
        raise ScenarioError(f"cannot write {path}: {error.strerror}") from error
