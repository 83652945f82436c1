"""What every picture keeps to, whatever it shows."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from unittest.mock import patch

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.text import Text

# In points: lines that are nearer hide one another; and what letters may share.
_NEAR, _SHARED = 1.0, 1.0
_SMALLEST = 6.0


def assert_legible(figure: Figure, runs: Sequence[Axes] | None = None) -> None:
    """No text leaves the canvas, overlaps another or is too small; no line hides another.

    Arguments:
        figure: to be looked at.
        runs: the axes whose lines stand for different runs; by default all.
    """
    canvas, drawn = FigureCanvasAgg(figure), []
    draw = Text.draw

    def kept(text, renderer, *arguments, **named):
        if text.get_visible() and text.get_text().strip():
            drawn.append(text)
        return draw(text, renderer, *arguments, **named)

    with patch.object(Text, "draw", kept):
        canvas.draw()
    point = figure.dpi / 72
    boxes = {text: text.get_window_extent() for text in dict.fromkeys(drawn)}
    for text, box in boxes.items():
        assert min(box.x0, box.y0) >= 0, text
        assert box.x1 <= figure.bbox.width, text
        assert box.y1 <= figure.bbox.height, text
        assert text.get_fontsize() >= _SMALLEST, text
    for (one, first), (other, second) in itertools.combinations(boxes.items(), 2):
        wide = min(first.x1, second.x1) - max(first.x0, second.x0)
        high = min(first.y1, second.y1) - max(first.y0, second.y0)
        assert min(wide, high) <= _SHARED * point, (one, other)
    for axes in figure.axes if runs is None else runs:
        # Dotted lines say of all runs alike that nothing is known of their errors.
        lines = [line for line in axes.lines if line.get_linestyle() not in ("None", ":")]
        for one, other in itertools.combinations(lines, 2):
            assert not _hidden(one, other), (one.get_label(), other.get_label())


def _hidden(one, other) -> bool:
    """Whether two lines with as many points coincide, and look alike."""
    paths = [line.get_transform().transform(line.get_xydata()) for line in (one, other)]
    if one._dash_pattern != other._dash_pattern or len(paths[0]) != len(paths[1]):
        return False
    look = [(line.get_marker(), str(line.get_markevery())) for line in (one, other)]
    if look[0] != look[1] or one.get_zorder() != other.get_zorder():
        return False
    near = np.hypot(*(paths[0] - paths[1]).T) < _NEAR
    box = one.axes.bbox
    near = near[[box.contains(*point) for point in paths[0]]]
    return len(near) > 1 and bool(np.mean(near) > 0.5)
