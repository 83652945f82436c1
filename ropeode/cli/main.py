"""The command `ropeode`: its entry point and how errors leave it."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import sys
import traceback
import warnings
from collections.abc import Iterator, Sequence
from typing import Any, NoReturn

import click

from ropeode.case_studies import report_command
from ropeode.cli.check import check
from ropeode.cli.commands import explain, horizon, spec, steppers, table, work_precision
from ropeode.cli.grade import grade
from ropeode.cli.groups import WholeHelp
from ropeode.cli.lab import lab
from ropeode.cli.pictures import animate, plot
from ropeode.cli.reference import reference
from ropeode.cli.sweep import sweep
from ropeode.errors import InputError, InputWarning, RopeodeError, UserCodeError, users_traceback
from ropeode.sandbox import Child, Ended, GuardLost, doing
from ropeode.terminal import KEPT, NOTHING, end_on_ctrl_c, is_users_file

# What is wrong with ropeode itself is none of the answers that a command may give.
BAD_INPUT, FAILED, BROKEN = 2, 1, 3
_NO_ROOM = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
# What runs the user's code, which may end its process, runs in another one: this command always,
# the others where their words name a file that has, or names, such code; but the lab has a process
# of its own for it.
_JUDGES, _USERS_CODE, _WATCHES = "check", (".py", ".toml"), "lab"
_OF_CLASSES = (_JUDGES, "grade")
# With this begins what Python says of a crash.
_CRASH = "Fatal Python error: "


@click.group(
    cls=WholeHelp, context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 80}
)
@click.version_option(package_name="ropeode", message="%(package)s %(version)s")
@click.option("--debug", is_flag=True, help="Show the traceback of every error.")
def cli(debug: bool) -> None:
    """Check ODE steppers against certified reference solutions.

    `ropeode check FILE.py` checks a stepper of yours. `ropeode table` prints the errors and
    orders of several steppers on the default problem, a mass-spring rope.
    """


for command in (
    table,
    check,
    explain,
    grade,
    reference,
    horizon,
    work_precision,
    sweep,
    plot,
    animate,
    report_command,
    lab,
    spec,
    steppers,
):
    cli.add_command(command)


def run_command(arguments: list[str] | None = None, ended: Ended | None = None) -> int:
    """Run the command line; user errors end in one line each.

    Arguments:
        arguments: those of the process where left out.
        ended: how the process ended that was to run the command; None where this one runs it.

    Returns:
        the exit code: 0, 1 for an answer such as "wrong", 2 for bad input, 3 for a fault of
        ropeode.
    """
    words = sys.argv[1:] if arguments is None else arguments
    debug = "--debug" in words[:1]
    if ended is not None and (why := _no_verdict(_command_in(words), ended)):
        code, line = why
        return _fail(code, [line], debug=False)
    with _warnings_in_a_line():
        return _ended_well_or_not(words, debug, ended)


@contextlib.contextmanager
def _warnings_in_a_line() -> Iterator[None]:
    """Shows warnings about input as errors are shown, without a line of ropeode's code."""
    show = warnings.showwarning

    def in_a_line(message: Warning | str, category: type[Warning], *where: Any) -> None:
        if issubclass(category, InputWarning):
            click.echo(f"ropeode: warning: {message}", err=True)
        else:
            show(message, category, *where)

    warnings.showwarning = in_a_line
    try:
        yield
    finally:
        warnings.showwarning = show


