"""What the worker says to the server alone, and the check of all that it says."""

from __future__ import annotations

import math
import struct
from typing import Any, Literal

from pydantic import TypeAdapter

from ropeode.laboratory.messages import Message, OwnStepper
from ropeode.laboratory.wire import FLOAT_BYTES, header_of


class Ready(Message):
    """The worker is ready, and the page is opened with this link."""

    kind: Literal["ready"] = "ready"
    link: dict[str, Any]


class Stopped(Message):
    """A question was left off, since nobody wants it any more."""

    kind: Literal["stopped"] = "stopped"


class Loaded(Message):
    """What became of a version of the user's file: its steppers, and the files that it imports."""

    kind: Literal["loaded"] = "loaded"
    own: tuple[OwnStepper, ...]
    files: tuple[str, ...]


# By its kind, what a worker may say.
_KINDS = {
    each.model_fields["kind"].default: each
    for each in Message.__subclasses__()
    if "kind" in each.model_fields
}
_ARRAYS = TypeAdapter(dict[str, tuple[int, list[int]]])


def checked_header(contents: bytes) -> dict[str, Any]:
    """The header of what a worker has said, in whose process any code may have written.

    Raises:
        ValueError: it is no message.
    """
    try:
        header, begin = header_of(contents)
        kind = _KINDS[header["kind"]]
        # What `wire.encoded` adds to all.
        added = {"key", "arrays"} - {*kind.model_fields}
        kind.model_validate({name: each for name, each in header.items() if name not in added})
        numbers = (len(contents) - begin) // FLOAT_BYTES
        for start, shape in _ARRAYS.validate_python(header["arrays"]).values():
            if min(start, *shape, 0) < 0 or start + math.prod(shape) > numbers:
                raise ValueError("an array that is not there")
        if not isinstance(header["key"], str):
            raise ValueError("no key")
    except (struct.error, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"{type(error).__name__}: {error}") from None
    return header
