"""What becomes of a question: an answer, a refusal, or nothing where nobody wants it any more."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from ropeode.errors import RopeodeError, UserCodeError
from ropeode.laboratory.messages import Refused
from ropeode.progress import Progress
from ropeode.validation import in_one_line, shortly

if TYPE_CHECKING:
    from ropeode.laboratory.answers import Answer

_PROGRESS_EVERY_S = 0.1


class NotWanted(BaseException):
    """Ends the work; not an `Exception`, which it might catch."""


def reply(
    work: Callable[[Progress], Answer],
    is_wanted: Callable[[], bool],
    tell: Callable[[str], None],
    path: Path | None = None,
) -> Answer | None:
    """The answer to a question, or why it has none.

    Arguments:
        work: computes it, with progress that leaves the work off when nobody wants it any more.
        is_wanted: whether somebody does.
        tell: called now and then with what is being done.
        path: of the user's file; a refusal names the line in it that raised.

    Returns:
        None if the work was left off.
    """
    told = 0.0

    def progress(text: str, fraction: float | None) -> None:
        nonlocal told
        if not is_wanted():
            raise NotWanted
        if time.monotonic() - told > _PROGRESS_EVERY_S:
            told = time.monotonic()
            tell(text)

    try:
        progress("", None)
        return work(progress)
    except NotWanted:
        return None
    except RopeodeError as error:
        return Refused(message=in_words(error), line=line_of(error, path)), {}
    except Exception as error:
        traceback.print_exc()
        why = f"{in_one_line(error)}: a fault of ropeode; please report it."
        return Refused(message=why), {}


def in_words(error: RopeodeError) -> str:
    """What went wrong, in a sentence."""
    if isinstance(error, UserCodeError) and error.__cause__ is not None:
        what = error.problems[0].partition(":")[0]
        return f"{what}: your code raised {shortly(error.__cause__)}"
    return str(error)


def line_of(error: RopeodeError, path: Path | None) -> int | None:
    """The line of a file in which an exception was raised, if it was."""
    # In a file that is imported, the line that imports it.
    lines = [line for file, line in places_of(error) if file == str(path)]
    return lines[-1] if lines else None


def places_of(error: RopeodeError) -> list[tuple[str, int | None]]:
    """Files and lines that an exception went through, the innermost last."""
    cause = error.__cause__
    frames = traceback.extract_tb(cause.__traceback__) if cause else ()
    places = [(frame.filename, frame.lineno) for frame in frames]
    if isinstance(cause, SyntaxError) and cause.filename:
        places.append((cause.filename, cause.lineno))
    return places
