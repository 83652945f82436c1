"""The command that compares methods by what their errors cost."""

from __future__ import annotations

from pathlib import Path

import click

from ropeode.cli.job import job_from
from ropeode.cli.options import split_methods, table_options
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


@click.command("work-precision")
@click.argument("spec", required=False, type=click.Path(path_type=Path))
@click.option(
    "--methods",
    metavar="M[,M...]",
    help="Steppers (`ropeode steppers`), diffrax:NAME and scipy:NAME (adaptive; with constant "
    "steps diffrax:NAME:constant), FILE.py:NAME. [eight that people use]",
)
@click.option(
    "--steps",
    "steps_per_frame",
    metavar="N[,N...]",
    help="Steps per frame, of methods with constant steps. [4,16,...,16384]",
)
@click.option(
    "--rtol",
    metavar="R[,R...]",
    type=CommaSeparated(),
    help="Relative tolerances, of adaptive methods. [1e-3,1e-4,...,1e-12]",
)
@click.option("--run-limit", metavar="S", help="Seconds that one run may take. [5]")
@click.option("--rounds", metavar="N", help="How often each run is timed. [5]")
@table_options(without=("steppers", "steps_per_frame", "rtol"))
@plots_option("Write a picture for each kind of cost to DIR.")
@format_option
@out_option("report")
def work_precision(
    spec: Path | None,
    methods: str | None,
    rtol: list[str] | None,
    run_limit: str | None,
    rounds: str | None,
    plots: Path | None,
    form: str | None,
    out: Path | None,
    **options: str | None,
) -> None:
    """Report what errors cost with which method.

    Runs steppers with many step sizes and adaptive solvers with many tolerances, and holds each
    run against a certified reference: its error, its evaluations of the right-hand side, its steps
    and its seconds. Says what an error of 1e-2, 1e-4, 1e-6 and 1e-9 costs with each method, and
    which one is the best.

    Takes the problem from SPEC and the options, as `ropeode table` does. Steppers and
    tolerances in SPEC are ignored. Try `ropeode work-precision --problem kepler`, and
    `--out work.html` for pictures whose points say their values. --plots needs matplotlib (pip
    install '.[plots]').
    """
    form = format_for(form, out)
    if plots:
        from ropeode.render import figure_bytes, plot_work_precision

    set_up_jax()
    from ropeode.render import format_work_precision
    from ropeode.study import COSTS
    from ropeode.study.work_precision import work_precision as study

    job = job_from(spec, options)
    settings = {name: value for name, value in job.spec.asked.items() if name != "rtol"}
    given = {
        "methods": None if methods is None else split_methods(methods),
        "rtol": rtol,
        "run_limit": run_limit,
        "rounds": rounds,
    }
    chosen = {name: value for name, value in given.items() if value is not None}
    if "steps_per_frame" in job.spec.model_fields_set:
        chosen["steps_per_frame"] = job.spec.steps_per_frame

    def work(progress: Progress) -> tuple[str, dict[str, bytes]]:
        result = study(job.given, norm=job.spec.norm, **chosen, **settings, progress=progress)  # type: ignore[arg-type]
        pictures = {
            f"work-precision-{cost.replace('_', '-')}.png": figure_bytes(
                plot_work_precision(result, cost), ".png"
            )
            for cost in (COSTS if plots else ())
        }
        return format_work_precision(result, form), pictures

    text, pictures = with_progress(work)
    if plots:
        put_pictures(pictures, plots)
    put_out(text, out)
