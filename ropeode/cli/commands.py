"""The commands. Each imports what it needs when it runs, so that help is instant."""

from __future__ import annotations

from pathlib import Path

import click

from ropeode.cli.job import job_from
from ropeode.cli.options import predict_option, table_options
from ropeode.terminal import (
    CommaSeparated,
    format_for,
    format_option,
    out_option,
    put_out,
    set_up_jax,
    with_progress,
)
from ropeode.validation import bad_value


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
    put_out(
        with_progress(lambda progress: format_table(job.run(progress, predict), form, **layout)),
        out,
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
