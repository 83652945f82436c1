"""The command that grades trajectories from any program."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import click

from ropeode.cli.options import (
    OF_RUNS,
    OUT_OF_CLASSES,
    class_folder,
    class_options,
    class_output,
    dt_option,
    job_from,
    memory_limit,
    table_options,
    values_from,
)
from ropeode.terminal import (
    format_for,
    format_option,
    out_option_with,
    put_out,
    set_up_jax,
    with_progress,
)
from ropeode.validation import bad_value

# Folders of `ropeode.checking.starter_files`, which imports JAX.
ASSIGNMENTS = ("games101",)


@click.command()
@click.argument("files", nargs=-1, type=click.Path(path_type=Path))
@table_options(without=OF_RUNS)
@dt_option
@click.option("--order", metavar="N", help="The order that the program should have.")
@click.option("--damped-order", metavar="N", help="Likewise, on problems with damping. [--order]")
@click.option("--method", metavar="NAME", help="What it is meant to be; see `ropeode steppers`.")
@click.option(
    "--init", metavar="DIR", type=click.Path(), help="Write a spec and a program to start from."
)
@click.option(
    "--assignment",
    type=click.Choice(ASSIGNMENTS),
    help="With --init: write the files for this assignment, with a program for all its methods.",
)
@class_options
@format_option
@out_option_with(OUT_OF_CLASSES)
def grade(
    files: tuple[Path, ...],
    dt: list[str] | None,
    order: str | None,
    damped_order: str | None,
    method: str | None,
    init: str | None,
    assignment: str | None,
    memory: str | None,
    rubric: Path | None,
    form: str | None,
    out: str | None,
    **options: str | None,
) -> int:
    """Grade trajectories from any program: does it solve the problem?

    FILES are CSV (t,node,x,y and optionally vx,vy), NPZ or NetCDF, one for each of at least
    three step sizes; --problem or --reference names what they solve. `ropeode grade --init DIR`
    writes a spec, the initial state, a program in C++ and a page that explains them, and with
    `--assignment games101` those of the rope in Assignment 8 of GAMES101. The exit code is 0 if
    the program is right, 1 if it is wrong, and 2 if the files do not decide that, or cannot be
    graded.

    A FOLDER in place of FILES has a subfolder of such files for each submission. Each is graded
    in a process of its own, against one reference. The exit code is then 0 if all are right, 1
    if some are wrong, and 2 if some have no verdict.
    """
    if init is not None:
        others = files or dt or order or damped_order or method or memory or rubric or out or form
        return _init(init, assignment, options, bool(others))
    if assignment is not None:
        raise bad_value("assignment", assignment, "one with --init", "add --init DIR")
    if not files:
        allowed = "trajectories, one file for each step size"
        raise bad_value("files", "none", allowed, "see `ropeode grade --init DIR`")
    if options["problem"] is None and options["reference"] is None:
        fix = "give --problem SPEC; `ropeode grade --init DIR` writes one"
        raise bad_value("problem", "none", "the problem that they solve", fix)
    folder = class_folder(files[0] if len(files) == 1 else None, memory=memory, rubric=rubric)
    path = class_output(out, folder)
    chosen = format_for(form, None if folder else path)
    set_up_jax()
    if folder is not None:
        from ropeode.checking import Claims
        from ropeode.classroom import grade_class

        spec = values_from(None, options)
        claims = Claims(order, method, damped_order=damped_order)  # type: ignore[arg-type]
        mebibytes = memory_limit(memory)
        return grade_class(folder, *spec, dt, claims, mebibytes, rubric, chosen, path)

    from ropeode.checking.grade import grade as graded
    from ropeode.render import format_check

    job = job_from(None, options)
    report = with_progress(
        lambda progress: graded(
            files,
            job.given,
            dt,
            order,  # type: ignore[arg-type]
            method=method,
            damped_order=damped_order,  # type: ignore[arg-type]
            progress=progress,
            **job.spec.asked,
        )
    )
    put_out(format_check(report, chosen), path)
    return report.exit_code


def _init(
    folder: str, assignment: str | None, options: Mapping[str, str | None], other_options: bool
) -> int:
    """Write the starter files."""
    if other_options:
        allowed, fix = "no other option but those of the problem", "leave out the others"
        raise bad_value("init", folder, allowed, fix)
    if assignment is not None and any(options.values()):
        allowed, fix = "no problem beside it, for it has its own", "leave out one of them"
        raise bad_value("assignment", assignment, allowed, fix)
    set_up_jax()
    from ropeode.checking import write_assignment, write_start

    if assignment is not None:
        written = write_assignment(folder, assignment)
    else:
        written = write_start(folder, job_from(None, options) if any(options.values()) else None)
    for name in written:
        click.echo(f"wrote {name}", err=True)
    return 0
