"""Pictures as bytes, and the names of the files that they may go to."""

from __future__ import annotations

import io
from collections.abc import Iterable
from pathlib import Path

import matplotlib
from matplotlib.figure import Figure

from ropeode.files import check_writable
from ropeode.render.plots.style import STYLE
from ropeode.validation import bad_value

# Suffix: the time of writing in its metadata, left out so that a figure makes the same file.
FIGURES: dict[str, dict[str, None]] = {
    ".png": {},
    ".pdf": {"CreationDate": None},
    ".svg": {"Date": None},
}


def check_picture(path: str | Path, suffixes: Iterable[str], name: str = "out") -> Path:
    """A path that a picture can be written to, checked before anything is computed.

    Arguments:
        path: of the file, which may exist.
        suffixes: that are allowed, as in ``.png``.
        name: of the option that names it.

    Raises:
        InputError: it has another suffix, or cannot be written to.
    """
    allowed = list(suffixes)
    if Path(path).suffix.lower() not in allowed:
        ends = f"a file name that ends in {', '.join(allowed)}"
        fix = f"for example {Path(path).stem or 'picture'}{allowed[0]}"
        raise bad_value(name, str(path), ends, fix)
    return check_writable(name, path)


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
