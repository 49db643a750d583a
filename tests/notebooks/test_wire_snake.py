"""The snake's notebook runs from top to bottom, and is stored without outputs."""

from pathlib import Path

from nbclient import NotebookClient
import nbformat

NOTEBOOK = Path(__file__).parents[2] / "notebooks" / "wire_snake.ipynb"


def test_notebook_runs():
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells)
    root = NOTEBOOK.parents[1]
    NotebookClient(
        notebook, timeout=120, resources={"metadata": {"path": str(root)}}
    ).execute()
    texts = [
        output["text"]
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        if output["output_type"] == "stream"
    ]
    assert any("nearest reachable position" in text for text in texts)
    assert any("R/(2d)" in text for text in texts)
