"""Convergence to the right solution, and its order."""

from __future__ import annotations

import dataclasses

from ropeode.grading.convergence import convergence_finding
from ropeode.grading.examination import Examination
from ropeode.grading.problems import convergence_problems
from ropeode.grading.report import Finding


def order(examination: Examination, problem: str) -> Finding:
    """The observed order on one of `convergence_problems`, against its certified reference.

    Arguments:
        examination: of the stepper.
        problem: the problem's name.
    """
    check = f"order-{problem}"
    if refusal := examination.refusal(convergence_problems()[problem]):
        return Finding(check, "skip", refusal)
    found = convergence_finding(check, examination.convergence(problem))
    if examination.problem(problem) is convergence_problems()[problem]:
        return found
    return dataclasses.replace(found, line=f"{found.line} (no drive: it computes its own forces)")