def _ended_well_or_not(words: list[str], debug: bool, ended: Ended | None) -> int:
    """The exit code of the command with these words."""
    try:
        if ended is None:
            doing("the imports")
        code = cli.main(words, prog_name="ropeode", standalone_mode=False, obj=ended)
        sys.stdout.flush()
        return int(code or 0)
    except click.exceptions.NoArgsIsHelpError as error:
        click.echo(error.ctx.get_help())
        return 0
    except click.ClickException as error:
        where = (
            error.ctx.command_path if isinstance(error, click.UsageError) and error.ctx else None
        )
        hint = f" Fix: see `{where} --help`." if where else ""
        return _fail(BAD_INPUT, [f"{error.format_message()}{hint}"], debug)
    except UserCodeError as error:
        if error.__cause__ is not None:
            click.echo(users_traceback(error.__cause__), err=True)
        return _fail(BAD_INPUT, str(error).splitlines(), debug)
    except InputError as error:
        return _fail(BAD_INPUT, str(error).splitlines(), debug)
    except RopeodeError as error:
        return _fail(FAILED, [str(error)], debug)
    except MemoryError as error:
        why = f"memory: {error}; allowed: what fits into it. Fix: ask for fewer frames or draws."
        return _fail(BAD_INPUT, [why], debug)
    except BrokenPipeError:
        # The reader (a pager, `head`) has gone; let nothing be flushed to it at exit.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILED
    except Exception as error:
        if isinstance(error, OSError) and error.errno in _NO_ROOM:
            # What is written to files says so itself; this was standard output.
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            why = f"output: {error.strerror}; allowed: where there is room. Fix: make room for it."
            return _fail(BAD_INPUT, [why], debug)
        traceback.print_exc()
        message = f"{type(error).__name__}: a fault of ropeode; please report it."
        return _fail(BROKEN, [message], debug=False)


def _fail(code: int, lines: Sequence[str], debug: bool) -> int:
    if debug:
        traceback.print_exc()
    for line in lines:
        click.echo(f"ropeode: {line}", err=True)
    return code


def run_process() -> NoReturn:
    """The command as a process, which ends without waiting for a computation in another thread."""
    end_on_ctrl_c()
    for number, name in ((1, "stdout"), (2, "stderr")):
        # Python has none where the shell closed it (`>&-`), and its number may become another file.
        if getattr(sys, name) is None:
            os.dup2(os.open(os.devnull, os.O_WRONLY), number)
            os.set_inheritable(number, True)
            setattr(sys, name, os.fdopen(number, "w", closefd=False))
    words = sys.argv[1:]
    command = _command_in(words)
    users = any(suffix in word for word in words for suffix in _USERS_CODE) and command != _WATCHES
    # The submissions of a folder have processes of their own.
    a_class = command in _OF_CLASSES and any(os.path.isdir(word) for word in words)
    code = _run_watched(command) if (command == _JUDGES or users) and not a_class else run_command()
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _command_in(words: Sequence[str]) -> str:
    return next((word for word in words if not word.startswith("-")), "")


def _run_watched(command: str) -> int:
    """Run the command in a process of its own, which the user's code may end."""
    with Child(_in_child, sys.argv[1:]) as child:
        end_on_ctrl_c(KEPT if command == "sweep" else NOTHING, before=child.end)
        try:
            ended = child.wait()
        except GuardLost as error:
            return _fail(BAD_INPUT, [str(error)], debug=False)
    code = (ended.result or b"").decode(errors="replace")
    return int(code) if code.isdecimal() else run_command(ended=ended)


def _in_child(words: list[str]) -> bytes:
    """Run the command; its exit code.

    Output goes where it went, but the user's code does not find it by its number: what compiled
    code prints goes to standard error, and the output is there if standard output is closed.
    """
    sys.argv[1:] = words
    sys.stdout = os.fdopen(os.dup(1), "w", encoding=sys.stdout.encoding, errors="backslashreplace")
    os.dup2(2, 1)
    return str(run_command()).encode()


def _no_verdict(command: str, ended: Ended) -> tuple[int, str] | None:
    """Exit code and message of a command that was ended; None where that is a verdict."""
    if not ended.during:
        return BROKEN, f"the command {ended.how} before it began; please report it."
    if _crashed_elsewhere(ended):
        return BROKEN, (
            f"the command {ended.how} in compiled code, during: {ended.during}. If your code calls "
            "compiled functions of its own, look there; else this is a fault of ropeode, please "
            "report it."
        )
    if command == _JUDGES:
        return None
    allowed = "code that returns, and leaves its process alone"
    return BAD_INPUT, (
        f"your code {ended.how}; allowed: {allowed}. Fix: look for what ends it there."
    )


def _crashed_elsewhere(ended: Ended) -> bool:
    """Whether it crashed in compiled code that none of the user's Python code called."""
    files = re.findall(r'^  File "(.*)", line ', ended.noise, re.MULTILINE)
    return _CRASH in ended.noise and not any(map(is_users_file, files))
