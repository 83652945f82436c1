"""What no file of `plots/test_pictures.py` shows of the picture of a work-precision study."""

from __future__ import annotations

import dataclasses
import re
from xml.etree import ElementTree

import pytest

from ropeode import plot_work_precision
from ropeode.errors import InputError
from ropeode.render import format_work_precision
from ropeode.study import COSTS
from tests.render.made_up import work_of, work_precision, work_row
from tests.render.plots.studies import work


def test_points_say_their_values_where_the_pointer_rests():
    """As a browser reads the page."""
    study = work()
    page = format_work_precision(study, "html")
    space = "{http://www.w3.org/2000/svg}"
    for cost, picture in zip(COSTS, re.findall(r"<svg.*?</svg>", page, re.DOTALL), strict=True):
        groups = ElementTree.fromstring(picture).iter(f"{space}g")
        titles = (each.find(f"{space}title") for each in groups)
        said = [title.text or "" for title in titles if title is not None]
        paid = [row for row in study.rows if getattr(row, cost) is not None]
        for row, words in zip(paid, said, strict=True):
            assert words.startswith(f"{row.method}, ")
            assert f"steps: {row.steps}" in words
        (certified,) = (text for text in said if text.startswith("rk4, 64 steps/frame"))
        assert "max error: 1.000e-05" in certified
        assert "evaluations: 256" in certified
        (unresolved,) = (text for text in said if text.startswith("scipy:DOP853, rtol 1e-6"))
        for name in ("max", "final", "rms"):
            assert f"{name} error: < 2.5e-12" in unresolved
        assert "energy error: < 1.0e-09" in unresolved
        assert any("energy error: not finite" in text for text in said)


@pytest.mark.parametrize("calls", [[7], [30, 70], [100], [90, 2000]])
def test_the_cost_axis_says_two_numbers(calls):
    rows = [work_row("some", 1e-2 / each, 1e-3 / each, each) for each in calls]
    figure = plot_work_precision(work_of(*rows), "rhs_evaluations")
    figure.draw_without_rendering()
    (axes,) = figure.axes
    low, high = axes.get_xlim()
    labels = axes.xaxis.get_ticklabels()
    shown = [x for x, label in zip(axes.get_xticks(), labels, strict=True) if label.get_text()]
    assert sum(low <= x <= high for x in shown) >= 2


def test_bad_names():
    study = work_precision()
    without = dataclasses.replace(study, energy_resolution=None)
    for words, given in (
        ("cost: 'time' given", (study, "time")),
        ("did you mean 'error_max'", (study, "steps", "error_maximum")),
        ("has no energy", (without, "steps", "energy_error")),
    ):
        with pytest.raises(InputError, match=words):
            plot_work_precision(*given)
