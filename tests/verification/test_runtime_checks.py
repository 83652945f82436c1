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
import sys
from equinox._config import EQX_ON_ERROR
from ropeode.problems.rope import Rope
from ropeode import reference
print(EQX_ON_ERROR, file=sys.stderr)
known = reference(Rope(num_nodes=4).problem(frames=3))
print(known.states.tobytes().hex(), known.bound().tobytes().hex())
"""


@pytest.mark.slow
def test_they_change_no_bit_of_a_reference():
    done = subprocess.run(
        [sys.executable, "-c", CODE],
        capture_output=True,
        text=True,
        check=True,
        timeout=HANGS_AFTER_S,
        env={**os.environ, "EQX_ON_ERROR": "raise"},
    )
    here = reference(Rope(num_nodes=4).problem(frames=3))
    assert done.stderr == "raise\n"
    assert done.stdout.split() == [here.states.tobytes().hex(), here.bound().tobytes().hex()]
