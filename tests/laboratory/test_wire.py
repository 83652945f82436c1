"""Answers as bytes, and back."""

from __future__ import annotations

import json
import struct

import numpy as np

from ropeode.laboratory import decoded, encoded
from ropeode.laboratory.messages import Phase


def test_an_answer_comes_back_as_it_was():
    message = Phase(every=2, x_label="größe", v_label="v")
    arrays = {
        "x": np.arange(6.0).reshape(2, 3) / 3,
        "v": np.zeros((0, 2)),
        "big": np.array([1e300]),
    }
    contents = encoded("k", message, arrays)
    (length,) = struct.unpack_from("<I", contents)
    assert length % 4 == 0
    assert json.loads(contents[4 : 4 + length])["arrays"] == {
        "x": [0, [2, 3]],
        "v": [6, [0, 2]],
        "big": [6, [1]],
    }
    header, back = decoded(contents)
    assert header == {"key": "k", **message.model_dump()}
    assert back["x"].dtype == np.float32
    np.testing.assert_array_equal(back["x"], arrays["x"].astype(np.float32))
    assert back["v"].shape == (0, 2)
    assert back["big"][0] == np.inf
