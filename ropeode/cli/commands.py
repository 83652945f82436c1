"""The commands that report studies, and those that print specs and steppers.

Each imports what it needs when it runs, so that help is instant.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import click

from ropeode.cli.options import OF_RUNS, job_from, predict_option, split_methods, table_options
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
from ropeode.validation import bad_value


def _report(
    study: Callable[[Progress], Any],
    text: Callable[[Any], str],
    out: Path | None,
    plots: Path | None = None,
    pictures: Callable[[Any], Mapping[str, bytes]] = lambda result: {},
) -> None:
    """Run a study, and put out its text; in a folder that is named, its pictures.

    Arguments:
        study: takes what reports its progress.
        text: of its result.
        out: as for `put_out`.
        plots: the folder.
        pictures: of its result, by name.
    """

    def work(progress: Progress) -> tuple[str, Mapping[str, bytes]]:
        result = study(progress)
        return text(result), pictures(result) if plots else {}

    written, drawn = with_progress(work)
    if plots:
        put_pictures(drawn, plots)
    put_out(written, out)


@click.command()
@click.argument("spec", required=False, type=click.Path(path_type=Path))
@table_options()
@format_option
@click.option(
    "--columns",
    metavar="C[,C...]",
    type=CommaSeparated(),
    help="LaTeX: max-error, final-error, rms-error, rhs-evals, seconds. [max-error]",
)
@click.option("--caption", metavar="TEXT", help="LaTeX: the caption, in LaTeX. [the problem]")
@click.option("--label", metavar="NAME", help="LaTeX: what \\ref refers to.")
@predict_option
@out_option("table")
def table(
    spec: Path | None,
    form: str | None,
    out: Path | None,
    columns: list[str] | None,
    caption: str | None,
    label: str | None,
    predict: bool | None,
    **options: str | None,
) -> None:
    """Print the accuracy table of a rope, or of another problem.

    The settings come from the options and from the file SPEC (`ropeode spec` prints one).
    Options override SPEC. Without settings, it prints the table of the default rope.

    In LaTeX the table is one to paste into a paper, with step sizes down and steppers across.
    """
    form = format_for(form, out)
    given = {"columns": columns, "caption": caption, "label": label}
    layout = {name: value for name, value in given.items() if value is not None}
    if layout and form != "latex":
        fix = "add --format latex"
        name, value = next(iter(layout.items()))
        raise bad_value(name, value, "only with the format latex", fix)
    set_up_jax()
    from ropeode.render import LATEX_COLUMNS, check_layout, format_table

    if layout:
        check_layout(columns or LATEX_COLUMNS[:1], label)
    job = job_from(spec, options)
    _report(
        lambda progress: job.run(progress, predict),
        lambda table: format_table(table, form, **layout),
        out,
    )


@click.command()
@click.argument("step")
@table_options(without=("steppers",))
@click.option("--method", metavar="NAME", help="What it is meant to be; see `ropeode steppers`.")
@plots_option("Write pictures of errors and stability to DIR.")
@format_option
@out_option("explanation")
def explain(
    step: str,
    method: str | None,
    plots: Path | None,
    form: str | None,
    out: Path | None,
    **options: str | None,
) -> None:
    """Explain a stepper: what one step does, and what follows.

    STEP is whatever `ropeode check` takes: FILE.py:NAME, runge-kutta:FILE.toml, diffrax:NAME,
    scipy:NAME or the name of a stepper of ropeode. Single steps tell what it is at dt = 0, which
    equation it solves, its order and its local error. From these the error of runs is predicted,
    and set beside the errors of runs on the default rope, or on another problem, as in `ropeode
    table`. Pictures need matplotlib: pip install '.[plots]'.
    """
    form = format_for(form, out)
    if plots:
        from ropeode.render import explanation_pictures
    set_up_jax()
    from ropeode.render import format_explanation
    from ropeode.study import explain_stepper

    job = job_from(None, options)
    chosen = "steps_per_frame" in job.spec.model_fields_set

    _report(
        lambda progress: explain_stepper(
            step,
            job.given,
            method=method,
            steps_per_frame=job.spec.steps_per_frame if chosen else None,
            norm=job.spec.norm,
            progress=progress,
            **job.spec.asked,
        ),
        lambda found: format_explanation(found, form),
        out,
        plots,
        lambda found: explanation_pictures(found),
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

    _report(
        lambda progress: study(job.problem, chosen, **settings, progress=progress),  # type: ignore[arg-type]
        lambda result: format_horizon(result, form),
        out,
        plots,
        lambda result: {"horizon.png": figure_bytes(plot_horizon(result), ".png")},
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

    _report(
        lambda progress: study(
            job.given,
            norm=job.spec.norm,
            **chosen,  # type: ignore[arg-type]
            **settings,  # type: ignore[arg-type]
            progress=progress,
        ),
        lambda result: format_work_precision(result, form),
        out,
        plots,
        lambda result: {
            f"work-precision-{cost.replace('_', '-')}.png": figure_bytes(
                plot_work_precision(result, cost), ".png"
            )
            for cost in COSTS
        },
    )


@click.command()
@click.argument("command", type=click.Choice(["table", "sweep"]), default="table")
@out_option("spec")
def spec(command: str, out: Path | None) -> None:
    """Print a commented spec file for `table` or `sweep`."""
    if command == "sweep":
        from ropeode.sweep import commented_sweep

        put_out(commented_sweep(), out)
    else:
        from ropeode.study import commented_table

        put_out(commented_table(), out)


@click.command()
@click.argument("name", required=False)
def steppers(name: str | None) -> None:
    """List the steppers by family, or show all of one.

    NAME may be that of any stepper: of ropeode, FILE.py:NAME, diffrax:NAME or scipy:NAME.
    """
    from ropeode.render import describe_stepper, list_steppers
    from ropeode.steppers import as_stepper

    click.echo(list_steppers() if name is None else describe_stepper(as_stepper(name)), nl=False)
