"""The commands. Each imports what it needs when it runs, so that help is instant."""

from __future__ import annotations

from pathlib import Path

import click

from ropeode.cli.job import job_from
from ropeode.cli.options import table_options
from ropeode.terminal.output import format_for, format_option, out_option, put_out
from ropeode.terminal.running import set_up_jax, with_progress


@click.command()
@click.argument("spec", required=False, type=click.Path(path_type=Path))
@table_options()
@format_option
@out_option("table")
def table(spec: Path | None, form: str | None, out: Path | None, **options: str | None) -> None:
    """Print the accuracy table of a rope, or of another problem.

    The settings come from the options and from the file SPEC (`ropeode spec` prints one).
    Options override SPEC. Without settings, it prints the table of the default rope.
    """
    set_up_jax()
    from ropeode.render.formats import format_table

    job = job_from(spec, options)
    form = format_for(form, out)
    put_out(with_progress(lambda progress: format_table(job.run(progress), form)), out)


@click.command()
@click.argument("command", type=click.Choice(["table", "sweep"]), default="table")
@out_option("spec")
def spec(command: str, out: Path | None) -> None:
    """Print a commented spec file for `table` or `sweep`."""
    if command == "sweep":
        from ropeode.sweep.design.spec import commented_sweep

        put_out(commented_sweep(), out)
    else:
        from ropeode.study.spec import commented_table

        put_out(commented_table(), out)


@click.command()
def steppers() -> None:
    """List the steppers, their options, orders and sources."""
    from ropeode.render.stepper_list import as_text

    click.echo(as_text(), nl=False)
