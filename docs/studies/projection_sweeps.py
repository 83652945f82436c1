"""Is one sweep of length projection enough, although each projection spoils the one before?"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence

import numpy as np

from ropeode.analysis import ObservedOrder
from ropeode.errors import InputError
from ropeode.problems import InextensibleRope, Problem
from ropeode.progress import Progress, silent
from ropeode.references import Reference
from ropeode.simulation import simulate
from ropeode.steppers import ConstraintVerlet
from ropeode.study import check_steps
from ropeode.study.accuracy_table import accuracy_table
from ropeode.validation import complaint

SWEEPS = (1, 2, 4, 16, 64)
STEPS_PER_FRAME = (16, 32, 64, 128, 256, 512, 1024, 2048)


@dataclasses.dataclass(frozen=True)
class Swept:
    """Constraint Verlet with one number of sweeps.

    Arguments:
        sweeps: over the links in each step.
        steps_per_frame: of each run.
        dts: step size of each run.
        errors: largest distance from the certified reference in each run; None where it
            diverged or the reference cannot resolve it.
        violations: largest part of its length by which a link is off in a sample of each run.
        order: observed from the errors.
        constant: error over step size in the finest run that the order rests on, in length
            units per frame; None where there is no order.
    """

    sweeps: int
    steps_per_frame: tuple[int, ...]
    dts: tuple[float, ...]
    errors: tuple[float | None, ...]
    violations: tuple[float, ...]
    order: ObservedOrder
    constant: float | None


@dataclasses.dataclass(frozen=True, eq=False)
class SweepStudy:
    """Constraint Verlet with several numbers of sweeps, compared with one reference.

    Arguments:
        reference: of the inextensible rope.
        swept: one for each number of sweeps.
    """

    reference: Reference
    swept: tuple[Swept, ...]


def sweep_study(
    problem: Problem | None = None,
    sweeps: Sequence[int] = SWEEPS,
    steps_per_frame: Sequence[int] = STEPS_PER_FRAME,
    *,
    progress: Progress = silent,
) -> SweepStudy:
    """Order, error constant and broken lengths for each number of sweeps.

    Arguments:
        problem: an inextensible rope; by default the default one over 20 frames.
        sweeps: numbers of sweeps.
        steps_per_frame: numbers of steps per frame.
        progress: called with what is being done and the fraction that is done.

    Raises:
        InputError: an argument cannot be used.
        ReferenceRefused: no reference can be had for the problem.
    """
    rope = InextensibleRope().problem(20) if problem is None else problem
    if not rope.rigid:
        allowed = "an inextensible rope, which these steppers are for"
        fix = "build it with InextensibleRope"
        raise InputError(complaint("problem", rope.name, allowed, fix))
    counts, steps = check_steps(sweeps), tuple(check_steps(steps_per_frame))
    steppers = [ConstraintVerlet(sweeps=count) for count in counts]
    table = accuracy_table(rope, steppers, steps, progress=progress)
    swept = []
    for count, stepper, each in zip(counts, steppers, table.orders, strict=True):
        rows = [row for row in table.rows if row.stepper == stepper.label]
        best = next((row for row in rows if each.order.used[-1:] == (row.dt,)), None)
        swept.append(
            Swept(
                sweeps=count,
                steps_per_frame=steps,
                dts=tuple(row.dt for row in rows),
                errors=tuple(row.error_max for row in rows),
                violations=tuple(_violation(rope, stepper, each_steps) for each_steps in steps),
                order=each.order,
                constant=best.error_max / best.dt if best and best.error_max else None,
            )
        )
    return SweepStudy(table.reference, tuple(swept))


def _violation(problem: Problem, stepper: ConstraintVerlet, steps: int) -> float:
    """The largest relative error of a link's length at any sample."""
    length = np.asarray(problem.args.rest_length)
    gaps = np.diff(simulate(problem, stepper, steps).positions, axis=1)
    return float(np.max(np.abs(np.linalg.norm(gaps, axis=2) / length - 1.0)))
