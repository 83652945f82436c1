"""The command that reports when float64 references lose their digits."""

from __future__ import annotations

from pathlib import Path

import click

from ropeode.cli.job import job_from
from ropeode.cli.options import OF_RUNS, table_options
from ropeode.progress import Progress
from ropeode.terminal import (
    CommaSeparated,
    format_for,
    format_option,
    out_option,
    plots_option,
    put_out,
    put_pictures,
    set_up_jax,
    with_progress,
)


@click.command()
@click.argument("spec", required=False, type=click.Path(path_type=Path))
@table_options(without=(*OF_RUNS, "level"))
@click.option(
    "--spans",
    metavar="T[,T...]",
    type=CommaSeparated(),
    help="Spans whose required precision is reported. [100,300,1000]",
)
@plots_option("Write a picture of all errors over time to DIR.")
@format_option
@out_option("report")
def horizon(
    spec: Path | None,
    spans: list[str] | None,
    plots: Path | None,
    form: str | None,
    out: Path | None,
    **options: str | None,
) -> None:
    """Report when float64 references lose their digits.

    Compares the float64 solvers with a solution in extended precision: how many digits are left
    at which time, how fast differences grow (with the Lyapunov exponent), and how many digits
    of working precision a span of time needs. Try `ropeode horizon --damping 0 --frames 200
    --time-limit 300`, a rope that swings for ever.

    Takes the problem from SPEC and the options, as `ropeode table` does. Steppers in SPEC are
    ignored; --digits is the number of digits that must be left at the end. Needs heyoka (pip
    install '.[extended]'), and matplotlib for --plots (pip install '.[plots]').
    """
    form = format_for(form, out)
    if plots:
        from ropeode.render import figure_bytes, plot_horizon

    set_up_jax()
    from ropeode.render import format_horizon
    from ropeode.study import HORIZON_SPANS
    from ropeode.study.horizon import horizon as study

    job = job_from(spec, {**options, "level": "extended"})
    settings = {name: value for name, value in job.spec.asked.items() if name != "level"}
    chosen = HORIZON_SPANS if spans is None else spans

    def work(progress: Progress) -> tuple[str, dict[str, bytes]]:
        result = study(job.problem, chosen, **settings, progress=progress)  # type: ignore[arg-type]
        pictures = {"horizon.png": figure_bytes(plot_horizon(result), ".png")} if plots else {}
        return format_horizon(result, form), pictures

    text, pictures = with_progress(work)
    if plots:
        put_pictures(pictures, plots)
    put_out(text, out)
