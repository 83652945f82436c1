"""The commands that make pictures. Each imports what it needs when it runs."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import click

from ropeode.cli.job import job_from
from ropeode.cli.options import table_options
from ropeode.cli.running import interruptible, not_interrupted, set_up_jax, show_progress
from ropeode.errors import InputError
from ropeode.files import write_whole
from ropeode.validation import complaint

# The names in ropeode.render.plots.registry. They are listed here too because the help text must
# not import what draws; a test compares the two lists.
TYPES = ("convergence", "error", "energy")
# The options of a map of a sweep, with their defaults.
_OF_SWEEP = {"x": "damping", "y": "steps_per_frame", "value": "observed_order"}


@click.command()
@click.argument("spec", required=False, type=click.Path(path_type=Path))
@table_options
@click.option("--type", "name", type=click.Choice(TYPES), help=f"What to plot. [{TYPES[0]}]")
@click.option("--x", metavar="INPUT", help="Sweep: the horizontal axis. [damping]")
@click.option("--y", metavar="INPUT", help="Sweep: the vertical axis. [steps_per_frame]")
@click.option("--value", metavar="COLUMN", help="Sweep: what the colours show. [observed_order]")
@click.option(
    "--where", metavar="INPUT=VALUE", multiple=True, help="Sweep: which rows to draw; repeatable."
)
@click.option("--out", metavar="FILE", help="A .png, .pdf or .svg file. [TYPE.png or sweep.png]")
def plot(
    spec: Path | None, name: str | None, out: str | None, where: tuple[str, ...], **options: Any
) -> None:
    """Plot the errors or energies of steppers, or a map of a sweep.

    The types are: error against step size with observed orders (convergence), error against
    time (error), and energy against time (energy). The settings come from SPEC and the
    options, as in `ropeode table`.

    If SPEC is the folder of a sweep, the plot is a map: the colours show one column over two
    inputs, with a panel for each stepper.

    Needs matplotlib: pip install '.[plots]'.
    """
    of_sweep = {key: options.pop(key) for key in _OF_SWEEP}
    if spec is not None and spec.is_dir():
        given = {**options, "type": name}
        _refuse(given, "only with a spec: the sweep in this folder has its own settings")
        _plot_sweep(spec, out, where, **{k: v or _OF_SWEEP[k] for k, v in of_sweep.items()})
        return
    _refuse({**of_sweep, "where": where}, "only with the folder of a sweep")
    name = name or TYPES[0]
    from ropeode.render.plots.files import FIGURES, check_picture, figure_bytes

    path = check_picture(out or f"{name}.png", FIGURES)
    set_up_jax()
    from ropeode.render.plots.registry import PLOTS

    job = job_from(spec, options)

    with show_progress() as progress:

        def work() -> bytes:
            result = PLOTS[name].study(
                job.given,
                job.spec.steppers,
                job.spec.steps_per_frame,
                norm=job.spec.norm,
                **job.spec.asked,
                progress=progress,
            )
            return figure_bytes(PLOTS[name].draw(result), path.suffix)

        contents = interruptible(work)
    _write(path, contents)


def _refuse(options: Mapping[str, Any], allowed: str) -> None:
    """Raises:
    InputError: one of the options was given.
    """
    faults = [
        complaint(name, value, allowed, "leave it out") for name, value in options.items() if value
    ]
    if faults:
        raise InputError(faults)


def _plot_sweep(
    folder: Path, out: str | None, where: tuple[str, ...], x: str, y: str, value: str
) -> None:
    from ropeode.render.plots.files import FIGURES, check_picture, figure_bytes
    from ropeode.render.plots.sweep_map import plot_sweep

    path = check_picture(out or "sweep.png", FIGURES)
    wanted = {}
    for each in where:
        name, equals, wanted[name] = each.partition("=")
        if not equals:
            raise InputError(complaint("where", each, "INPUT=VALUE", "as in stepper=rk4"))
    _write(path, figure_bytes(plot_sweep(folder, x, y, value, wanted), path.suffix))


@click.command()
@click.argument("spec", required=False, type=click.Path(path_type=Path))
@table_options
@click.option("--fps", metavar="N", default="20", help="Pictures per second, up to 50. [20]")
@click.option("--out", metavar="FILE", help="A .gif or .mp4 file. [rope.gif]")
def animate(spec: Path | None, fps: str, out: str | None, **options: str | None) -> None:
    """Make a film of a rope, or of another problem that moves.

    The problem must move in a plane or in space. The film shows the steppers beside the
    reference, all with the first number of --steps. The default is semi-implicit-euler with 64
    steps per frame. The settings come from SPEC and the options, as in `ropeode table`.

    Needs matplotlib: pip install '.[plots]'. MP4 also needs ffmpeg: pip install '.[video]'.
    """
    from ropeode.render.plots.animation import check_film, check_fps, film_bytes

    path, speed = check_film(out or "rope.gif"), check_fps(fps)
    set_up_jax()
    from ropeode.study.node_paths import DEFAULT_STEPPERS, DEFAULT_STEPS_PER_FRAME, node_paths

    job = job_from(spec, options)
    steps_given = "steps_per_frame" in job.spec.model_fields_set

    with show_progress() as progress:

        def work() -> bytes:
            paths = node_paths(
                job.given,
                job.spec.steppers or DEFAULT_STEPPERS,
                job.spec.steps_per_frame[0] if steps_given else DEFAULT_STEPS_PER_FRAME,
                norm=job.spec.norm,
                **job.spec.asked,
                progress=progress,
            )
            return film_bytes(paths, path.suffix, speed, progress)

        contents = interruptible(work)
    _write(path, contents)


def _write(path: Path, contents: bytes) -> None:
    with not_interrupted():
        write_whole(path, contents)
    click.echo(f"wrote {path}")
