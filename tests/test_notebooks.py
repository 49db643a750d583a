"""Notebooks are kept clean, and they run."""

import json
from pathlib import Path
import sys
from types import ModuleType

from IPython.core.interactiveshell import InteractiveShell
import matplotlib.pyplot as plt
import pytest

from tests.runs import once

NOTEBOOKS = sorted((Path(__file__).parents[1] / "notebooks").glob("*.ipynb"))
WORKERS = "campaigns"
"""The notebook that starts processes: nbmake runs it, in a kernel of its own."""


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_outputs_are_cleared_and_cells_are_short(path):
    cells = json.loads(path.read_text())["cells"]
    assert cells[0]["cell_type"] == "markdown"
    for cell in cells:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            assert cell["execution_count"] is None
            assert len(cell["source"]) <= 45


@pytest.mark.parametrize(
    "path", [p for p in NOTEBOOKS if p.stem != WORKERS], ids=lambda path: path.stem
)
def test_it_runs(path, monkeypatch):
    """Here and not in a kernel, beside the tests whose runs it shows: see `group`."""
    monkeypatch.chdir(path.parent)
    monkeypatch.setattr("diagrams.common.run.simulate", once)
    monkeypatch.setitem(sys.modules, path.stem, ModuleType(path.stem))
    shell = InteractiveShell(user_module=sys.modules[path.stem])
    for cell in json.loads(path.read_text())["cells"]:
        if cell["cell_type"] == "code":
            shell.run_cell("".join(cell["source"])).raise_error()
    plt.close("all")
