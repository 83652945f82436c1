"""The two pictures of README, and what README says that they show."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from docs.studies.falling_ropes import falling_ropes, film_of_ropes
from docs.studies.three_verlets import VERLETS, plot_three_verlets, three_verlets

IMAGES = Path(__file__).parents[3] / "docs/images"


def test_the_film_is_small_and_plays_again_and_again():
    path = IMAGES / "falling-ropes.gif"
    assert path.stat().st_size < 1.5e6
    with Image.open(path) as film:
        assert film.n_frames > 100
        assert film.info["loop"] == 0


@pytest.mark.slow
def test_the_film_shows_the_runs_beside_one_reference():
    ropes = falling_ropes()
    euler, coarse, fine = (paths.paths[0].errors[-1] for _, paths in ropes)
    assert euler > 1e10
    assert fine > coarse > 400, "sixteen times as many steps make it worse"
    first, *others = (paths.reference for _, paths in ropes)
    for each in others:
        assert np.array_equal(each.times, first.times)
        assert np.max(np.abs(each.positions - first.positions)) <= 2 * first.bound()[-1]
    pictures = list(film_of_ropes(ropes))
    assert len(pictures) > len(first.times)
    assert pictures[0].tobytes() != pictures[-1].tobytes() == pictures[-2].tobytes()


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
