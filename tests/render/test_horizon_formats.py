"""A horizon study in every format, and its picture."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest

from ropeode import Problem, accuracy_table, horizon, plot_horizon, reference
from ropeode.errors import InputError
from ropeode.render import figure_bytes, format_horizon, format_table
from tests.quartic import HOSTILE
from tests.render.plots.legible import assert_legible

pytestmark = pytest.mark.slow

pytest.importorskip("heyoka", reason="heyoka is an extra")


def away(t, y, args):
    return 2 * y


@pytest.fixture(scope="module")
def study():
    """y' = 2y: errors relative to the largest component, which is the last one."""
    return horizon(Problem(away, [1.0], [0.5 * k for k in range(25)], name=HOSTILE), [12, 24])


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
