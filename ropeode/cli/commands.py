"""The commands. Each imports what it needs when it runs, so that help is instant."""

from __future__ import annotations

from pathlib import Path

import click

from ropeode.cli.job import job_from
from ropeode.cli.options import table_options
from ropeode.files import check_writable
from ropeode.terminal.formats import format_for, format_option
from ropeode.terminal.running import interruptible, put_out, set_up_jax, show_progress


@click.command()
@click.argument("spec", required=False, type=click.Path(path_type=Path))
@table_options
@format_option
@click.option("--out", metavar="FILE", help="Write the table to FILE and print nothing.")
def table(spec: Path | None, form: str | None, out: str | None, **options: str | None) -> None:
    """Print the accuracy table of a rope, or of another problem.

    The settings come from the options and from the file SPEC (`ropeode spec` prints one).
    Options override SPEC. Without settings, it prints the table of the default rope.
    """
    path = check_writable("out", out) if out else None
    set_up_jax()
    from ropeode.render.formats import format_table

    job = job_from(spec, options)
    with show_progress() as progress:
        text = interruptible(lambda: format_table(job.run(progress), format_for(form, path)))
    put_out(text, path)


@click.command()
@click.argument("command", type=click.Choice(["table", "sweep"]), default="table")
@click.option("--out", metavar="FILE", help="Write to FILE instead of printing.")
def spec(command: str, out: str | None) -> None:
    """Print a commented spec file for `table` or `sweep`."""
    path = check_writable("out", out) if out else None
    if command == "sweep":
        from ropeode.sweep.design.spec import commented_sweep

        put_out(commented_sweep(), path)
    else:
        from ropeode.study.spec import COMMENTED_SPEC

        put_out(COMMENTED_SPEC, path)


@click.command()
def steppers() -> None:
    """List the steppers, their options, orders and sources."""
    from ropeode.render.stepper_list import as_text

    click.echo(as_text(), nl=False)
