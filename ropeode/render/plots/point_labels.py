"""Small texts beside points, each where it hides nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.transforms import Bbox

# In points of 1/72 inch: a letter's width and height over the font's size, the way to the text, and
# half of a mark.
_WIDE, _HIGH, _AWAY, _MARK = 0.6, 1.0, 5.0, 2.0
# Where a text may stand: right, left, above, below, and the corners between.
_SIDES = ((1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1))
_ALIGN = {-1: "right", 0: "center", 1: "left"}
_UPRIGHT = {-1: "top", 0: "center", 1: "bottom"}


def place_labels(
    axes: Axes,
    labels: Sequence[tuple[float, float, str, str]],
    taken: np.ndarray,
    size: float,
) -> None:
    """Write texts beside points; those that would hide something are left out.

    Arguments:
        axes: with their limits set.
        labels: where each point is, its text, and its colour; the first come first.
        taken: points of lines and marks that no text may cover, ``(points, 2)``, in the data's
            coordinates.
        size: of the font, in points.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None
    scale = 72.0 / figure.dpi
    at = axes.transData.transform(np.asarray(taken, float)) * scale
    frame = Bbox(axes.bbox.get_points() * scale)
    boxes: list[Bbox] = []
    for x, y, text, colour in labels:
        here = axes.transData.transform((x, y)) * scale
        width, height = _WIDE * size * len(text), _HIGH * size
        for across, up in _SIDES:
            low = here + np.array([across, up]) * _AWAY
            low -= np.array([(1 - across) * width, (1 - up) * height]) / 2
            box = Bbox.from_bounds(low[0], low[1], width, height)
            inside = np.all(frame.min <= box.min) and np.all(box.max <= frame.max)
            hides = box.padded(_MARK).count_contains(at) or box.count_overlaps(boxes)
            if inside and not hides:
                boxes.append(box)
                axes.annotate(
                    text,
                    (x, y),
                    (across * _AWAY, up * _AWAY),
                    textcoords="offset points",
                    ha=_ALIGN[across],
                    va=_UPRIGHT[up],
                    fontsize=size,
                    color=colour,
                    annotation_clip=False,
                )
                break
