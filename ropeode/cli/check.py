"""The command that checks a stepper."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ropeode.cli.options import (
    OUT_OF_CLASSES,
    class_folder,
    class_options,
    class_output,
    memory_limit,
    no_code_option,
)
from ropeode.sandbox import Ended, end_if_python_stops
from ropeode.terminal import (
    CommaSeparated,
    format_for,
    format_option,
    out_option_with,
    put_out,
    set_up_jax,
    with_progress,
)
from ropeode.validation import check_positive

if TYPE_CHECKING:
    from ropeode.checking import CheckReport
    from ropeode.progress import Progress

# The names in ropeode.steppers.templates; a test holds the two together.
TEMPLATES = ("acceleration", "rhs", "two-step")
NAMES = CommaSeparated()
# A hundred submissions that hang would take an hour otherwise.
CLASS_TIME_LIMIT = 20.0


@click.command()
@click.argument("step", required=False)
@click.option("--order", metavar="N", help="The order that its author claims.")
@click.option("--damped-order", metavar="N", help="Likewise, on problems with damping. [--order]")
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
    "--name",
    "stepper_name",
    metavar="NAME",
    help="Of a FOLDER: the function, or FILE.py:NAME in subfolders. [the only one]",
)
@class_options
@click.option(
    "--template",
    type=click.Choice(TEMPLATES),
    help="Print a stepper to begin with, and check nothing.",
)
@no_code_option
@format_option
@out_option_with(OUT_OF_CLASSES)
@click.pass_obj
def check(
    ended: Ended | None,
    step: str | None,
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
    **claimed: Any,
) -> int:
    """Check whether a stepper solves the right equation, and how well.

    STEP is FILE.py:NAME, or FILE.py with one stepper in it: a function step(rhs, t, y, dt, args)
    that returns the new y, or step(acceleration, t, x, v, dt, args) that returns the new x and
    v, in NumPy or JAX, or a Stepper class. It may also be runge-kutta:FILE.toml,
    diffrax:NAME, scipy:NAME, or the name of a stepper of ropeode. The exit code is 0 if every
    check that applies passes, 1 if the stepper is wrong, and 2 if it cannot be checked.

    STEP may be a FOLDER of submissions: each Python file, and each subfolder with one, is
    checked in a process of its own. The exit code is then 0 if all are right, 1 if some are
    wrong, and 2 if some have no verdict.
    """
    folder = class_folder(step, memory=memory, name=stepper_name, rubric=rubric)
    path = class_output(out, folder)
    if template is not None:
        from ropeode.steppers import template as text_of

        put_out(text_of(template), path)
        return 0
    if step is None:
        raise click.MissingParameter(param_hint="STEP", param_type="argument")
    form = format_for(form, None if folder else path)
    set_up_jax()
    from ropeode.checking import (
        CHECK_TIME_LIMIT,
        Claims,
        check_stepper,
        chosen_checks,
        cut_off,
    )
    from ropeode.render import format_check

    limit = CLASS_TIME_LIMIT if folder else CHECK_TIME_LIMIT
    if time_limit is not None:
        limit = check_positive("time_limit", time_limit, example="60")
    # What is not claimed is measured, not tested.
    claims = Claims(**{name: None if value is False else value for name, value in claimed.items()})
    arguments = {
        "expected_order" if name == "order" else name: value for name, value in vars(claims).items()
    }
    arguments |= {"only": only, "skip": skip or (), "quick": quick, "time_limit": limit}
    if folder is not None:
        from ropeode.classroom import check_class

        mebibytes = memory_limit(memory)
        return check_class(folder, arguments, mebibytes, stepper_name, rubric, form, path)

    def checked(progress: Progress) -> CheckReport:
        end_if_python_stops(limit)
        return check_stepper(step, **arguments, progress=progress)

    if ended is None:
        report = with_progress(checked)
    else:
        names = chosen_checks(only, skip or (), quick)
        report = cut_off(step, claims, names, ended.how, ended.during)
    put_out(format_check(report, form), path)
    return report.exit_code
