"""A horizon study in every format, and its picture."""

from __future__ import annotations

import csv
import dataclasses
import io
import json
import math
import re

import numpy as np
import pytest

from ropeode.errors import InputError
from ropeode.problems.problem import Problem
from ropeode.references.compute import reference
from ropeode.render.formats import format_horizon, format_table
from ropeode.render.plots.files import figure_bytes
from ropeode.render.plots.horizon import plot_horizon
from ropeode.study.accuracy_table import accuracy_table
from ropeode.study.horizon import horizon
from ropeode.terminal import FORMATS as NAMES
from tests.quartic import HOSTILE
from tests.render.plots.legible import assert_legible
from tests.schemas import assert_conforms

pytestmark = pytest.mark.slow

pytest.importorskip("heyoka", reason="heyoka is an extra")


def away(t, y, args):
    return 2 * y


@pytest.fixture(scope="module")
def study():
    """y' = 2y: errors relative to the largest component, which is the last one."""
    return horizon(Problem(away, [1.0], [0.5 * k for k in range(25)], name=HOSTILE), [12, 24])


@pytest.mark.parametrize("form", NAMES)
def test_every_format_has_the_needs(study, form):
    text = format_horizon(study, form)
    assert text.endswith("\n")
    if form == "csv":
        rows = list(csv.DictReader(io.StringIO(text)))
        assert [float(row["time"]) for row in rows] == study.times.tolist()
        # The time, the bound, each run and the digits lost.
        assert len(rows[0]) == 3 + len(study.runs)
    elif form == "json":
        assert_conforms(text)
        found = json.loads(text)
        assert found["needs"][1]["bits"] == study.needs[1].bits
        assert found["runs"][0]["errors"] == study.runs[0].errors.tolist()
    else:
        assert f"{study.needs[1].digits:.1f}" in text
        assert "<b>" not in text or form in ("text", "markdown")
    if form == "text":
        assert all(len(line) <= 80 for line in text.splitlines())


def test_a_rate_is_told_in_digits(study):
    assert f"{2 / math.log(10):.3f} digits per time unit" in " ".join(format_horizon(study).split())


def test_the_picture_shows_every_run(study):
    assert_legible(plot_horizon(study))
    figure = plot_horizon(study)
    (axes,) = figure.axes
    # The runs and the bound; growth and horizon where there are any.
    more = (study.float64_growth is not None) + (study.reference.horizon is not None)
    assert len(axes.lines) == len(study.runs) + 1 + more
    assert axes.get_yscale() == "log"
    assert figure_bytes(figure, ".png") == figure_bytes(plot_horizon(study), ".png")


def test_a_table_past_the_horizon_of_a_witness():
    """The float64 reference has a horizon of its own beside one in extended precision."""
    problem = Problem(away, [1.0], [0.0, 1.0, 2.0, 3.0])
    known = reference(problem, level="extended")
    *others, independent = known.certificate.witnesses
    cut = {"state": np.where(problem.ts < 2, independent.differences["state"], np.inf)}
    witnesses = (*others, dataclasses.replace(independent, differences=cut))
    known = dataclasses.replace(
        known, certificate=dataclasses.replace(known.certificate, witnesses=witnesses)
    )
    text = " ".join(format_table(accuracy_table(known, ["rk4"], [4])).split())
    assert re.search(r"diffrax Dopri8 agrees to \d\.\de-\d\d before t = 2;", text)


def test_formats_that_do_not_exist(study):
    with pytest.raises(InputError, match="format: 'pdf' given"):
        format_horizon(study, "pdf")
