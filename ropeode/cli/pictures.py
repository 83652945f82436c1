"""The commands that make pictures. Each imports what it needs when it runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click

from ropeode.cli.options import dt_option, job_from, table_options
from ropeode.errors import InputError
from ropeode.files import check_suffix, write_whole
from ropeode.progress import Progress, part_of
from ropeode.terminal import not_interrupted, out_option_with, set_up_jax, with_progress
from ropeode.validation import bad_value, complaint

# The names in ropeode.render.plots.registry. They are listed here too because the help text must
# not import what draws; a test compares the two lists.
TYPES = ("convergence", "error", "energy")
# What energies are drawn of by default: long enough to see which steppers keep them.
_CONSERVED = {"frames": "300", "rope_damping": "0"}
# How many frames the default rope takes to swing past the vertical, in a film.
_PAST_THE_VERTICAL = "40"
# What of a film's time goes into its runs; the rest, into its pictures.
_COMPUTING = 0.5
# The options of a map of a sweep, with their defaults.
_OF_SWEEP = {"x": "damping", "y": "steps_per_frame", "value": "observed_order"}


def _picture_options(function: Callable) -> Callable:
    """Add what plots and films show: a spec with options, or trajectories in files."""
    for option in (
        dt_option,
        click.option("--trajectories", is_flag=True, help="Draw trajectories from each FILE."),
        table_options(),
        click.argument(
            "files", metavar="[SPEC | FILE...]", nargs=-1, type=click.Path(path_type=Path)
        ),
    ):
        function = option(function)
    return function


@click.command()
@_picture_options
@click.option("--type", "name", type=click.Choice(TYPES), help=f"What to plot. [{TYPES[0]}]")
@click.option("--x", metavar="INPUT", help="Sweep: the horizontal axis. [damping]")
@click.option("--y", metavar="INPUT", help="Sweep: the vertical axis. [steps_per_frame]")
@click.option("--value", metavar="COLUMN", help="Sweep: what the colours show. [observed_order]")
@click.option(
    "--where", metavar="INPUT=VALUE", multiple=True, help="Sweep: which rows to draw; repeatable."
)
@out_option_with("A .png, .pdf or .svg file. [TYPE.png or sweep.png]")
def plot(
    files: tuple[Path, ...],
    trajectories: bool,
    dt: list[str] | None,
    name: str | None,
    out: str | None,
    where: tuple[str, ...],
    **options: Any,
) -> None:
    """Plot the errors or energies of steppers, or a map of a sweep.

    The types are: error against step size with observed orders (convergence), error against
    time (error), and the energy error against time (energy). The settings come from SPEC and
    the options, as in `ropeode table`; without them, energies are those of 300 frames of a rope
    without damping.

    If SPEC is the folder of a sweep, the plot is a map: the colours show one column over two
    inputs, with a panel for each stepper.

    With --trajectories, each FILE is a trajectory that some program wrote, as `ropeode grade`
    reads it. --problem SPEC or --reference names the problem of the files.

    Needs matplotlib: pip install '.[plots]'.
    """
    of_sweep = {key: options.pop(key) for key in _OF_SWEEP}
    if not trajectories and len(files) == 1 and files[0].is_dir():
        allowed = "only with a spec: the sweep in this folder has its own settings"
        _refuse({**options, "type": name, "dt": dt}, allowed)
        _plot_sweep(files[0], out, where, **{k: v or _OF_SWEEP[k] for k, v in of_sweep.items()})
        return
    _refuse({**of_sweep, "where": where}, "only with the folder of a sweep")
    name = name or TYPES[0]
    from ropeode.render import FIGURES, figure_bytes

    path = check_suffix("out", out or f"{name}.png", FIGURES)
    _check_sources(files, trajectories, dt, options)
    set_up_jax()
    from ropeode.render import PLOTS

    if name == "energy" and not files and options["reference"] is None and not options["problem"]:
        options.update({key: options[key] or text for key, text in _CONSERVED.items()})
    job = job_from(None if trajectories else next(iter(files), None), options)
    kind = PLOTS[name]

    def work(progress: Progress) -> bytes:
        named = {"norm": job.spec.norm, **job.spec.asked, "progress": progress}
        if trajectories:
            result = kind.of_trajectories(files, job.given, dt, **named)
        else:
            if "steps_per_frame" in job.spec.model_fields_set:
                named["steps_per_frame"] = job.spec.steps_per_frame
            result = kind.study(job.given, job.spec.steppers, **named)
        return figure_bytes(kind.draw(result), path.suffix)

    _write(path, with_progress(work))


def _check_sources(
    files: tuple[Path, ...], trajectories: bool, dt: list[str] | None, options: Mapping[str, Any]
) -> None:
    """Raises:
    InputError: arguments and options do not fit together.
    """
    if not trajectories:
        _refuse({"dt": dt}, "only with --trajectories")
        if len(files) > 1:
            allowed, fix = "one spec file", "to draw trajectories, add --trajectories"
            raise bad_value("spec", " ".join(map(str, files)), allowed, fix)
        return
    chosen = {"steppers": options["steppers"], "steps": options["steps_per_frame"]}
    _refuse(chosen, "only without --trajectories: the files hold runs already")
    if not files:
        allowed = "trajectories, one file for each step size"
        raise bad_value("files", "none", allowed, "name them: 32.csv 64.csv 128.csv")
    if options["problem"] is None and options["reference"] is None:
        allowed, fix = "the problem of the trajectories", "give --problem SPEC"
        raise bad_value("problem", "none", allowed, fix)


def _refuse(options: Mapping[str, Any], allowed: str) -> None:
    """Raises:
    InputError: one of the options was given.
    """
    fix = "leave it out"
    faults = [
        complaint(name, ",".join(value) if isinstance(value, list) else value, allowed, fix)
        for name, value in options.items()
        if value
    ]
    if faults:
        raise InputError(faults)


def _plot_sweep(
    folder: Path, out: str | None, where: tuple[str, ...], x: str, y: str, value: str
) -> None:
    from ropeode.render import FIGURES, figure_bytes, plot_sweep

    path = check_suffix("out", out or "sweep.png", FIGURES)
    wanted = {}
    for each in where:
        name, equals, wanted[name] = each.partition("=")
        if not equals:
            raise bad_value("where", each, "INPUT=VALUE", "for example stepper=rk4")
    _write(path, figure_bytes(plot_sweep(folder, x, y, value, wanted), path.suffix))


@click.command()
@_picture_options
@click.option("--fps", metavar="N", default="20", help="Pictures per second, up to 50. [20]")
@out_option_with("A .gif or .mp4 file. [rope.gif]")
def animate(
    files: tuple[Path, ...],
    trajectories: bool,
    dt: list[str] | None,
    fps: str,
    out: str | None,
    **options: str | None,
) -> None:
    """Make a film of a rope, or of another problem that moves.

    The problem must move in a plane or in space. The film shows the steppers beside the
    reference, all with the first number of --steps. The default is explicit-euler,
    semi-implicit-euler and rk4 with 64 steps per frame; the default rope swings for 40 frames.
    Errors are magnified where they are too small to be seen. The settings come from SPEC and the
    options, as in `ropeode table`.

    With --trajectories, each FILE is a trajectory that some program wrote, as `ropeode grade`
    reads it. --problem SPEC or --reference names the problem of the files.

    Needs matplotlib: pip install '.[plots]'. MP4 also needs ffmpeg: pip install '.[video]'.
    """
    from ropeode.render import animate, check_film, check_fps, film_bytes

    path, speed = check_film(out or "rope.gif"), check_fps(fps)
    _check_sources(files, trajectories, dt, options)
    set_up_jax()
    from ropeode.checking import trajectory_paths
    from ropeode.study import PATH_STEPPERS, PATH_STEPS_PER_FRAME
    from ropeode.study.node_paths import node_paths

    if not files and options["reference"] is None and not options["problem"]:
        options["frames"] = options["frames"] or _PAST_THE_VERTICAL
    job = job_from(None if trajectories else next(iter(files), None), options)
    steps = PATH_STEPS_PER_FRAME
    if "steps_per_frame" in job.spec.model_fields_set:
        steps = job.spec.steps_per_frame[0]

    def work(progress: Progress) -> bytes:
        computing = part_of(progress, 0.0, _COMPUTING)
        named = {"norm": job.spec.norm, **job.spec.asked, "progress": computing}
        if trajectories:
            paths = trajectory_paths(files, job.given, dt, **named)
        else:
            paths = node_paths(job.given, job.spec.steppers or PATH_STEPPERS, steps, **named)
        drawing = part_of(progress, _COMPUTING, 1.0)
        return film_bytes(animate(paths, fps=speed), path.suffix, progress=drawing)

    _write(path, with_progress(work))


def _write(path: Path, contents: bytes) -> None:
    with not_interrupted():
        write_whole(path, contents)
    click.echo(f"wrote {path}")
