"""Films as GIF and MP4 files."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Any

import matplotlib
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, PillowWriter

from ropeode.files import check_suffix, write_whole
from ropeode.progress import Progress, silent
from ropeode.render.plots.film import DPI, film
from ropeode.render.plots.style import STYLE
from ropeode.study.node_paths import NodePaths
from ropeode.validation import bad_value, finite_number, require

FILMS = (".gif", ".mp4")
DEFAULT_FPS = 20.0
# Programs that show a GIF do not go faster.
_MOST_FPS = 50.0


def animate(
    paths: NodePaths,
    out: str | Path,
    *,
    fps: float = DEFAULT_FPS,
    progress: Progress = silent,
) -> Path:
    """Write a film of nodes: the reference, and beside it each run, one picture per sample.

    Arguments:
        paths: from `ropeode.node_paths`.
        out: name of the file, which ends in ``.gif`` or ``.mp4``.
        fps: pictures per second, above 0 and up to 50.
        progress: called with what is being done and the fraction that is done.

    Returns:
        The path that was written to.

    Raises:
        InputError: one line for what cannot be used; nothing is written then.
    """
    path, speed = check_film(out), check_fps(fps)
    write_whole(path, film_bytes(paths, path.suffix, speed, progress))
    return path


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


@matplotlib.rc_context(STYLE)
def film_bytes(paths: NodePaths, suffix: str, fps: float, progress: Progress) -> bytes:
    """A film as the contents of a file.

    Arguments:
        paths: from `ropeode.node_paths`.
        suffix: one of `FILMS`, in small or capital letters.
        fps: pictures per second.
        progress: called with what is being done and the fraction that is done.
    """
    figure, show = film(paths)
    writer, samples = _writer(suffix.lower(), fps), len(paths.times)
    # ffmpeg writes to files only; this one is nowhere near the one that was asked for.
    with tempfile.TemporaryDirectory(prefix="ropeode-") as folder:
        part = Path(folder) / f"film{suffix.lower()}"
        with writer.saving(figure, str(part), dpi=DPI):
            for sample in range(samples):
                progress(f"drawing {samples} pictures", sample / samples)
                show(sample)
                writer.grab_frame()
        progress("done", 1.0)
        return part.read_bytes()


def _writer(suffix: str, fps: float) -> AbstractMovieWriter:
    if suffix == ".gif":
        return PillowWriter(fps=fps)  # type: ignore[arg-type]
    import imageio_ffmpeg

    matplotlib.rcParams["animation.ffmpeg_path"] = imageio_ffmpeg.get_ffmpeg_exe()
    return FFMpegWriter(fps=fps, codec="h264")  # type: ignore[arg-type]
