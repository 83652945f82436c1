"""The command that explains a stepper."""

from __future__ import annotations

from pathlib import Path

import click

from ropeode.cli.job import job_from
from ropeode.cli.options import table_options
from ropeode.progress import Progress
from ropeode.terminal import (
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

    def work(progress: Progress) -> tuple[str, dict[str, bytes]]:
        found = explain_stepper(
            step,
            job.given,
            method=method,
            steps_per_frame=job.spec.steps_per_frame if chosen else None,
            norm=job.spec.norm,
            progress=progress,
            **job.spec.asked,
        )
        pictures = explanation_pictures(found) if plots else {}
        return format_explanation(found, form), pictures

    text, pictures = with_progress(work)
    if plots:
        put_pictures(pictures, plots)
    put_out(text, out)
