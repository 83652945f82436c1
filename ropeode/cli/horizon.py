"""The command that reports when float64 references lose their digits."""

from __future__ import annotations

from pathlib import Path

import click

from ropeode.cli.job import job_from
from ropeode.cli.options import table_options
from ropeode.files import check_suffix, write_whole
from ropeode.progress import Progress
from ropeode.terminal.lists import CommaSeparated
from ropeode.terminal.output import format_for, format_option, out_option, put_out
from ropeode.terminal.running import not_interrupted, set_up_jax, with_progress
from ropeode.validation import bad_value


@click.command()
@click.argument("spec", required=False, type=click.Path(path_type=Path))
@table_options
@click.option(
    "--spans",
    metavar="T[,T...]",
    type=CommaSeparated(),
    help="Spans whose required precision is reported. [100,300,1000]",
)
@click.option("--plot", metavar="FILE", help="Draw all errors over time: .png, .pdf or .svg.")
@format_option
@out_option("report")
def horizon(
    spec: Path | None,
    spans: list[str] | None,
    plot: str | None,
    form: str | None,
    out: Path | None,
    **options: str | None,
) -> None:
    """Report when float64 references lose their digits.

    Compares the float64 solvers with a solution in extended precision: how many digits are left
    at which time, how fast differences grow (with the Lyapunov exponent), and how many digits
    of working precision a span of time needs. Try `ropeode horizon --damping 0 --frames 200
    --time-limit 300`, a rope that swings for ever.

    Takes the problem from SPEC and the options, as `ropeode table` does. Steppers are ignored;
    --digits is the number of digits that must be left at the end. Needs heyoka (pip install
    '.[extended]'), and matplotlib for --plot (pip install '.[plots]').
    """
    form = format_for(form, out)
    picture = None
    if plot:
        from ropeode.render.plots.files import FIGURES, figure_bytes
        from ropeode.render.plots.horizon import plot_horizon

        picture = check_suffix("plot", plot, FIGURES)
    set_up_jax()
    from ropeode.render.formats import format_horizon
    from ropeode.study.horizon import SPANS
    from ropeode.study.horizon import horizon as study

    if options["level"] not in (None, "extended"):
        allowed = "extended, which is the default here"
        raise bad_value("level", options["level"], allowed, "leave it out")
    job = job_from(spec, {**options, "level": "extended"})
    settings = {name: value for name, value in job.spec.asked.items() if name != "level"}
    chosen = SPANS if spans is None else spans

    def work(progress: Progress) -> tuple[str, bytes | None]:
        result = study(job.problem, chosen, **settings, progress=progress)  # type: ignore[arg-type]
        drawn = figure_bytes(plot_horizon(result), picture.suffix) if picture else None
        return format_horizon(result, form), drawn

    text, drawn = with_progress(work)
    if picture and drawn:
        with not_interrupted():
            write_whole(picture, drawn)
        click.echo(f"wrote {picture}", err=True)
    put_out(text, out)
