"""Small texts beside points, each where it hides nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

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
) -> list[str]:
    """Write texts beside points; those that would hide something are left out.

    Arguments:
        axes: with their limits set.
        labels: where each point is, its text, and its colour; the first come first.
        taken: points of lines and marks that no text may cover, ``(points, 2)``, in the data's
            coordinates.
        size: of the font, in points.

    Returns:
        The texts that were written.
    """
    figure = axes.get_figure(root=True)
    assert figure is not None
    scale = 72.0 / figure.dpi
    at = axes.transData.transform(np.asarray(taken, float)) * scale
    (left, bottom), (right, top) = axes.bbox.get_points() * scale
    boxes: list[tuple[float, float, float, float]] = []
    written = []
    for x, y, text, colour in labels:
        here = axes.transData.transform((x, y)) * scale
        width, height = _WIDE * size * len(text), _HIGH * size
        for across, up in _SIDES:
            low = here + np.array([across, up]) * _AWAY
            low -= np.array([(1 - across) * width, (1 - up) * height]) / 2
            box = (low[0], low[1], low[0] + width, low[1] + height)
            inside = left <= box[0] and box[2] <= right and bottom <= box[1] and box[3] <= top
            if inside and not _covers(box, at) and not any(_meet(box, other) for other in boxes):
                boxes.append(box)
                written.append(text)
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
    return written


def _covers(box: tuple[float, float, float, float], at: np.ndarray) -> bool:
    left, bottom, right, top = box
    across = (at[:, 0] > left - _MARK) & (at[:, 0] < right + _MARK)
    return bool(np.any(across & (at[:, 1] > bottom - _MARK) & (at[:, 1] < top + _MARK)))


def _meet(a: tuple[float, float, float, float], b: tuple[float, float, float, float]) -> bool:
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]
