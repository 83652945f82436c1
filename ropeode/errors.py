"""The exceptions that ropeode raises."""

from __future__ import annotations

import os
import traceback
from collections.abc import Iterable


class RopeodeError(Exception):
    """Base of every exception that ropeode raises on purpose."""


class InputError(RopeodeError, ValueError):
    """Input that cannot be used.

    Arguments:
        problems: one line for each fault; it names the field, its value, what is allowed, and
            a fix.
    """

    def __init__(self, problems: str | Iterable[str]):
        self.problems = (problems,) if isinstance(problems, str) else tuple(problems)
        super().__init__("\n".join(self.problems))


class UserCodeError(InputError):
    """The user's code raised an exception, which is the ``__cause__``."""


class ReferenceRefused(RopeodeError):
    """No reference of this problem can be certified; the message says why."""


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
