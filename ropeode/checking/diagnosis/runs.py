"""Runs that are made to find a cause."""

from __future__ import annotations

from collections.abc import Sequence

from ropeode.checking.candidate import Candidate
from ropeode.checking.diagnosis.equation import Runs
from ropeode.problems.problem import Problem
from ropeode.simulation.trajectory import step_size

# Steps per frame of the runs that are extrapolated.
STEPS = (8, 12, 16, 24, 32, 48, 64, 96)


def runs_of(candidate: Candidate, problem: Problem, steps: Sequence[int] = STEPS) -> Runs:
    """Step sizes and states of a candidate's runs.

    Arguments:
        candidate: whose.
        problem: to run on.
        steps: per frame.
    """
    return [(step_size(problem, n), candidate.run(problem, n)) for n in steps]
