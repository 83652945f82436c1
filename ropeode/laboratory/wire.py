"""Answers as bytes: a length, a header in JSON, and the arrays in float32."""

from __future__ import annotations

import json
import math
import struct
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, Literal

from pydantic import TypeAdapter

from ropeode.laboratory.messages import Message, OwnStepper

if TYPE_CHECKING:
    import numpy as np

# Little-endian, as JavaScript's typed arrays are on every machine that browsers run on.
_LENGTH, _FLOAT, _FLOAT_BYTES = struct.Struct("<I"), "<f4", 4


def encoded(key: str, message: Message, arrays: Mapping[str, np.ndarray]) -> bytes:
    """An answer as bytes.

    ``[length of the header, uint32][header in JSON, padded to 4 bytes][numbers in float32]``. The
    header is the message with ``key``, and with ``arrays``: for each name where its numbers begin,
    counted in numbers, and its shape.

    Arguments:
        key: of the question.
        message: the answer.
        arrays: by name; what float32 cannot hold becomes infinite.
    """
    # Not above: the server hands answers on, and starts without NumPy.
    import numpy as np

    with np.errstate(over="ignore"):
        numbers = {name: np.asarray(each, _FLOAT) for name, each in arrays.items()}
    places, begin = {}, 0
    for name, each in numbers.items():
        places[name] = [begin, list(each.shape)]
        begin += each.size
    header = {**message.model_dump(mode="json"), "key": key, "arrays": places}
    return b"".join([_packed(header), *(each.tobytes() for each in numbers.values())])


def _packed(header: Mapping[str, Any]) -> bytes:
    text = json.dumps(header, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % _FLOAT_BYTES)
    return _LENGTH.pack(len(text)) + text


def header_of(contents: bytes) -> tuple[dict[str, Any], int]:
    """The header of `encoded` bytes, and where the arrays begin."""
    (length,) = _LENGTH.unpack_from(contents)
    begin = _LENGTH.size + length
    return json.loads(contents[_LENGTH.size : begin]), begin


def with_key(key: str, contents: bytes) -> bytes:
    """The same answer, to a question with another key."""
    header, begin = header_of(contents)
    return _packed({**header, "key": key}) + contents[begin:]


def decoded(contents: bytes) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """The header of `encoded` bytes, without ``arrays``, and the arrays in float32."""
    import numpy as np

    header, begin = header_of(contents)
    numbers = np.frombuffer(contents, _FLOAT, offset=begin)
    arrays = {
        name: numbers[start : start + int(np.prod(shape))].reshape(shape)
        for name, (start, shape) in header.pop("arrays").items()
    }
    return header, arrays


# ---- what the worker says to the server alone, and the check of all that it says


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
        # What `encoded` adds to all.
        added = {"key", "arrays"} - {*kind.model_fields}
        kind.model_validate({name: each for name, each in header.items() if name not in added})
        numbers = (len(contents) - begin) // _FLOAT_BYTES
        for start, shape in _ARRAYS.validate_python(header["arrays"]).values():
            if min(start, *shape, 0) < 0 or start + math.prod(shape) > numbers:
                raise ValueError("an array that is not there")
        if not isinstance(header["key"], str):
            raise ValueError("no key")
    except (struct.error, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ValueError(f"{type(error).__name__}: {error}") from None
    return header
