"""Answers as bytes: a length, a header in JSON, and the arrays in float32."""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from ropeode.laboratory.messages import Message

if TYPE_CHECKING:
    import numpy as np

# Little-endian, as JavaScript's typed arrays are on every machine that browsers run on.
_LENGTH, _FLOAT, FLOAT_BYTES = struct.Struct("<I"), "<f4", 4


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
    text += b" " * (-len(text) % FLOAT_BYTES)
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
