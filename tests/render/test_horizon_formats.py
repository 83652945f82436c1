"""A horizon study in every format, and its picture."""

from __future__ import annotations

import pytest

from ropeode import Problem, horizon, plot_horizon
from ropeode.render import figure_bytes
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


def test_the_picture_shows_every_run(study):
    assert_legible(plot_horizon(study))
    figure = plot_horizon(study)
    (axes,) = figure.axes
    # The runs and the bound; growth and horizon where there are any.
    more = (study.float64_growth is not None) + (study.reference.horizon is not None)
    assert len(axes.lines) == len(study.runs) + 1 + more
    assert axes.get_yscale() == "log"
    assert figure_bytes(figure, ".png") == figure_bytes(plot_horizon(study), ".png")
