"""The figures of the slides: letters that are legible from the back row, and nothing cut off."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import matplotlib
import pytest
from matplotlib.text import Text

from docs.teach.figures import FIGURES, SLIDE, write
from ropeode.errors import InputError
from ropeode.precision import in_float64
from ropeode.progress import silent
from ropeode.render import STYLE
from tests.render.plots.legible import assert_legible

# In points; those of a slide that is 13.33 inches wide are 2.5 times as large.
SMALLEST = 8.0
# Pure numbers and counts.
WITHOUT_UNIT = {"Im z", "Re z,  z = dt λ", "dt ω", "factor per step", "steps per frame"}
CHEAP = "amplification"


@pytest.mark.parametrize(
    "name",
    [name if name == CHEAP else pytest.param(name, marks=pytest.mark.slow) for name in FIGURES],
)
def test_a_slide_is_legible_and_whole(name):
    with matplotlib.rc_context(STYLE):
        figure = in_float64(FIGURES[name])()
        # Some show that lines coincide.
        assert_legible(figure, [])
    assert tuple(figure.get_size_inches()) == SLIDE
    labels = [axis.label for axes in figure.axes for axis in (axes.xaxis, axes.yaxis)]
    for words in map(Text.get_text, labels):
        assert not words or words in WITHOUT_UNIT or "[" in words or "frame" in words, words
    shown = [text for text in figure.findobj(Text) if text.get_visible() and text.get_text()]
    assert min(text.get_fontsize() for text in shown) >= SMALLEST


def test_figures_are_written_whole_and_the_page_names_each(tmp_path):
    for folder in ("a", "b"):
        write(tmp_path / folder, [CHEAP], silent)
    made, again = (tmp_path / folder / f"{CHEAP}.svg" for folder in ("a", "b"))
    assert made.read_bytes() == again.read_bytes()
    # Letters are paths: no font has to be there.
    root = ElementTree.parse(made).getroot()
    assert not list(root.iter("{http://www.w3.org/2000/svg}text"))
    page = (Path(__file__).parents[2] / "docs/teach/index.md").read_text()
    assert all(f"`{name}`" in page for name in FIGURES)
    with pytest.raises(InputError, match=f"figure: 'energie' given; allowed: .*{CHEAP}"):
        write(tmp_path / "c", ["energie"], silent)
    assert {*tmp_path.rglob("*.svg")} == {made, again}
