"""The plot in README shows the orders that README says it shows."""

from __future__ import annotations

import pytest

from docs.studies.three_verlets import VERLETS, plot_three_verlets, three_verlets


@pytest.mark.slow
def test_the_order_plot_names_each_line_with_its_order():
    (axes,) = plot_three_verlets(three_verlets()).axes
    words = [text.get_text() for text in axes.texts]
    assert [each.partition(": ")[0] for each in words] == list(VERLETS.values())
    assert [each.partition(": ")[2] for each in words] == [
        "order 1.00 [0.990, 1.010]",
        "order 2.00 [1.989, 2.010]",
        "does not converge",
    ]
