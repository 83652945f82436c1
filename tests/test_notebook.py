"""The notebook of the documentation, run from top to bottom."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import nbformat
import pytest
from nbclient import NotebookClient

NOTEBOOK = Path(__file__).parents[1] / "docs" / "examples" / "notebook.ipynb"
MOST_SECONDS = 300


@pytest.fixture(scope="module")
def outputs():
    """What each cell shows, by its last line."""
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    # The kernel is this interpreter, whatever is registered on the machine.
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    client = NotebookClient(notebook, timeout=MOST_SECONDS, kernel_name="python3")
    client.execute(env=environment)
    cells = (cell for cell in notebook.cells if cell.cell_type == "code")
    return {cell.source.splitlines()[-1]: cell.outputs for cell in cells}


@pytest.mark.slow
def test_every_result_shows_itself(outputs):
    for last, shown in outputs.items():
        (output,) = shown
        if output.output_type == "error":
            continue
        data = output.data
        if last.startswith("plot_"):
            assert "image/png" in data, last
        else:
            assert "text/html" in data, last
            assert data["text/plain"].startswith("<"), last
            assert len(data["text/plain"]) <= 300, last


@pytest.mark.slow
def test_wrong_input_is_one_sentence(outputs):
    (output,) = outputs["Rope(num_nodes=-1)"]
    assert output.output_type == "error"
    (line,) = output.traceback
    assert line.startswith("InputError: num_nodes: -1 given; ")


@pytest.mark.slow
def test_tables_are_tables(outputs):
    (table,) = outputs["table"]
    assert table.data["text/html"].count("<table>") == 2
    (report,) = outputs["check_stepper(lagged, expected_order=2, quick=True)"]
    assert "WRONG" in report.data["text/html"]
