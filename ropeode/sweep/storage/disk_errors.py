"""What is said when the disk is full."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path

from ropeode.errors import InputError, RopeodeError


@contextlib.contextmanager
def disk_named(folder: Path) -> Iterator[None]:
    """Say of which folder it was, when the operating system refuses to write.

    Raises:
        RopeodeError: it does.
    """
    try:
        yield
    except (OSError, InputError) as error:
        cause = error if isinstance(error, OSError) else error.__cause__
        if not isinstance(cause, OSError):
            raise
        raise RopeodeError(
            f"folder: {folder} cannot be written to ({cause.strerror or cause}); finished cases "
            "are kept. Fix: make room, and give the same command again"
        ) from error
