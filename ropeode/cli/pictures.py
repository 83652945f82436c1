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

# The names in ropeode.render.plots.registry; a test holds the two together. Listed here because
# the help text must not import what makes plots.
TYPES = ("convergence", "error", "energy")
# What a map of a sweep is asked for, and what it is where it is not.
_OF_SWEEP = {"x": "damping", "y": "steps_per_frame", "value": "observed_order"}


@click.command()
@click.argument("spec", required=False, type=click.Path(path_type=Path))
@table_options
@click.option("--type", "name", type=click.Choice(TYPES), help=f"Of plot. [{TYPES[0]}]")
@click.option("--x", metavar="INPUT", help="Of a sweep: what is drawn to the right. [damping]")
@click.option("--y", metavar="INPUT", help="Likewise, what upwards. [steps_per_frame]")
@click.option("--value", metavar="COLUMN", help="Likewise, what as colour. [observed_order]")
@click.option(
    "--where", metavar="INPUT=VALUE", multiple=True, help="Likewise, of which rows. More than once."
)
@click.option("--out", metavar="FILE", help="A .png, .pdf or .svg file. [TYPE.png or sweep.png]")
def plot(
    spec: Path | None, name: str | None, out: str | None, where: tuple[str, ...], **options: Any
) -> None:
    """Plot errors or energies of a rope or of another problem, or a map of a sweep.

    Takes its settings from SPEC and the options as `ropeode table` does. Types: error against
    step size with the observed orders (convergence), error against time (error), energy
    against time (energy). If SPEC is the folder of a sweep, it is a map of one of its columns
    over two of its inputs, with a panel for each stepper. Needs matplotlib: pip install
    '.[plots]'.
    """
    of_sweep = {key: options.pop(key) for key in _OF_SWEEP}
    if spec is not None and spec.is_dir():
        given = {**options, "type": name}
        _refuse(given, "none with the folder of a sweep, which is run already")
        _plot_sweep(spec, out, where, **{k: v or _OF_SWEEP[k] for k, v in of_sweep.items()})
        return
    _refuse({**of_sweep, "where": where}, "it with the folder of a sweep only")
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
    """Make a film of a rope, or of another problem that moves in a plane or in space.

    Takes its settings from SPEC and the options as `ropeode table` does: the steppers are
    shown beside the reference, all at the first of the steps per frame. Where none are given,
    that is semi-implicit-euler at 64. Needs matplotlib: pip install '.[plots]', and for
    MP4 pip install '.[video]'.
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
