"""Questions and their answers: a function for each kind, of the same name."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from ropeode.laboratory.messages import Ask, Message
from ropeode.progress import Progress, shows_progress

if TYPE_CHECKING:
    from ropeode.laboratory.setup import Laboratory

Answer = tuple[Message, Mapping[str, np.ndarray]]

# The file that answers a kind of question, where it has another name.
_FILES = {
    **dict.fromkeys(("truth", "run", "order", "phase"), "motions"),
    **dict.fromkeys(("theory", "stability"), "predictions"),
    **dict.fromkeys(("check", "grade"), "reports"),
}


def answer_to(ask: Ask, laboratory: Laboratory, progress: Progress) -> Answer:
    """The answer to a question, which depends on the question alone.

    Arguments:
        ask: the question.
        laboratory: what was computed for earlier ones.
        progress: called with what is being done and the fraction that is done; what it raises
            ends the work.

    Returns:
        The answer, and its arrays by name.

    Raises:
        InputError: the question names something that does not exist, or asks for too much.
        UserCodeError: the user's own code raised.
        ReferenceRefused: the problem has no reference.
    """
    return _answer(ask, laboratory, progress=progress)


# What runs inside shows no bar of its own, in a notebook either.
@shows_progress
def _answer(ask: Ask, laboratory: Laboratory, *, progress: Progress) -> Answer:
    # Imported when the first of the kind is asked.
    file = importlib.import_module(f"{__name__}.{_FILES.get(ask.kind, ask.kind)}")
    return getattr(file, ask.kind)(ask, laboratory, progress)
