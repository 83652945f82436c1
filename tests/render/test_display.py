"""Results in the REPL and in notebooks: a line, and a page."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import ropeode
from ropeode.analysis.errors import error_series
from ropeode.analysis.motion import Thresholds
from ropeode.analysis.order import ObservedOrder
from ropeode.checking.report import CheckReport, Claims, Finding
from ropeode.display import Displayed
from ropeode.errors import InputError, UserCodeError, call_user_code, full_tracebacks
from ropeode.problems.ensemble import Ensemble
from ropeode.problems.rope import Rope
from ropeode.render.plots.convergence import plot_convergence
from ropeode.simulation import simulate, simulate_chunks
from ropeode.steppers.base import System
from ropeode.steppers.phase import Phase

# Short enough as they are.
PLAIN = {ObservedOrder, Phase, System, Thresholds}
LONGEST = 200


@pytest.fixture(scope="module")
def results(study):
    table = study("convergence", "one step size")
    problem = table.problem
    ensemble = Ensemble.of([problem, problem])
    run = simulate(problem, "rk4", 16)
    return [
        problem,
        ensemble,
        table.reference,
        table.reference.certificate,
        run,
        next(iter(simulate_chunks(ensemble, "rk4", 16))),
        error_series(run, table.reference),
        table,
        study("error", "one step size"),
        study("error", "one step size").curves[0],
        study("energy", "one step size"),
        CheckReport(
            "steps.py:euler", Claims(order=1), (Finding("order-damped", "fail", "order 0"),)
        ),
    ]


def test_public_results_are_displayed():
    """Which a new one cannot forget."""
    classes = (getattr(ropeode, name) for name in ropeode.__all__)
    results = {each for each in classes if dataclasses.is_dataclass(each)} - PLAIN
    silent = {
        each.__name__
        for each in results
        if not issubclass(each, Displayed) or each.__repr__ is not Displayed.__repr__
    }
    assert not silent


def test_a_result_is_a_line_and_a_page(results):
    for each in results:
        line = repr(each)
        assert line.startswith(f"<{type(each).__name__}: ")
        assert "\n" not in line
        assert len(line) <= LONGEST, line
        for page in (each._repr_html_(), each._repr_markdown_()):
            assert page.strip()
            # Of a whole page these would change the notebook around it.
            assert "<style" not in page
            assert "<body" not in page


def test_a_report_shows_its_marks_in_colour(results):
    assert 'font-weight: bold">WRONG</td>' in results[-1]._repr_html_()


def test_a_bound_over_time_is_a_line_of_blocks():
    reference = ropeode.reference(Rope(num_nodes=4).problem(frames=3))
    assert any(block in reference._repr_html_() for block in "▁▂▃▄▅▆▇█")


def test_a_figure_is_a_picture(study):
    image = plot_convergence(study("convergence", "one step size"))._repr_png_()
    assert image.startswith(b"\x89PNG")


def wrong(x):
    return x + unknown  # type: ignore[name-defined]  # noqa: F821


def test_an_exception_says_what_its_reader_can_mend():
    with pytest.raises(InputError) as raised:
        Rope(num_nodes=-1)
    (text,) = raised.value._render_traceback_()
    assert text.startswith("InputError: num_nodes: ")
    with pytest.raises(UserCodeError) as raised:
        call_user_code("step", wrong, np.ones(1))
    text = "\n".join(raised.value._render_traceback_())
    assert "return x + unknown" in text
    assert "call_user_code" not in text
    full_tracebacks()
    try:
        assert "call_user_code" in "\n".join(raised.value._render_traceback_())
    finally:
        full_tracebacks(False)
