"""The notebook of the documentation, run from top to bottom."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path

import pytest

import ropeode
from tests.results import kinds

pytest.importorskip("heyoka", reason="heyoka is an extra")

NOTEBOOK = Path(__file__).parents[1] / "docs/howto/notebook.ipynb"
MOST_SECONDS = 300


@pytest.fixture(scope="module")
def client(tmp_path_factory):
    """The notebook, executed."""
    import nbformat  # Slow to import, as is the client.
    from nbclient import NotebookClient

    notebook = nbformat.read(NOTEBOOK, as_version=4)
    # The kernel is this interpreter, whatever is registered on the machine.
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    where = {"metadata": {"path": str(tmp_path_factory.mktemp("notebook"))}}
    client = NotebookClient(notebook, timeout=MOST_SECONDS, kernel_name="python3", resources=where)
    client.execute(env=environment)
    return client


def outputs(client, *kinds):
    """Each output of these types, and the last line of its cell."""
    return [
        (cell.source.splitlines()[-1], output)
        for cell in client.nb.cells
        if cell.cell_type == "code"
        for output in cell.outputs
        if output.output_type in kinds
    ]


@pytest.mark.slow
def test_every_result_shows_itself(client):
    """One of every type, which a new one cannot forget; and every plot is a picture."""
    shown, plots = set(), set()
    for last, output in outputs(client, "execute_result"):
        if last.startswith("plot_"):
            assert "image/png" in output.data, last
            plots.add(last.split("(")[0])
            continue
        line = output.data["text/plain"]
        assert len(line) <= 300, last
        shown.add(re.match(r"<(\w+): ", line)[1])
        page = output.data["text/html"]
        assert page.strip(), last
        if last == "animate(paths)":
            assert page.startswith('<img alt="film" src="data:image/gif;base64,')
        if last == "table":
            assert page.count("<table") == 2
    assert plots == {name for name in ropeode.__all__ if name.startswith("plot_")}
    # Classes exist once they are imported.
    assert all(getattr(ropeode, name) for name in ropeode.__all__)
    assert shown == {each.__name__ for each in kinds()} | {"Film"}


@pytest.mark.slow
def test_wrong_input_is_one_sentence(client):
    ((last, output),) = outputs(client, "error")
    assert last == "Rope(num_nodes=-1)"
    (line,) = output.traceback
    assert line.startswith("InputError: num_nodes: -1 given; ")
