"""What a figure shows, read back from matplotlib's own artists."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.path import Path


def look(line: Line2D) -> tuple[str, Any]:
    """Colour and marker; arrows have the same form wherever they are held."""
    marker: Any = line.get_marker()
    if isinstance(marker, Path):
        form = np.asarray(marker.vertices) - np.mean(marker.vertices, axis=0)
        marker = tuple(np.round(form, 6).ravel())
    return to_hex(line.get_color()).upper(), marker


def legend_of(figure: Figure) -> dict[str, tuple[str, Any]]:
    """How what each label of the legends stands for looks."""
    return {
        text.get_text(): look(handle)
        for legend in figure.legends
        for handle, text in zip(legend.legend_handles, legend.get_texts(), strict=True)
        if isinstance(handle, Line2D)
    }
