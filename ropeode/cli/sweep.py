"""The commands that run a sweep and summarize its folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ropeode.cli.groups import DefaultGroup
from ropeode.cli.options import no_code_option
from ropeode.errors import RopeodeError
from ropeode.terminal import KEPT, end_on_ctrl_c, out_option_with, set_up_jax, with_progress
from ropeode.validation import counted


@click.group(cls=DefaultGroup, default="run")
def sweep() -> None:
    """Run steppers on a grid or a random design of problems.

    `ropeode sweep SPEC.toml -o DIR` is short for `ropeode sweep run`. `ropeode spec sweep`
    prints a commented SPEC.
    """


@sweep.command()
@click.argument("spec", type=click.Path(path_type=Path))
@out_option_with("A folder for this sweep only.", metavar="DIR", required=True)
@click.option("--workers", metavar="N", help="Run in N processes. [this one]")
@click.option("--scheduler", metavar="ADDR", help="Run on a Dask cluster, as in tcp://host:8786.")
@click.option("--extend", is_flag=True, help="Extend the smaller sweep in DIR to this one.")
@click.option("--case-limit", metavar="S", help="Seconds that a case may take. [no limit]")
@no_code_option
def run(spec: Path, out: str, **options: Any) -> None:
    """Run the sweep in SPEC, and resume it if it was interrupted.

    Finished cases are kept in DIR. After Ctrl-C, a crash or a full disk, run the same command to
    resume. Needs the data packages: pip install '.[data]', and with a scheduler '.[data,dask]'.
    """
    set_up_jax()
    end_on_ctrl_c(KEPT)
    from ropeode.render import FORMATS
    from ropeode.sweep import run_sweep

    summary = with_progress(
        lambda progress: run_sweep(spec, out, progress=progress, **options), time_left=True
    )
    click.echo(FORMATS["text"](summary), nl=False)
    if died := summary.statuses["worker-died"]:
        raise RopeodeError(
            f"{counted(died, 'case')} killed the process that ran it, each time; the rows "
            "`worker-died` name them, and the same command with --workers tries them again."
        )


@sweep.command()
@click.argument("folder", metavar="DIR", type=click.Path(path_type=Path))
def show(folder: Path) -> None:
    """Print the progress of the sweep in DIR, stepper by stepper."""
    from ropeode.render import FORMATS
    from ropeode.sweep import summarize

    click.echo(FORMATS["text"](summarize(folder)), nl=False)
