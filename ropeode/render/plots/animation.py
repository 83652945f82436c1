"""Films as GIF and MP4 files, and in notebooks."""

from __future__ import annotations

import base64
import contextlib
import dataclasses
import functools
import io
import itertools
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.font_manager import findfont
from matplotlib.text import Text
from PIL import Image, ImageDraw, ImageFont

from ropeode.equality import ByContent
from ropeode.files import check_suffix, write_whole
from ropeode.progress import Progress, bar, shows_progress
from ropeode.render.plots.film import DPI, film
from ropeode.render.plots.style import COLOURS, STYLE
from ropeode.render.results import line
from ropeode.study import NodePaths
from ropeode.validation import bad_value, check_kind, finite_number, require

FILMS = (".gif", ".mp4")
DEFAULT_FPS = 20.0
# Programs that show a GIF do not go faster.
_MOST_FPS = 50.0
# Of each colour, from white on, for the soft edges of lines. Pillow takes colours for the same that
# are 8 apart, so more would mistake a shade for white.
_SHADES = 16
# Pillow's letters for matplotlib's alignments.
_ANCHORS = {"top": "a", "baseline": "s"}


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Film(ByContent):
    """A film, which a notebook shows where it is the value of a cell.

    Arguments:
        paths: what it shows.
        fps: pictures per second.

    Examples:
        >>> from ropeode import Rope, animate, node_paths
        >>> paths = node_paths(Rope(num_nodes=4).problem(frames=3), ["rk4"], steps_per_frame=16)
        >>> film = animate(paths, fps=10)
        >>> len(film.paths.times) / film.fps
        2.5
    """

    paths: NodePaths
    fps: float

    @shows_progress
    def save(self, out: str | Path, *, progress: Progress = bar) -> Path:
        """Write it to a file.

        Arguments:
            out: name of the file, which ends in ``.gif`` or ``.mp4``.
            progress: called with what is being done and the fraction that is done.

        Returns:
            The path that was written to.

        Raises:
            InputError: the file cannot be written, or a package is missing.

        Examples:
            >>> from ropeode import Rope, animate, node_paths
            >>> paths = node_paths(Rope(num_nodes=4).problem(frames=3), ["rk4"], steps_per_frame=16)
            >>> str(animate(paths).save("rope.gif"))
            'rope.gif'
        """
        path = check_film(out)
        write_whole(path, film_bytes(self, path.suffix, progress=progress))
        return path

    def __repr__(self) -> str:
        samples = len(self.paths.times)
        seconds = f"{samples} pictures, {samples / self.fps:.3g} seconds"
        return f"<Film: {line(self.paths)}; {seconds}>"

    def _repr_html_(self) -> str:
        """What a notebook shows."""
        contents = base64.b64encode(film_bytes(self, ".gif")).decode()
        return f'<img alt="film" src="data:image/gif;base64,{contents}">'


def animate(paths: NodePaths, *, fps: float = DEFAULT_FPS) -> Film:
    """A film of nodes: the reference, and beside it each run, one picture per sample.

    Arguments:
        paths: from `ropeode.node_paths`.
        fps: pictures per second, above 0 and up to 50.

    Returns:
        The film, which a notebook shows; `Film.save` writes it to a file.

    Raises:
        InputError: `fps` is out of range.

    Examples:
        >>> from ropeode import Rope, animate, node_paths
        >>> paths = node_paths(Rope(num_nodes=4).problem(frames=3), ["rk4"], steps_per_frame=16)
        >>> animate(paths, fps=10)
        <Film: rope, 4 nodes, damping 0.01, 3 frames; 25 samples of 1 run (rk4);
        25 pictures, 2.5 seconds>
    """
    fps = check_fps(fps)
    check_kind("paths", paths, NodePaths, "node_paths")
    return Film(paths, fps)


def check_film(out: str | Path) -> Path:
    """A path that a film can be written to, checked before anything is computed.

    Raises:
        InputError: it has another suffix, cannot be written to, or a package is missing.
    """
    path = check_suffix("out", out, FILMS)
    if path.suffix.lower() == ".mp4":
        require("imageio_ffmpeg", "video", "films in MP4")
    return path


def check_fps(rate: Any) -> float:
    """Pictures per second.

    Raises:
        InputError: it is not a number above 0 and up to 50.
    """
    try:
        fps = finite_number(rate)
        if not 0 < fps <= _MOST_FPS:
            raise ValueError("it is out of range")
        return fps
    except ValueError as error:
        allowed = f"a number above 0 and up to {_MOST_FPS:g} ({error})"
        fix = f"for example {DEFAULT_FPS:g}"
        raise bad_value("fps", rate, allowed, fix) from None


