"""The command that checks a stepper."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from ropeode.cli.options import no_code_option
from ropeode.files import check_writable
from ropeode.terminal.lists import CommaSeparated
from ropeode.terminal.output import (
    check_folder,
    format_for,
    format_option,
    out_option_with,
    put_out,
)
from ropeode.terminal.running import set_up_jax, with_progress
from ropeode.terminal.supervision import Ended, end_if_nothing_runs, say
from ropeode.validation import bad_value, check_positive

if TYPE_CHECKING:
    from ropeode.checking.report import CheckReport
    from ropeode.progress import Progress

# The names in ropeode.steppers.templates; a test holds the two together.
TEMPLATES = ("acceleration", "rhs", "two-step")
NAMES = CommaSeparated()
# A hundred submissions that hang would take an hour otherwise.
CLASS_TIME_LIMIT = 20.0


@click.command()
@click.argument("step", required=False)
@click.option("--order", metavar="N", help="The order that its author claims.")
@click.option("--method", metavar="NAME", help="What it is meant to be; see `ropeode steppers`.")
@click.option("--symplectic", is_flag=True, help="Its author claims that it is.")
@click.option("--reversible", is_flag=True, help="Likewise.")
@click.option("--conserves-energy", is_flag=True, help="Likewise: in the long run.")
@click.option("--only", type=NAMES, metavar="CHECK[,...]", help="Make these checks, and no others.")
@click.option("--skip", type=NAMES, metavar="CHECK[,...]", help="Leave these checks out.")
@click.option("--quick", is_flag=True, help="Leave out what takes long.")
@click.option(
    "--time-limit",
    metavar="S",
    help="Seconds that the step may compute in each check. [60; of a FOLDER 20]",
)
@click.option(
    "--memory",
    metavar="MIB",
    help="Of a FOLDER: memory that a submission may hold, in MiB. [2048]",
)
@click.option(
    "--name",
    "stepper_name",
    metavar="NAME",
    help="Of a FOLDER: the function, or FILE.py:NAME in subfolders. [the only one]",
)
@click.option(
    "--rubric",
    metavar="FILE.toml",
    type=click.Path(path_type=Path),
    help="Of a FOLDER: how many points for which checks.",
)
@click.option(
    "--template",
    type=click.Choice(TEMPLATES),
    help="Print a stepper to begin with, and check nothing.",
)
@no_code_option
@format_option
@out_option_with("Write the report to FILE; of a FOLDER the grade book to DIR, which resumes.")
@click.pass_obj
def check(
    ended: Ended | None,
    step: str | None,
    order: str | None,
    method: str | None,
    symplectic: bool,
    reversible: bool,
    conserves_energy: bool,
    only: list[str] | None,
    skip: list[str] | None,
    quick: bool,
    time_limit: str | None,
    memory: str | None,
    stepper_name: str | None,
    rubric: Path | None,
    template: str | None,
    form: str | None,
    out: str | None,
) -> int:
    """Check whether a stepper solves the right equation, and how well.

    STEP is FILE.py:NAME, or FILE.py with one stepper in it: a function step(rhs, t, y, dt, args)
    that returns the new y, or step(acceleration, t, x, v, dt, args) that returns the new x and
    v, in NumPy or JAX, or a Stepper class. It may also be diffrax:NAME, scipy:NAME, or the name
    of a stepper of ropeode. The exit code is 0 if every check that
    applies passes, 1 if the stepper is wrong, and 2 if it cannot be checked.

    STEP may be a FOLDER of submissions: each Python file, and each subfolder with one, is
    checked in a process of its own. The exit code is then 0 if all are right, 1 if some are
    wrong, and 2 if some have no verdict.
    """
    a_class = step is not None and Path(step).is_dir()
    path = None
    if out is not None:
        path = check_folder("out", out) if a_class else check_writable("out", out)
    if template is not None:
        from ropeode.steppers.templates import template as text_of

        put_out(text_of(template), path)
        return 0
    if step is None:
        raise click.MissingParameter(param_hint="STEP", param_type="argument")
    for option, given in (("memory", memory), ("name", stepper_name), ("rubric", rubric)):
        if given is not None and not a_class:
            fix = "leave it out, or name a folder"
            raise bad_value(option, str(given), "none but with a FOLDER of submissions", fix)
    form = format_for(form, None if a_class else path)
    set_up_jax()
    from ropeode.checking.check import (
        TIME_LIMIT,
        check_stepper,
        checked_claims,
        chosen_checks,
        cut_off,
    )
    from ropeode.checking.report import Claims
    from ropeode.render.formats import format_check

    limit = CLASS_TIME_LIMIT if a_class else TIME_LIMIT
    if time_limit is not None:
        limit = check_positive("time_limit", time_limit, example="60")
    claims = checked_claims(
        Claims(
            order,  # type: ignore[arg-type]
            method,
            symplectic or None,
            reversible or None,
            conserves_energy or None,
        )
    )

    if step is not None and a_class:
        from ropeode.classroom.command import Asked, check_class

        mebibytes = check_positive("memory", memory or "2048", example="2048")
        asked = Asked(claims, only, skip or (), quick, limit, mebibytes)
        return check_class(Path(step), asked, stepper_name, rubric, form, path)

    def checked(progress: Progress) -> CheckReport:
        def seen(text: str, fraction: float | None) -> None:
            say(text)
            progress(text, fraction)

        end_if_nothing_runs(limit)
        return check_stepper(
            step,
            claims.order,
            method=claims.method,
            symplectic=claims.symplectic,
            reversible=claims.reversible,
            conserves_energy=claims.conserves_energy,
            only=only,
            skip=skip or (),
            quick=quick,
            time_limit=limit,
            progress=seen,
        )

    if ended is None:
        report = with_progress(checked)
    else:
        names = chosen_checks(only, skip or (), quick)
        report = cut_off(step, claims, names, ended.how, ended.during)
    put_out(format_check(report, form), path)
    return report.exit_code
