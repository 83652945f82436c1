"""The command that grades trajectories from any program."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from ropeode.errors import InputError
from ropeode.files import check_writable
from ropeode.terminal.formats import format_for, format_option
from ropeode.terminal.running import interruptible, put_out, set_up_jax, show_progress
from ropeode.validation import complaint


@click.command()
@click.argument("files", nargs=-1, type=click.Path(path_type=Path))
@click.option("--problem", metavar="SPEC", help="File of the problem, like that of `ropeode spec`.")
@click.option("--reference", metavar="FILE", help="A stored reference of the problem.")
@click.option("--dt", metavar="A[,B...]", help="Step size of each file. [as the files say]")
@click.option("--order", metavar="N", help="The order that the program should have.")
@click.option("--init", metavar="DIR", help="Write a spec and a program to start from.")
@format_option
@click.option("--out", metavar="FILE", help="Write the report to FILE and print nothing.")
def grade(
    files: tuple[Path, ...],
    problem: str | None,
    reference: str | None,
    dt: str | None,
    order: str | None,
    init: str | None,
    form: str | None,
    out: str | None,
) -> int:
    """Grade trajectories from any program: does it solve the problem?

    FILES are CSV (t,node,x,y and optionally vx,vy), NPZ or NetCDF, one for each of at least
    three step sizes. `ropeode grade --init DIR` writes a spec, the initial state, a program in
    C++ and a page that explains them. The exit code is 0 if no check fails, 1 if the program is
    wrong, and 2 if it cannot be graded.
    """
    path = check_writable("out", out) if out else None
    if init is not None:
        return _init(init, problem, bool(files or reference or dt or order or out or form))
    if not files:
        allowed = "trajectories, one file for each step size"
        raise InputError(complaint("files", "none", allowed, "see `ropeode grade --init DIR`"))
    if problem is None and reference is None:
        fix = "give --problem SPEC; `ropeode grade --init DIR` writes one"
        raise InputError(complaint("problem", "none", "the problem that they solve", fix))
    set_up_jax()
    from ropeode.checking.grade import grade as graded
    from ropeode.render.formats import format_check

    job = _job(problem, reference)
    with show_progress() as progress:
        report = interruptible(
            lambda: graded(
                files,
                job.given,
                None if dt is None else [part.strip() for part in dt.split(",")],
                order,  # type: ignore[arg-type]
                progress=progress,
                **job.spec.asked,
            )
        )
    put_out(format_check(report, format_for(form, path)), path)
    return 0 if report.passed else 1


def _job(problem: str | None, reference: str | None) -> Any:
    """The problem of the spec, the reference, or both."""
    from ropeode.study.spec import TableJob, read_spec

    spec = Path(problem) if problem is not None else None
    values = read_spec(spec) if spec else {}
    if reference is not None:
        # Relative to the current folder, not to that of the spec.
        values["reference"] = (
            str(Path(reference).resolve()) if Path(reference).exists() else reference
        )
    return TableJob(values, folder=spec.parent if spec else None)


def _init(folder: str, problem: str | None, other_options: bool) -> int:
    """Write the starter files."""
    if other_options:
        allowed, fix = "no other option but --problem", "leave out the others"
        raise InputError(complaint("init", folder, allowed, fix))
    set_up_jax()
    from ropeode.checking.starter_files import write_start

    job = None if problem is None else _job(problem, None)
    for name in write_start(folder, job):
        click.echo(f"wrote {name}", err=True)
    return 0
