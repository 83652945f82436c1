"""What a figure shows, read back from matplotlib's own artists."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import PathCollection, QuadMesh
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Rectangle
from matplotlib.path import Path
from matplotlib.ticker import FixedLocator


def look(line: Line2D) -> tuple[str, Any]:
    """Colour and marker; arrows have the same form wherever they are held."""
    marker: Any = line.get_marker()
    if isinstance(marker, Path):
        form = np.asarray(marker.vertices) - np.mean(marker.vertices, axis=0)
        marker = tuple(np.round(form, 6).ravel())
    return to_hex(line.get_color()).upper(), marker


def described(figure: Figure) -> str:
    """All that a figure shows, but for where its texts stand and how its axes are laid out."""
    lines = [figure.get_suptitle()]
    for axes in figure.axes:
        lines += ["", *_described(axes)]
    for legend in figure.legends:
        lines += ["", "legend"]
        for handle, text in zip(legend.legend_handles, legend.get_texts(), strict=True):
            if text.get_text():
                lines += [f"  {_look(handle)}: {text.get_text()}"]
    return "\n".join(each.replace("\n", " / ") for each in lines) + "\n"


def _described(axes: Axes) -> Iterator[str]:
    if axes.get_label() == "<colorbar>":
        low, high = axes.get_ylim()
        # Those of other bars are matplotlib's choice.
        chosen = isinstance(axes.yaxis.get_major_locator(), FixedLocator)
        ticks = [text.get_text() for text in axes.get_yticklabels() if chosen]
        scale = axes.get_yscale()
        yield f"colours: {axes.get_ylabel()}, {scale}, {low:.3g} to {high:.3g} {' '.join(ticks)}"
        return
    titles = (axes.get_title(loc=where) for where in ("left", "center"))
    yield f"axes {' '.join(filter(None, titles))}".rstrip()
    for name, axis in (("x", axes.xaxis), ("y", axes.yaxis)):
        low, high = axis.get_view_interval()
        yield f"  {name}: {axis.get_label_text()}, {axis.get_scale()}, {low:.3g} to {high:.3g}"
    for line in axes.lines:
        yield f"  {_look(line)}: {_points(line.get_xydata())}"
    for patch in axes.patches:
        # Where triangles stand depends on the layout.
        if isinstance(patch, Rectangle):
            sides = f"{patch.get_width():.4g} x {patch.get_height():.4g}"
            yield f"  {_look(patch)}: {sides} from {_points([patch.get_xy()])}"
    for each in axes.collections:
        if isinstance(each, QuadMesh):
            yield f"  cells: {_points(each.get_coordinates()[[0, -1], [0, -1]])}"
            yield from (f"    {_numbers(row)}" for row in each.get_array())
        elif isinstance(each, PathCollection):
            values = [] if each.get_array() is None else each.get_array()
            yield f"  points: {_points(each.get_offsets())} {_numbers(values)}".rstrip()
        elif each.get_paths():
            yield f"  band: {_points(each.get_paths()[0].vertices)}"
    if texts := [text.get_text() for text in axes.texts]:
        yield f"  texts: {' | '.join(texts)}"


def _look(artist: Any) -> str:
    if not isinstance(artist, Line2D):
        face = artist.get_facecolor()
        colour = to_hex(face) if len(np.shape(face)) == 1 else ""
        return f"{type(artist).__name__} {colour} {artist.get_hatch() or ''}".rstrip()
    colour, marker = look(artist)
    if isinstance(marker, tuple):
        marker = "arrow " + ("down" if np.argmin(marker[1::2]) else "up")
    hollow = "hollow " if artist.get_markerfacecolor() in ("none", "white") else ""
    return f"{colour} {artist.get_linestyle()} {hollow}{marker}"


def _points(places: Any) -> str:
    return " ".join(f"{x:.4g},{y:.4g}" for x, y in np.ma.filled(np.ma.array(places), np.nan))


def _numbers(values: Any) -> str:
    return " ".join("-" if value is np.ma.masked else f"{value:.4g}" for value in values)
