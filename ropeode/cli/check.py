"""The command that checks a stepper."""

from __future__ import annotations

from pathlib import Path

import click

from ropeode.terminal.lists import CommaSeparated
from ropeode.terminal.output import format_for, format_option, out_option, put_out
from ropeode.terminal.running import set_up_jax, with_progress

# The names in ropeode.steppers.templates; a test holds the two together.
TEMPLATES = ("acceleration", "rhs", "two-step")
NAMES = CommaSeparated()


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
    "--time-limit", metavar="S", help="Seconds that the step may compute in each check. [60]"
)
@click.option(
    "--template",
    type=click.Choice(TEMPLATES),
    help="Print a stepper to begin with, and check nothing.",
)
@format_option
@out_option("report")
def check(
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
    template: str | None,
    form: str | None,
    out: Path | None,
) -> int:
    """Check a stepper: does it solve the right equation, and how well?

    STEP is FILE.py:NAME, or FILE.py with one stepper in it: a function step(rhs, t, y, dt, args)
    that returns the new y, or step(acceleration, t, x, v, dt, args) that returns the new x and
    v, in NumPy or JAX, or a Stepper class. It may also be diffrax:NAME, scipy:NAME, or the name
    of a stepper of ropeode. The exit code is 0 if every check that
    applies passes, 1 if the stepper is wrong, and 2 if it cannot be checked.
    """
    if template is not None:
        from ropeode.steppers.templates import template as text_of

        put_out(text_of(template), out)
        return 0
    if step is None:
        raise click.MissingParameter(param_hint="STEP", param_type="argument")
    set_up_jax()
    from ropeode.checking.check import TIME_LIMIT, check_stepper
    from ropeode.render.formats import format_check

    report = with_progress(
        lambda progress: check_stepper(
            step,
            order,  # type: ignore[arg-type]
            method=method,
            symplectic=symplectic or None,
            reversible=reversible or None,
            conserves_energy=conserves_energy or None,
            only=only,
            skip=skip or (),
            quick=quick,
            time_limit=TIME_LIMIT if time_limit is None else time_limit,  # type: ignore[arg-type]
            progress=progress,
        )
    )
    put_out(format_check(report, format_for(form, out)), out)
    return report.exit_code
