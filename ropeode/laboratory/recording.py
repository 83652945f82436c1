"""A recording: questions with their answers, which a page can play without Python."""

from __future__ import annotations

import base64
import json
from collections.abc import Iterable, Iterator
from typing import Any

from pydantic import TypeAdapter

from ropeode.errors import RopeodeError
from ropeode.laboratory import wire
from ropeode.laboratory.answers import answer_to
from ropeode.laboratory.messages import Ask, Refused
from ropeode.laboratory.setup import Laboratory
from ropeode.progress import Progress, part_of

_ASKS: TypeAdapter[Ask] = TypeAdapter(Ask)


def recorded(asks: Iterable[Ask], laboratory: Laboratory, progress: Progress) -> str:
    """The answers to questions, as the text of a JSON file.

    A list of ``{"ask": the question, "wire": the answer's bytes in base64}``, as
    `ropeode.laboratory.wire` makes them, without a key. What is refused is recorded as such.

    Arguments:
        asks: the questions.
        laboratory: answers them.
        progress: called with what is being done and the fraction that is done.
    """
    whole, entries = list(asks), []
    for index, ask in enumerate(whole):
        part = part_of(progress, index / len(whole), (index + 1) / len(whole))
        try:
            contents = wire.encoded("", *answer_to(ask, laboratory, part))
        except RopeodeError as error:
            contents = wire.encoded("", Refused(message=str(error)), {})
        question = ask.model_dump(mode="json", exclude_none=True)
        entries.append({"ask": question, "wire": base64.b64encode(contents).decode()})
    progress("done", 1.0)
    lines = ",\n".join(json.dumps(each, separators=(",", ":")) for each in entries)
    return f"[\n{lines}\n]\n"


def answers_in(recording: str) -> Iterator[tuple[Ask, dict[str, Any], dict[str, Any]]]:
    """Each question of a recording, with the header and the arrays of its answer."""
    for each in json.loads(recording):
        header, arrays = wire.decoded(base64.b64decode(each["wire"]))
        yield _ASKS.validate_python(each["ask"]), header, arrays
