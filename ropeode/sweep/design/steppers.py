"""The steppers of a sweep, in a form that travels to worker processes."""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ropeode.errors import InputError
from ropeode.files import read_bytes
from ropeode.steppers.base import Stepper
from ropeode.study.accuracy_table import check_steppers
from ropeode.sweep.design.content_hash import PACKAGES
from ropeode.validation import complaint


class StepperSource(NamedTuple):
    """Where a stepper comes from; each worker makes the stepper itself.

    Fields:
        given: the stepper's text in the spec, or a value that can be pickled.
        file: sha256 of the Python file that defines it; None for a stepper of a package whose
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
    steppers = _steppers(given, folder)
    return {
        stepper.label: StepperSource(each, file_digest(each, folder))
        for each, stepper in zip(given, steppers, strict=True)
    }


def stepper_from(source: StepperSource, folder: Path) -> Stepper:
    """The stepper of a source, in any process.

    Raises:
        InputError: its file is not the one that the sweep was started with.
    """
    if source.file != file_digest(source.given, folder):
        raise InputError(
            complaint(
                "stepper",
                source.given,
                "the same file in all processes, unchanged since the sweep was started",
                "start the sweep again",
            )
        )
    (stepper,) = _steppers([source.given], folder)
    return stepper


def _steppers(given: Sequence[Any], folder: Path) -> list[Stepper]:
    """The only place in this room where text becomes a stepper."""
    return check_steppers(given, folder)


def file_digest(given: Any, folder: Path) -> str | None:
    """The sha256 of the Python file that defines a stepper; None if a package does."""
    if (path := _file_of(given, folder)) is None:
        return None
    return hashlib.sha256(read_bytes("stepper", path)).hexdigest()


def _file_of(given: Any, folder: Path) -> Path | None:
    if isinstance(given, str):
        file = given if given.endswith(".py") else given.rpartition(":")[0]
        return folder / file if file.endswith(".py") else None
    definition = given if inspect.isroutine(given) or inspect.isclass(given) else type(given)
    if definition.__module__.partition(".")[0] in PACKAGES:
        return None
    try:
        return Path(inspect.getfile(definition))
    except (OSError, TypeError) as error:
        allowed = f"a stepper that is defined in a Python file ({error})"
        raise InputError(
            complaint("stepper", given, allowed, "write it in a file, and import it")
        ) from None
