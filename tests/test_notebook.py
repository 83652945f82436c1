"""The notebook of the documentation, run from top to bottom."""

from __future__ import annotations

import os
import re
import sys
from pathlib import Path
from typing import NamedTuple

import nbformat
import pytest
from nbclient import NotebookClient

import ropeode
from tests.results import kinds

pytest.importorskip("heyoka", reason="heyoka is an extra")

NOTEBOOK = Path(__file__).parents[1] / "docs/howto/notebook.ipynb"
MOST_SECONDS = 300
# A quick machine, and programs that are compiled already, would show none.
SOON = "import ropeode.bars; ropeode.bars.AFTER_S = 0.05"


class Executed(NamedTuple):
    """What each cell shows in the end, by its last line, and every bar that was drawn."""

    outputs: dict[str, list]
    bars: list[str]


class Client(NotebookClient):
    """One that keeps bars, which are not there any more in the end."""

    bars: tuple[str, ...] = ()

    def process_message(self, msg, cell, cell_index):
        if msg["msg_type"] in ("display_data", "update_display_data"):
            self.bars += (msg["content"]["data"]["text/html"],)
        return super().process_message(msg, cell, cell_index)


@pytest.fixture(scope="module")
def executed(tmp_path_factory):
    notebook = nbformat.read(NOTEBOOK, as_version=4)
    notebook.cells.insert(0, nbformat.v4.new_code_cell(SOON))
    # The kernel is this interpreter, whatever is registered on the machine.
    environment = {**os.environ, "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}"}
    where = {"metadata": {"path": str(tmp_path_factory.mktemp("notebook"))}}
    client = Client(notebook, timeout=MOST_SECONDS, kernel_name="python3", resources=where)
    client.execute(env=environment)
    cells = [cell for cell in notebook.cells[1:] if cell.cell_type == "code"]
    outputs = {cell.source.splitlines()[-1]: cell.outputs for cell in cells}
    assert len(outputs) == len(cells)
    return Executed(outputs, list(client.bars))


@pytest.fixture
def results(executed):
    """The value of each cell, without its bars."""
    values = {
        last: [each for each in outputs if each.output_type != "display_data"]
        for last, outputs in executed.outputs.items()
    }
    assert all(len(each) == 1 for each in values.values())
    return {last: each[0] for last, each in values.items() if each[0].output_type != "error"}


@pytest.mark.slow
def test_every_result_shows_itself(results):
    """One of every type; which a new one cannot forget."""
    shown = set()
    for last, output in results.items():
        line = output.data["text/plain"]
        if last.startswith("plot_"):
            assert "image/png" in output.data, last
            continue
        assert len(line) <= 300, last
        shown.add(re.match(r"<(\w+): ", line)[1])
        assert output.data["text/html"].strip(), last
    # Classes exist once they are imported.
    assert all(getattr(ropeode, name) for name in ropeode.__all__)
    assert shown == {each.__name__ for each in kinds()} | {"Film"}


@pytest.mark.slow
def test_every_plot_is_a_picture_and_a_film_moves(results):
    plots = {last.split("(")[0] for last, shown in results.items() if "image/png" in shown.data}
    assert plots == {name for name in ropeode.__all__ if name.startswith("plot_")}
    film = results["animate(paths)"].data["text/html"]
    assert film.startswith('<img alt="film" src="data:image/gif;base64,')
    assert results["table"].data["text/html"].count("<table") == 2


@pytest.mark.slow
def test_bars_come_and_go(executed):
    drawn = [page for page in executed.bars if page]
    assert len(drawn) > 10
    assert all(page.startswith("<progress ") for page in drawn)
    # The reference is the first work that takes long.
    assert "reference: diffrax" in drawn[0] or "reference: diffrax" in drawn[1]
    left = [
        output.data
        for outputs in executed.outputs.values()
        for output in outputs
        if output.output_type == "display_data"
    ]
    assert left
    assert all(data == {"text/plain": "", "text/html": ""} for data in left)


@pytest.mark.slow
def test_wrong_input_is_one_sentence(executed):
    (output,) = executed.outputs["Rope(num_nodes=-1)"]
    (line,) = output.traceback
    assert line.startswith("InputError: num_nodes: -1 given; ")
