"""Wrong programs around a right step: they write trajectories, which `ropeode grade` grades."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ropeode import grade
from ropeode.checking import CheckReport, convergence_problems
from tests.checking.mutants.mutant import Mutant, by_hand

# Step sizes that leave half a step over in each frame of half a time unit.
STEP_SIZES = tuple(0.5 / (steps + 0.5) for steps in (8, 12, 18, 27, 40))


def graded(mutant: Mutant, folder: Path, **options: bool) -> CheckReport:
    """The report on the trajectories that a program writes.

    Arguments:
        mutant: whose program it is.
        folder: where to write.
        options: of `grade`.
    """
    problem = convergence_problems()["unequal"]
    program, files = mutant.make(), []
    for dt in STEP_SIZES:
        times, xs, vs = zip(*program(problem, dt), strict=True)
        files.append(folder / f"dt-{dt:.4f}.npz")
        np.savez(
            files[-1], t=np.array(times), positions=np.array(xs), velocities=np.array(vs), dt=dt
        )
    return grade(files, problem, **mutant.claims, **options)


LOOPS: tuple[Mutant, ...] = by_hand("loops")
