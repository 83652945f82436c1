"""A problem whose exact solution is known, with errors and costs of one's own choice."""

from __future__ import annotations

import numpy as np
import pytest

from ropeode import Problem
from tests.exact_reference import exact_reference


def cubic(t, y, args):
    return -100 * y**3


@pytest.fixture(scope="session")
def decay():
    """y' = -100 y^3, in which long steps blow up; the exact solution is 1/sqrt(1 + 200 t)."""
    problem = Problem(cubic, [1.0], np.arange(4.0), name="decay")
    states = 1.0 / np.sqrt(1.0 + 200.0 * problem.ts[:, None])
    return exact_reference(problem, states)
