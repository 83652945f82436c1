"""What becomes of a question: an answer, a refusal, or nothing where nobody wants it any more."""

from __future__ import annotations

import time
import traceback
from collections.abc import Callable
from typing import TYPE_CHECKING

from ropeode.errors import RopeodeError
from ropeode.laboratory.messages import Refused
from ropeode.progress import Progress
from ropeode.validation import in_one_line

if TYPE_CHECKING:
    from ropeode.laboratory.answers import Answer

_PROGRESS_EVERY_S = 0.1


class NotWanted(BaseException):
    """Ends the work; not an `Exception`, which it might catch."""


def reply(
    work: Callable[[Progress], Answer],
    is_wanted: Callable[[], bool],
    tell: Progress,
    refusal: Callable[[RopeodeError], Refused],
) -> Answer | None:
    """The answer to a question, or why it has none.

    Arguments:
        work: computes it, with progress that leaves the work off when nobody wants it any more.
        is_wanted: whether somebody does.
        tell: called now and then with what is being done and the fraction that is done.
        refusal: what is said of a question that cannot be answered.

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
            tell(text, fraction)

    try:
        progress("", None)
        return work(progress)
    except NotWanted:
        return None
    except RopeodeError as error:
        return refusal(error), {}
    except Exception as error:
        traceback.print_exc()
        why = f"{in_one_line(error)}: a fault of ropeode; please report it."
        return Refused(message=why), {}
