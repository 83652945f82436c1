"""Pictures as bytes, and the suffixes of the files that they may go to."""

from __future__ import annotations

import io

import matplotlib
from matplotlib.figure import Figure

from ropeode.render.plots.style import STYLE

# Suffix: the time of writing in its metadata, left out so that a figure makes the same file.
FIGURES: dict[str, dict[str, None]] = {
    ".png": {},
    ".pdf": {"CreationDate": None},
    ".svg": {"Date": None},
}


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
