"""Wrong programs around a right step: they write trajectories, which `ropeode grade` grades."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ropeode import grade
from ropeode.checking import CheckReport, convergence_problems
from tests.checking.mutants.mutant import Changes, Mutant, before, by_hand
from tests.checking.mutants.originals import trajectory

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


_FIRST = "    samples = [(t, x, v)]"
_COUNT = "        steps ="
_STEP = "            x, v = own_verlet(None, t, x, v, dt, args)"
_LEFT = "            x, v = own_verlet(None, t, x, v, left, args)"
_SAMPLE = "        samples.append((t, x, v))"
_NO_REST = "if left > 1e-12: -> if False:"


def writing(numbers: str) -> str:
    """The change that writes other numbers into a sample."""
    return f"samples.append((t, x, v)) -> samples.append(({numbers}))"


_TABLE: dict[str, Changes] = {
    "a step too many": "range(steps) -> range(steps + 1)",
    "a step too few": "range(steps) -> range(steps - 1)",
    "counted from 1": "range(steps) -> range(1, steps)",
    "last partial step skipped": _NO_REST,
    "last partial step a whole one": "x, v, left, args) -> x, v, dt, args)",
    "last partial step made twice": before(_LEFT, _LEFT.strip()),
    "steps rounded up": ("dt + 1e-9) -> dt + 0.999)", _NO_REST),
    "steps rounded": ("int((end - t) / dt + 1e-9) -> round((end - t) / dt)", _NO_REST),
    "steps a thousandth longer": "x, v, dt, args) -> x, v, 1.001 * dt, args)",
    "velocities lost at samples": before(_SAMPLE, "v = 0 * v"),
    "begins anew for each sample": before(_COUNT, "x, v = problem.y0"),
    "sample before the steps": (
        f"{_SAMPLE}\n -> ",
        before(_COUNT, "samples.append((end, x, v))"),
    ),
    "first sample after a step": before(_FIRST, _STEP.strip()),
    "all samples one array": (
        before(_SAMPLE, "samples[0][1][:], samples[0][2][:] = x, v"),
        writing("t, samples[0][1], samples[0][2]"),
    ),
    "old velocities written": (before(_STEP, "old = v"), writing("t, x, old")),
    "velocities halfway written": writing("t, x, v - dt / 2 * own_forces(x, v, args)"),
    "momenta written": writing("t, x, v * args.mass[:, None]"),
    "nodes from the other end": writing("t, x[::-1], v[::-1]"),
    "x and y swapped": writing("t, x[:, [1, 0, 2]], v[:, [1, 0, 2]]"),
    "frame late": (
        f"{_SAMPLE} -> {_SAMPLE.replace('x, v', '*last')}\n        last = x, v",
        before(_FIRST, "last = x, v"),
    ),
    "three digits written": writing("t, x.round(3), v.round(3)"),
    "Euler to begin with": (
        before(_FIRST, "first = True"),
        before(_STEP, "if first:", "    x, v, first = x + dt * v, v, False", "    continue"),
    ),
    "forces of the last frame": (
        f"{_STEP} ->             x, v = x + dt * v, v + dt * a",
        before(_COUNT, "a = own_forces(x, v, args)"),
    ),
}
LOOPS: tuple[Mutant, ...] = by_hand({trajectory: _TABLE})