@shows_progress
def film_bytes(film: Film, suffix: str, *, progress: Progress = bar) -> bytes:
    """A film as the contents of a file.

    Arguments:
        film: from `animate`.
        suffix: one of `FILMS`, in small or capital letters.
        progress: called with what is being done and the fraction that is done.
    """
    encode = gif if suffix.lower() == ".gif" else _mp4
    contents = encode(_pictures(film.paths, progress), film.fps)
    progress("done", 1.0)
    return contents


def _pictures(paths: NodePaths, progress: Progress) -> Iterator[Image.Image]:
    """One picture after the other.

    What does not move is drawn once, and words by Pillow, which is ten times as fast.
    """
    with matplotlib.rc_context(STYLE):
        figure, show = film(paths)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        still, size = canvas.copy_from_bbox(figure.bbox), canvas.get_width_height()
        moving = figure.findobj(lambda artist: artist.get_animated())
        words = [each for each in moving if isinstance(each, Text)]
        lines = [each for each in moving if each not in words]
        samples = len(paths.times)
        for sample in range(samples):
            progress(f"drawing {samples} pictures", sample / samples)
            show(sample)
            canvas.restore_region(still)
            for each in lines:
                each.draw(canvas.get_renderer())
            drawn = Image.frombytes("RGB", size, canvas.buffer_rgba(), "raw", "RGBX")
            for each in words:
                _write(drawn, each)
            yield drawn


def _write(picture: Image.Image, words: Text) -> None:
    """Write words where matplotlib has them, in the same letters."""
    x, y = words.get_transform().transform(words.get_position())
    anchor = words.get_horizontalalignment()[0] + _ANCHORS[words.get_verticalalignment()]
    dots = float(words.get_fontsize()) * DPI / 72
    fill = tuple(int(255 * part) for part in to_rgb(words.get_color()))
    ImageDraw.Draw(picture).text(
        (x, picture.height - y),
        words.get_text(),
        fill=fill,
        font=_font(findfont(words.get_fontproperties()), dots),
        anchor=anchor,
    )


@functools.cache
def _font(file: str, dots: float) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(file, dots, layout_engine=ImageFont.Layout.BASIC)


def gif(pictures: Iterator[Image.Image], fps: float) -> bytes:
    """Pictures on white, in the colours of `style`, as the contents of a GIF that repeats.

    Arguments:
        pictures: all of one size.
        fps: pictures per second.
    """
    palette = Image.new("P", (1, 1))
    palette.putpalette(_palette())
    images = (each.quantize(palette=palette, dither=Image.Dither.NONE) for each in pictures)
    contents = io.BytesIO()
    next(images).save(
        contents, "GIF", save_all=True, append_images=images, duration=1000 / fps, loop=0
    )
    return contents.getvalue()


def _palette() -> list[int]:
    """One for all pictures: the colours of the lines, each in shades."""
    full = np.array([to_rgb(colour) for colour in COLOURS])
    shares = np.linspace(0, 1, _SHADES)[:, None, None]
    return np.rint(255 * (1 - shares * (1 - full))).astype(int).ravel().tolist()


def _mp4(pictures: Iterator[Image.Image], fps: float) -> bytes:
    import imageio_ffmpeg

    first = next(pictures)
    # The codec halves the resolution of colours.
    width, height = (size // 2 * 2 for size in first.size)
    given = ["-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", f"{fps}"]
    made = ["-vcodec", "libx264", "-pix_fmt", "yuv420p", "-movflags", "+faststart"]
    # ffmpeg writes to files only; this one is nowhere near the one that was asked for.
    with tempfile.TemporaryDirectory(prefix="ropeode-") as folder:
        part = Path(folder) / "film.mp4"
        # Not by imageio_ffmpeg.write_frames, which forks: that hangs after JAX has started.
        command = [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", *given, "-i", "-", *made, part]
        pipe = subprocess.PIPE
        with subprocess.Popen(command, stdin=pipe, stderr=pipe) as ffmpeg:
            assert ffmpeg.stdin is not None
            assert ffmpeg.stderr is not None
            # Where it has ended, it says why.
            with contextlib.suppress(BrokenPipeError), ffmpeg.stdin:
                for each in itertools.chain([first], pictures):
                    ffmpeg.stdin.write(each.crop((0, 0, width, height)).tobytes())
            said = ffmpeg.stderr.read().decode(errors="replace").split("\n")[0]
        if ffmpeg.returncode:
            allowed = f"a folder for temporary files that ffmpeg can write a film to ({said})"
            raise bad_value("out", folder, allowed, "make room there, or set TMPDIR to another")
        return part.read_bytes()
