"""Convergence to the right solution, and its observed order."""

from __future__ import annotations

import dataclasses

import numpy as np

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import convergence_problems
from ropeode.checking.convergence import (
    convergence_finding,
    falls_too_slowly,
    finest_is_unstable,
)
from ropeode.checking.report import Finding


def order(examination: Examination, problem: str) -> Finding:
    """The observed order on one of `convergence_problems`, against its certified reference."""
    check = f"order-{problem}"
    if refusal := examination.refusal(convergence_problems()[problem]):
        return Finding(check, "skip", refusal)
    convergence = examination.convergence(problem)
    finding = convergence_finding(check, convergence)
    if finding.status == "undetermined":
        # On these ropes every convergent method is stable with the smallest step, and asymptotic.
        finest = f"dt = {convergence.dts[-1]:.2g}"
        if finest_is_unstable(convergence):
            line = f"{finding.line}; even with {finest} the run blows up"
            finding = dataclasses.replace(finding, status="fail", line=line)
        elif falls_too_slowly(convergence):
            line = f"{finding.line}; up to {finest} all errors together fall too slowly"
            finding = dataclasses.replace(finding, status="fail", line=line)
    whole, solved = convergence_problems()[problem], examination.problems[problem]
    left_out = [
        f"no {force}: {why}"
        for force, why in examination.cannot_be_told.items()
        if not np.array_equal(getattr(whole.args, force), getattr(solved.args, force))
    ]
    if not left_out:
        return finding
    return dataclasses.replace(finding, line=f"{finding.line} ({'; '.join(left_out)})")
