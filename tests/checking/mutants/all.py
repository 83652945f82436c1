"""Every mutant, by name, and how it is checked."""

from __future__ import annotations

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
    try:
        if mutant.family == "trajectory loop":
            report = _graded(mutant)
            return [REFUSED] if report.exit_code == 2 else _failed(report)
        if only is not None:
            return _failed(_checked(mutant, only=only))
        if mutant in THRESHOLDS and (failed := _failed(_checked(mutant, only=FAR))):
            return failed
        failed = _failed(_checked(mutant, skip=(*UNCLAIMED, *AT_LAST)))
        if len(failed) >= _ENOUGH and not set(failed) <= set(SLOW):
            return failed
        return _failed(_checked(mutant, skip=UNCLAIMED))
    except InputError:
        return [REFUSED]


def _graded(mutant: Mutant) -> CheckReport:
    problem, program, files = convergence_problems()["unequal"], mutant.make(), []
    with tempfile.TemporaryDirectory() as folder:
        for dt in STEP_SIZES:
            t, x, v = map(np.array, zip(*program(problem, dt), strict=True))
            files.append(Path(folder) / f"dt-{dt:.4f}.npz")
            np.savez(files[-1], t=t, positions=x, velocities=v, dt=dt)
        return grade(files, problem, diagnose=False, **mutant.claims)


def _checked(mutant: Mutant, **chosen: Sequence[str]) -> CheckReport:
    return check_stepper(mutant.make(), diagnose=False, **chosen, **mutant.claims)


def _failed(report: CheckReport) -> list[str]:
    return [finding.check for finding in report.failed]
