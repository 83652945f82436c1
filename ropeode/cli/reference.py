"""The commands that write, show and verify references in files."""

from __future__ import annotations

import functools
from pathlib import Path

import click

from ropeode.cli.groups import DefaultGroup
from ropeode.cli.options import OF_RUNS, job_from, no_code_option, table_options
from ropeode.terminal import out_option_with, set_up_jax, with_progress


@click.group(cls=DefaultGroup, default="compute")
def reference() -> None:
    """Compute references; show, export and verify their files.

    `ropeode reference [SPEC] [OPTIONS] --out FILE.nc` is short for `ropeode reference compute`.
    A FILE may also be a name of the stored library, which `ropeode reference list` lists.
    """


@reference.command()
@click.argument("spec", required=False, type=click.Path(path_type=Path))
@table_options(without=OF_RUNS)
@out_option_with("A NetCDF file, *.nc.", required=True)
def compute(spec: Path | None, out: str, **options: str | None) -> None:
    """Compute a reference and write it to FILE.

    Takes the problem and the reference's settings from SPEC and the options, as `ropeode table`
    does. Steppers in SPEC are ignored.
    """
    set_up_jax()
    from ropeode.references import (
        ReferenceOptions,
        check_reference_path,
        reference_for,
        save_reference,
    )
    from ropeode.render import describe_reference

    path = check_reference_path(out)
    job = job_from(spec, options)
    asked = ReferenceOptions(**job.spec.asked)
    computed = with_progress(functools.partial(reference_for, job.given, asked))
    save_reference(computed, path)
    click.echo(describe_reference(computed), nl=False)
    click.echo(f"wrote {path}")


@reference.command()
@click.argument("file", type=click.Path(path_type=Path))
def show(file: Path) -> None:
    """Print the problem, bound, witnesses and checksum of FILE."""
    from ropeode.references import find, stored_facts
    from ropeode.render import blocks, plain

    click.echo(plain(blocks(stored_facts(find(file)))), nl=False)


@reference.command()
@click.argument("file", type=click.Path(path_type=Path))
@out_option_with("Text for any program (*.csv, *.txt), *.npz or *.parquet.", required=True)
def export(file: Path, out: str) -> None:
    """Write the states and error bounds of FILE for other programs.

    A column each: the time, the positions x0, y0, x1, ..., the velocities vx0, vy0, ... of the
    nodes, and the estimated error bound of either, which is "nan" outside the trust horizon.
    """
    set_up_jax()
    from ropeode.references import find, load_reference
    from ropeode.render import check_export, write_export

    path = check_export(out)
    click.echo(f"wrote {write_export(load_reference(find(file)), path)}")


@reference.command("list")
def list_library() -> None:
    """List the stored library: references that come with the package."""
    from ropeode.references import entries
    from ropeode.render import library_list

    click.echo(library_list(entries()), nl=False)


@reference.command()
@click.argument("file", type=click.Path(path_type=Path))
@click.option("--problem", metavar="FILE.py:NAME", help="If the library does not have it.")
@click.option("--time-limit", metavar="S", help="Seconds to recompute an extended reference. [60]")
@no_code_option
def verify(file: Path, problem: str | None, time_limit: str | None) -> None:
    """Check FILE, and compute its reference again with today's solvers.

    The exit code is 1 if a stored value differs from the new one by more than the two bounds.
    """
    set_up_jax()
    from ropeode.problems import load_problem
    from ropeode.references import TIME_LIMIT, find, verify_reference
    from ropeode.render import blocks, plain
    from ropeode.validation import check_positive

    limit = TIME_LIMIT
    if time_limit is not None:
        limit = check_positive("time_limit", time_limit, example="600")
    verification = with_progress(
        lambda progress: verify_reference(
            find(file),
            load_problem(problem) if problem else None,
            time_limit=limit,
            progress=progress,
        )
    )
    click.echo(plain(blocks(verification)), nl=False)
    if not verification.agrees:
        raise SystemExit(1)
