"""Every mutant, by name, and how it is checked."""

from __future__ import annotations

import functools
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ropeode import grade
from ropeode.checking import SLOW, CheckReport, convergence_problems
from ropeode.errors import InputError
from tests.checking.mutants.kept import IN_ARRAYS, KEPT
from tests.checking.mutants.mutant import BY_HAND, Mutant, by_hand
from tests.checking.mutants.rules import BY_RULE
from tests.checking.no_time_limit import check_stepper

# Wrong programs around a right step: they write trajectories, which `ropeode grade` grades.
LOOPS = by_hand("loops")
# Those that no check rejects, and why none has to.
SURVIVORS: dict[str, str] = BY_HAND["survivors"]
THRESHOLDS = (*by_hand("thresholds"), *IN_ARRAYS)
_ALL = (*by_hand("mistakes"), *by_hand("rare"), *KEPT, *LOOPS, *BY_RULE, *THRESHOLDS)
MUTANTS: dict[str, Mutant] = {mutant.name: mutant for mutant in _ALL}
assert len(MUTANTS) == len(_ALL), "two mutants have one name"

# Of programs: what leaves half a step over in each frame of half a time unit.
STEP_SIZES = tuple(0.5 / (steps + 0.5) for steps in (8, 12, 18, 27, 40))
# Stands for a stepper or program that is refused with exit code 2.
REFUSED = "refused"
# Rejects nothing unless a method is claimed.
UNCLAIMED = ("stability",)
# These need long runs, or compile a stepper again; they run only where others do not suffice.
AT_LAST = ("energy", "float32")
_ENOUGH = 2
# What these mutants do happens on no run of a check rope; the others run if none of these rejects.
FAR = ("purity", "pins", "time-shift", "thresholds")


def rejected_by(mutant: Mutant, only: Sequence[str] | None = None) -> list[str]:
    """The checks that reject a mutant, with all the claims of its original.

    Arguments:
        mutant: a stepper, checked by `check_stepper`, or a program, graded by `grade`.
        only: names of checks, for a stepper. By default all but those that cannot reject it run,
            and those in `AT_LAST` only if fewer than two others reject it, or none of quick mode.
    """
    return failed_of(report_on(mutant, only))


def failed_of(report: CheckReport | None) -> list[str]:
    """The checks that failed; `REFUSED` if there is no report."""
    if report is None:
        return [REFUSED]
    return [finding.check for finding in report.failed]


def report_on(
    mutant: Mutant, only: Sequence[str] | None = None, diagnose: bool = False
) -> CheckReport | None:
    """What `check_stepper` or `grade` reports of a mutant; None if they refuse it.

    Arguments:
        mutant: as for `rejected_by`.
        only: likewise.
        diagnose: whether to look for the cause, too.
    """
    try:
        if mutant.family == "trajectory loop":
            report = _graded(mutant, diagnose)
            return None if report.exit_code == 2 else report
        check = functools.partial(check_stepper, mutant.make(), diagnose=diagnose, **mutant.claims)
        if only is not None:
            return check(only=only)
        if mutant in THRESHOLDS and (report := check(only=FAR)).failed:
            return report
        report = check(skip=(*UNCLAIMED, *AT_LAST))
        failed = failed_of(report)
        if len(failed) >= _ENOUGH and not set(failed) <= set(SLOW):
            return report
        return check(skip=UNCLAIMED)
    except InputError:
        return None


def _graded(mutant: Mutant, diagnose: bool) -> CheckReport:
    problem, program, files = convergence_problems()["unequal"], mutant.make(), []
    with tempfile.TemporaryDirectory() as folder:
        for dt in STEP_SIZES:
            t, x, v = map(np.array, zip(*program(problem, dt), strict=True))
            files.append(Path(folder) / f"dt-{dt:.4f}.npz")
            np.savez(files[-1], t=t, positions=x, velocities=v, dt=dt)
        return grade(files, problem, diagnose=diagnose, **mutant.claims)
