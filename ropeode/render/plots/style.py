"""Colours, markers, sizes and files of pictures: readable in print and by the colour-blind."""

from __future__ import annotations

import io
import textwrap
from collections.abc import Sequence
from typing import Any

import matplotlib
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

# Matplotlib types its keys, in new versions only.
STYLE: Any = {
    "font.size": 9.0,
    "axes.titlesize": 9.0,
    "axes.labelsize": 9.0,
    "figure.titlesize": 10.0,
    "legend.fontsize": 8.0,
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "lines.linewidth": 1.2,
    "lines.markersize": 5.0,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "0.9",
    "grid.linewidth": 0.6,
    "legend.frameon": False,
    "legend.handlelength": 2.2,
    # The same figure makes the same file.
    "svg.hashsalt": "ropeode",
}
# Suffix: the time of writing in its metadata, left out so that a figure makes the same file.
FIGURES: dict[str, dict[str, None]] = {
    ".png": {},
    ".pdf": {"CreationDate": None},
    ".svg": {"Date": None},
}
FIGURE_WIDTH = 6.5
DPI = 200
_SCREEN_DPI = 110
_LETTERS_PER_INCH = 13
# Of two legends side by side, and the height of one of their lines in inches.
_LETTERS_BESIDE, _LEGEND_LINE = 90, 0.17

# Source: Okabe and Ito, Color Universal Design (2008); without the yellow, which is too pale
# for lines on white.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
# One more than there are colours, so that the pairs repeat late.
MARKERS = ("o", "s", "D", "^", "v", "p", "<", ">")

# What theory predicts.
PREDICTED = "predicted: the leading term"
PREDICTION: Any = {"linestyle": (0, (5, 2.5)), "linewidth": 0.9, "alpha": 0.75}

BAND = "0.85"
BAND_EDGE = "0.55"


def stepper_style(index: int) -> tuple[str, str]:
    """Colour and marker of the stepper with this index."""
    return COLOURS[index % len(COLOURS)], MARKERS[index % len(MARKERS)]


class Picture(Figure):
    """A figure that a notebook shows where it is the value of a cell, without any backend."""

    def _repr_png_(self) -> bytes:
        contents = io.BytesIO()
        with matplotlib.rc_context(STYLE):
            self.savefig(contents, format="png", dpi=_SCREEN_DPI)
        return contents.getvalue()


@matplotlib.rc_context(STYLE)
def figure_bytes(figure: Figure, suffix: str) -> bytes:
    """A figure as the contents of a file.

    Arguments:
        figure: from one of the plotting functions.
        suffix: one of `FIGURES`, in small or capital letters.
    """
    suffix = suffix.lower()
    contents = io.BytesIO()
    figure.savefig(contents, format=suffix[1:], metadata=FIGURES[suffix])
    return contents.getvalue()


def new_figure(title: str, more: str, height: float) -> Figure:
    """An empty figure, 6.5 inches wide, without a window or a backend.

    Arguments:
        title: above all of it.
        more: below the title.
        height: in inches.
    """
    figure = Picture(figsize=(FIGURE_WIDTH, height), dpi=DPI, layout="constrained")
    # A dollar sign in a problem's name begins no formula.
    figure.suptitle(wrapped(title, more, width=FIGURE_WIDTH), parse_math=False)
    return figure


def new_grid(
    figure: Figure, rows: int, columns: int, count: int, labels: tuple[str, str]
) -> list[Axes]:
    """So many axes of the same limits, row by row.

    Arguments:
        figure: gets the axes.
        rows: of axes.
        columns: of axes.
        count: of axes; those at the end of the last row may be missing.
        labels: of the horizontal axes at the bottom, and of the upright ones, at the left.
    """
    grid = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False).ravel()
    for axes in grid[count:]:
        axes.remove()
    for axes in grid[max(0, count - columns) : count]:
        axes.tick_params(labelbottom=True)
        axes.set_xlabel(labels[0])
    if rows == 1:
        grid[0].set_ylabel(labels[1])
    else:
        # Once for all: it may be longer than a row is high.
        figure.supylabel(labels[1], fontsize=matplotlib.rcParams["axes.labelsize"])
    return list(grid[:count])


def draw_legends(
    figure: Figure, height: float, left: Sequence[Artist], right: Sequence[Artist]
) -> None:
    """A legend of two parts below the axes: side by side where there is room, else as one column.

    Arguments:
        figure: gets the room that they need.
        height: of the figure without legends, in inches.
        left: handles with labels, such as the steppers.
        right: others, such as what the marks mean.
    """

    def lines(handles: Sequence[Artist]) -> list[str]:
        return "\n".join(str(each.get_label()) for each in handles).splitlines()

    labels = lines(left), lines(right)
    beside = sum(max(map(len, each)) for each in labels) <= _LETTERS_BESIDE
    columns: list[list[Artist]] = [list(left), list(right)]
    if beside:
        longest = max(map(len, columns))
        for column in columns:
            empty = longest - len(column)
            column += [Line2D([], [], linestyle="none", label="") for _ in range(empty)]
    figure.legend(handles=[*columns[0], *columns[1]], loc="outside lower left", ncols=1 + beside)
    many = list(map(len, labels))
    make_room(figure, height, max(many) if beside else sum(many))


def make_room(figure: Figure, height: float, lines: int) -> None:
    """Let a legend of so many lines stand below what is `height` inches high."""
    below = _LEGEND_LINE * lines + 0.1
    figure.set_figheight(height + below)
    if label := figure.get_supylabel():
        middle = (below + height / 2) / (height + below)
        figure.supylabel(label, y=middle, fontsize=matplotlib.rcParams["axes.labelsize"])


def wrapped(*paragraphs: str, width: float) -> str:
    """The lines of a title, for a figure so many inches wide."""
    letters = round(_LETTERS_PER_INCH * width)
    return "\n".join(textwrap.fill(each, letters) for each in paragraphs if each)
