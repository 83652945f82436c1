"""The steppers of a sweep, in a form that travels to worker processes."""

from __future__ import annotations

import functools
import inspect
from pathlib import Path
from typing import Any, NamedTuple

from ropeode.steppers import Stepper, as_stepper, users_file
from ropeode.study import check_steppers
from ropeode.sweep.design.content_hash import PACKAGES, file_digest
from ropeode.validation import bad_value


class StepperSource(NamedTuple):
    """Where a stepper comes from; each worker makes the stepper itself.

    Fields:
        given: the stepper's text in the spec, or a value that can be pickled.
        file: sha256 of the user's file that defines it; None for a stepper of a package whose
            version is part of every key.
    """

    given: Any
    file: str | None


def stepper_sources(given: Any, folder: Path) -> dict[str, StepperSource]:
    """The sources of steppers, by the label of each.

    Arguments:
        given: one or several texts, or values that can be pickled.
        folder: from which relative file names start.

    Raises:
        InputError: one line for each that is not a stepper or is repeated.
    """
    given = [*given] if isinstance(given, (list, tuple)) else [given]
    steppers = check_steppers(given, folder)
    return {
        stepper.label: StepperSource(each, stepper_digest(each, folder))
        for each, stepper in zip(given, steppers, strict=True)
    }


def stepper_from(source: StepperSource, folder: Path) -> Stepper:
    """The stepper of a source, in any process.

    Raises:
        InputError: its file is not the one that the sweep was started with.
    """
    given, file = source
    if file != stepper_digest(given, folder):
        allowed = "the same file in all processes, unchanged since the sweep was started"
        raise bad_value("stepper", given, allowed, "start the sweep again")
    return _by_text(given, folder, file) if isinstance(given, str) else as_stepper(given)


@functools.lru_cache(maxsize=64)
def _by_text(text: str, folder: Path, file: str | None) -> Stepper:
    """Cached, so that a user's file runs once for all tasks of a process, unless it changes."""
    del file
    return as_stepper(text, folder=folder)


def stepper_digest(given: Any, folder: Path) -> str | None:
    """The sha256 of the user's file that defines a stepper; None if a package does.

    Arguments:
        given: as for `stepper_sources`.
        folder: likewise.

    Raises:
        InputError: there is no such file.
    """
    if isinstance(given, str):
        file = users_file(given.strip())
        return None if file is None else file_digest("stepper", folder / file)
    definition = given if inspect.isroutine(given) or inspect.isclass(given) else type(given)
    if definition.__module__.partition(".")[0] in PACKAGES:
        return None
    try:
        return file_digest("stepper", Path(inspect.getfile(definition)))
    except (OSError, TypeError) as error:
        allowed = f"a stepper that is defined in a Python file ({error})"
        fix = "write it in a file, and import it"
        raise bad_value("stepper", given, allowed, fix) from None
