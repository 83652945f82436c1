"""The cells of a table, and how each format keeps them whole."""

from __future__ import annotations

from ropeode.render.markup import Grid, html_page, markdown
from ropeode.render.markup import Heading as Title
from ropeode.render.table_words import RUN_HEADERS, run_cells
from ropeode.study import Row


def test_each_error_stands_under_its_header():
    row = Row(
        stepper="rk4",
        steps_per_frame=16,
        dt=0.0625,
        status="ok",
        diverged_at=None,
        error_final=2e-3,
        error_max=3e-3,
        error_rms=1e-3,
        resolved=True,
        resolution=1e-9,
        round_off=1e-12,
        rhs_evaluations=None,
        seconds=0.5,
    )
    cells = dict(zip(RUN_HEADERS, run_cells(row), strict=True))
    assert cells["max error"] == "3.000e-03"
    assert cells["final error"] == "2.000e-03"
    assert cells["rms error"] == "1.000e-03"
    assert cells["RHS evals"] == "-"


def test_a_cell_does_not_end_at_a_sign_of_the_format():
    blocks = [Title("t"), Grid(["a"], [["x|y<z"]], left=frozenset({0}))]
    assert r"x\|y&lt;z" in markdown(blocks)
    assert "x|y&lt;z" in html_page(blocks)
