"""The exceptions that ropeode raises."""

from __future__ import annotations

import contextlib
import os
import sys
import traceback
from collections.abc import Callable, Iterable, Iterator
from typing import Any


class RopeodeError(Exception):
    """Base of every exception that ropeode raises on purpose.

    Examples:
        >>> from ropeode import Rope, RopeodeError
        >>> try:
        ...     Rope(num_nodes=-1)
        ... except RopeodeError as error:
        ...     print(type(error).__name__)
        InputError
    """

    def _render_traceback_(self) -> list[str]:
        """What IPython and notebooks show: the sentence, which says all that its reader can mend.

        Lines of the user's own code that raised come before it.
        """
        if _tracebacks.full:
            return traceback.format_exception(self)
        own = [] if self.__cause__ is None else [users_traceback(self.__cause__), ""]
        return [*own, f"{type(self).__name__}: {self}"]


class _Tracebacks:
    full = False


_tracebacks = _Tracebacks()


def full_tracebacks(on: bool = True) -> None:
    """Show ropeode's exceptions in IPython and notebooks with their tracebacks, or without.

    Arguments:
        on: whether to show the tracebacks.

    Examples:
        >>> from ropeode import full_tracebacks
        >>> full_tracebacks()
        >>> full_tracebacks(False)
    """
    _tracebacks.full = on


# In the message of an `InputError`.
_MOST_LINES = 10


class InputError(RopeodeError, ValueError):
    """Input that cannot be used.

    Arguments:
        problems: one line for each fault; it names the field, its value, what is allowed, and
            a fix. The message has the first ten.

    Examples:
        >>> from ropeode import Rope
        >>> Rope(num_nodes=-1)
        Traceback (most recent call last):
            ...
        ropeode.errors.InputError: num_nodes: -1 given; allowed: a whole number >= 1 ...
    """

    def __init__(self, problems: str | Iterable[str]):
        self.problems = (problems,) if isinstance(problems, str) else tuple(problems)
        lines = self.problems[:_MOST_LINES]
        if len(self.problems) > _MOST_LINES:
            lines += (f"and {len(self.problems) - _MOST_LINES} more faults of the same input.",)
        super().__init__("\n".join(lines))


class InputWarning(UserWarning):
    """Input that can be used, and is hardly meant: one line, with the value and what follows."""


class UserCodeError(InputError):
    """The user's code raised an exception, which is the ``__cause__``.

    Examples:
        >>> from ropeode import Problem
        >>> Problem(lambda t, y, args: y / len(args), [1.0], [0.0, 1.0])
        Traceback (most recent call last):
            ...
        ropeode.errors.UserCodeError: rhs: raised TypeError: object of type 'NoneType' has no ...
    """


def call_user_code(what: str, function: Callable, *args: Any, **named: Any) -> Any:
    """Call code of the user's; what it raises becomes the cause of a `UserCodeError`.

    Arguments:
        what: begins the message, as in ``step``.
        function: to be called.
        args: its arguments.
        named: its named arguments.

    Raises:
        UserCodeError: the code raised, or tried to end the process.
    """
    try:
        return function(*args, **named)
    except RopeodeError:
        raise
    except (Exception, SystemExit) as error:
        raise UserCodeError(
            f"{what}: it raised {type(error).__name__}: {' '.join(str(error).split())}; allowed: "
            "code that runs. Fix: mend the error above."
        ) from error


@contextlib.contextmanager
def streams_kept() -> Iterator[None]:
    """A block of a user's code that may replace `sys.stdout` and `sys.stderr`, as many scripts do.

    What ropeode prints behind the block goes where it went before.

    Raises:
        UserCodeError: the code closed standard output.
    """
    was_closed = getattr(sys.stdout, "closed", False)
    with contextlib.redirect_stdout(sys.stdout), contextlib.redirect_stderr(sys.stderr):
        yield
    if getattr(sys.stdout, "closed", False) and not was_closed:
        raise UserCodeError(
            "your code: it closes sys.stdout; allowed: code that leaves it open for the result. "
            "Fix: remove the call of close()."
        )


class ReferenceRefused(RopeodeError):
    """No reference of this problem can be certified; the message says why.

    Arguments:
        message: why.
        reason: the same as a `ropeode.references.certificate.Reason`, if it is one of these.
        witnesses: the runs that the decision rests on, each a
            `ropeode.references.certificate.Witness`.

    Examples:
        >>> from ropeode import Rope, reference
        >>> reference(Rope(num_nodes=4).problem(frames=3), accuracy=1e-20)
        Traceback (most recent call last):
            ...
        ropeode.errors.ReferenceRefused: no reference for 'rope': at t = 1 already the ...
    """

    def __init__(self, message: str, reason: str | None = None, witnesses: Iterable[Any] = ()):
        super().__init__(message)
        self.reason = reason
        self.witnesses = tuple(witnesses)


def users_traceback(error: BaseException) -> str:
    """The traceback of an exception in the user's code, without frames of ropeode and libraries."""
    own = os.path.dirname(__file__)
    shown = traceback.TracebackException.from_exception(error)
    users = [
        frame
        for frame in shown.stack
        if not frame.filename.startswith((own, "<frozen")) and "site-packages" not in frame.filename
    ]
    shown.stack = traceback.StackSummary.from_list(users)
    shown.__cause__ = shown.__context__ = None
    shown.__notes__ = None  # JAX notes that it hid its own frames, which does not help here.
    return "".join(shown.format()).rstrip()
