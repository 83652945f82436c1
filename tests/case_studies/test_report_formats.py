"""The report in every format, and its pictures."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from ropeode.case_studies import (
    Report,
    RoundingEffect,
    ThresholdEffect,
    draw_report,
    format_report,
    plot_contact_sheets,
    plot_report_figure,
)
from ropeode.progress import silent
from tests.render.plots.legible import assert_legible

pytestmark = pytest.mark.slow

FIGURES = (1, 4, 8, 31, 36, 37)


@pytest.fixture(scope="module")
def some(report) -> Report:
    """Some figures, with effects of thresholds and rounding among them."""
    threshold = ThresholdEffect(8, "words", "speed", 0.002, "holds until frame 12")
    rounding = RoundingEffect(36, "words", "settled_at", None, 251, "holds")
    return dataclasses.replace(
        report,
        figures=tuple(each for each in report.figures if each.figure.figure in FIGURES),
        sensitive_to_thresholds=(*report.sensitive_to_thresholds, threshold),
        sensitive_to_rounding=(*report.sensitive_to_rounding, rounding),
    )


def test_the_summary_counts(some):
    verdicts = [each.verdict for each in some.figures]
    text = " ".join(format_report(some).split())
    fails = verdicts.count("does not hold")
    counts = f"{verdicts.count('holds')} hold, {fails} do{'es' * (fails == 1)} not"
    assert f"Of the claims of {len(FIGURES)} figures, {counts}" in text


def test_pictures(some):
    made = draw_report(some, silent)
    assert set(made) == {f"figure-{n:02}.png" for n in FIGURES} | {"contact-sheet-1.png"}
    assert all(contents.startswith(b"\x89PNG") for contents in made.values())

    diverged = next(each for each in some.figures if each.figure.figure == 8)
    shapes, speeds, *_ = plot_report_figure(diverged).axes
    before = diverged.motion.diverged_at
    trace = shapes.get_lines()[0].get_xydata()
    np.testing.assert_array_equal(trace, diverged.readings[0].trajectory.positions[:before, -1])
    assert [line.get_xdata()[0] for line in speeds.get_lines() if line.get_linestyle() == ":"] == [
        before
    ]
    for each in some.figures:
        figure = plot_report_figure(each)
        # The rope at several times may be in one place.
        assert_legible(figure, [axes for axes in figure.axes if axes.get_yscale() == "log"])
        assert str(each.figure.figure) in figure.get_suptitle()
        for axes in figure.axes:
            if axes.get_label() != "<colorbar>":
                assert "[" in axes.get_xlabel()
                assert "[" in axes.get_ylabel()
    (sheet,) = plot_contact_sheets(some)
    assert_legible(sheet, [])
    assert len(sheet.axes) == len(FIGURES)
