"""The commands that run a sweep and show what is in its folder."""

from __future__ import annotations

import os
from pathlib import Path

import click

from ropeode.cli.groups import DefaultGroup
from ropeode.terminal.running import end_on_ctrl_c, interruptible, set_up_jax, show_cases


@click.group(cls=DefaultGroup, default="run")
def sweep() -> None:
    """Run steppers on a grid or a random design of problems, into a folder.

    `ropeode sweep SPEC.toml -o DIR` is short for `ropeode sweep run`. `ropeode spec sweep`
    prints a commented SPEC.
    """


@sweep.command()
@click.argument("spec", type=click.Path(path_type=Path))
@click.option("-o", "--out", metavar="DIR", required=True, help="The sweep's own folder.")
@click.option("--workers", metavar="N", help="Run in N processes. [in this one]")
@click.option("--scheduler", metavar="ADDR", help="Run on a Dask cluster, as in tcp://host:8786.")
@click.option("--extend", is_flag=True, help="Let DIR grow from a smaller sweep to this one.")
def run(spec: Path, out: str, workers: str | None, scheduler: str | None, extend: bool) -> None:
    """Run the sweep that SPEC describes, or what is left of it.

    Finished cases are kept in DIR at any moment; after Ctrl-C, or whatever else ends it, the
    same command goes on from there. Needs the data packages: pip install '.[data]', and
    with a scheduler '.[data,dask]'.
    """
    # What Ctrl-C leaves of the workers' queues is removed by Python's tracker, which would say so.
    os.environ.setdefault("PYTHONWARNINGS", "ignore:resource_tracker:UserWarning")
    set_up_jax()
    end_on_ctrl_c("finished cases are kept; the same command goes on from there")
    from ropeode.render.sweep import as_text
    from ropeode.sweep.run import run_sweep

    with show_cases() as progress:
        summary = interruptible(
            lambda: run_sweep(
                spec,
                out,
                workers=workers,  # type: ignore[arg-type]
                scheduler=scheduler,
                extend=extend,
                progress=progress,
            )
        )
    click.echo(as_text(summary), nl=False)


@sweep.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
def show(folder: Path) -> None:
    """Print how far the sweep in DIR is, and what each stepper makes of it."""
    from ropeode.render.sweep import as_text
    from ropeode.sweep.storage.summary import summarize

    click.echo(as_text(summarize(folder)), nl=False)
