"""The checks of Equinox at run time, which commands and tests leave out, change no number."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest

from ropeode import reference
from ropeode.problems import Rope
from tests.time_limit import HANGS_AFTER_S

CODE = """
from equinox._config import EQX_ON_ERROR
from tests.verification.test_runtime_checks import bits
print(EQX_ON_ERROR, *bits())
"""


def bits():
    known = reference(Rope(num_nodes=4).problem(frames=3))
    return known.states.tobytes().hex(), known.bound().tobytes().hex()


@pytest.mark.slow
def test_they_change_no_bit_of_a_reference():
    settings = {**os.environ, "EQX_ON_ERROR": "raise"}
    command = [sys.executable, "-c", CODE]
    done = subprocess.check_output(command, text=True, timeout=HANGS_AFTER_S, env=settings)
    assert done.split() == ["raise", *bits()]
