"""The command `ropeode`: its entry point and how errors leave it."""

from __future__ import annotations

import os
import sys
import traceback
from typing import Any

import click

from ropeode.cli.check import check
from ropeode.cli.commands import spec, steppers, table
from ropeode.cli.grade import grade
from ropeode.cli.horizon import horizon
from ropeode.cli.pictures import animate, plot
from ropeode.cli.reference import reference
from ropeode.cli.report import report
from ropeode.cli.running import end_on_ctrl_c
from ropeode.cli.sweep import sweep
from ropeode.errors import InputError, RopeodeError, UserCodeError, users_traceback

# What is wrong with ropeode itself is none of the answers that a command may give.
BAD_INPUT, FAILED, BROKEN = 2, 1, 3


@click.group(context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 80})
@click.version_option(package_name="ropeode", message="%(package)s %(version)s")
@click.option("--debug", is_flag=True, help="Show the traceback of every error.")
def cli(debug: bool) -> None:
    """Check ODE steppers against certified reference solutions.

    `ropeode check FILE.py:NAME` checks a stepper of yours. `ropeode table` prints the errors and
    orders of several steppers on the default problem, a mass-spring rope.
    """


for command in (
    table,
    check,
    grade,
    reference,
    horizon,
    sweep,
    plot,
    animate,
    report,
    spec,
    steppers,
):
    cli.add_command(command)


def main(arguments: list[str] | None = None) -> None:
    """Run the command line; user errors end in one line each and exit code 2."""
    end_on_ctrl_c()
    given = sys.argv[1:] if arguments is None else arguments
    debug = "--debug" in given[:1]
    try:
        code = cli.main(given, prog_name="ropeode", standalone_mode=False)
        _leave(int(code or 0))
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.ctx.get_help())
        _leave(0)
    except click.ClickException as error:
        where = (
            error.ctx.command_path if isinstance(error, click.UsageError) and error.ctx else None
        )
        hint = f" Fix: see `{where} --help`." if where else ""
        _fail(BAD_INPUT, [f"{error.format_message()}{hint}"], debug)
    except UserCodeError as error:
        if error.__cause__ is not None:
            click.echo(users_traceback(error.__cause__), err=True)
        _fail(BAD_INPUT, error.problems, debug)
    except InputError as error:
        _fail(BAD_INPUT, error.problems, debug)
    except RopeodeError as error:
        _fail(FAILED, [str(error)], debug)
    except BrokenPipeError:
        # The reader (a pager, `head`) has gone; let nothing be flushed to it at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        _leave(FAILED)
    except Exception as error:
        traceback.print_exc()
        _fail(BROKEN, [f"{type(error).__name__}: a fault of ropeode; please report it."], False)


def _fail(code: int, lines: Any, debug: bool) -> None:
    if debug:
        traceback.print_exc()
    for line in lines:
        click.echo(f"ropeode: {line}", err=True)
    _leave(code)


def _leave(code: int) -> None:
    """End the process at once, without waiting for a computation in another thread."""
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)
