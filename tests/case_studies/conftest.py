"""A report and a study that several tests look at, computed once."""

from __future__ import annotations

import pytest

from docs.studies.projection_sweeps import sweep_study
from ropeode.case_studies import rope_report
from ropeode.problems import InextensibleRope

CHEAP = (1, 4, 5, 8, 31, 36, 37)
FRAMES = 400


@pytest.fixture(scope="session")
def report():
    """Figures that take few steps, over `FRAMES` frames."""
    return rope_report(CHEAP, FRAMES)


@pytest.fixture(scope="session")
def study():
    """One sweep of constraint Verlet and three, on a small rope of unequal masses."""
    rope = InextensibleRope(end=(-3.0, 199.0), num_nodes=5, node_mass=(1, 2, 1, 0.5, 1))
    return sweep_study(rope.problem(3), (1, 3), (64, 96, 144, 216, 324))
