"""Wrong programs around a right step: they write trajectories, which `ropeode grade` grades."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ropeode import grade
from ropeode.checking import CheckReport, convergence_problems
from tests.checking.mutants.mutant import Mutant, replaced
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


_STEP = "            x, v = own_verlet(None, t, x, v, dt, args)\n"
_LEFT = "            x, v = own_verlet(None, t, x, v, left, args)\n"
_SAMPLE = "        samples.append((t, x, v))\n"

LOOPS: tuple[Mutant, ...] = (
    replaced(trajectory, "a step too many", ("range(steps)", "range(steps + 1)")),
    replaced(trajectory, "a step too few", ("range(steps)", "range(steps - 1)")),
    replaced(trajectory, "counted from 1", ("range(steps)", "range(1, steps)")),
    replaced(trajectory, "last partial step skipped", ("if left > 1e-12:", "if False:")),
    replaced(trajectory, "last partial step a whole one", ("x, v, left, args)", "x, v, dt, args)")),
    replaced(
        trajectory,
        "last partial step made twice",
        (_LEFT, _LEFT + _LEFT),
    ),
    replaced(
        trajectory,
        "steps rounded up",
        ("int((end - t) / dt + 1e-9)", "int((end - t) / dt + 0.999)"),
        ("if left > 1e-12:", "if False:"),
    ),
    replaced(
        trajectory,
        "steps rounded",
        ("int((end - t) / dt + 1e-9)", "round((end - t) / dt)"),
        ("if left > 1e-12:", "if False:"),
    ),
    replaced(
        trajectory,
        "steps a thousandth longer",
        ("x, v, dt, args)", "x, v, 1.001 * dt, args)"),
    ),
    replaced(trajectory, "velocities lost at samples", (_SAMPLE, "        v = 0 * v\n" + _SAMPLE)),
    replaced(
        trajectory,
        "begins anew for each sample",
        ("        steps =", "        x, v = problem.y0\n        steps ="),
    ),
    replaced(
        trajectory,
        "sample before the steps",
        (_SAMPLE, ""),
        ("        steps =", "        samples.append((end, x, v))\n        steps ="),
    ),
    replaced(
        trajectory,
        "first sample after a step",
        (
            "    samples = [(t, x, v)]\n",
            "    x, v = own_verlet(None, t, x, v, dt, args)\n    samples = [(t, x, v)]\n",
        ),
    ),
    replaced(
        trajectory,
        "all samples one array",
        (
            _SAMPLE,
            "        samples[0][1][:], samples[0][2][:] = x, v\n"
            "        samples.append((t, samples[0][1], samples[0][2]))\n",
        ),
    ),
    replaced(
        trajectory,
        "old velocities written",
        (_STEP, "            old = v\n" + _STEP),
        (_SAMPLE, "        samples.append((t, x, old))\n"),
    ),
    replaced(
        trajectory,
        "velocities halfway written",
        (_SAMPLE, "        samples.append((t, x, v - dt / 2 * own_forces(x, v, args)))\n"),
    ),
    replaced(
        trajectory,
        "momenta written",
        (_SAMPLE, "        samples.append((t, x, v * args.mass[:, None]))\n"),
    ),
    replaced(
        trajectory,
        "nodes from the other end",
        (_SAMPLE, "        samples.append((t, x[::-1], v[::-1]))\n"),
    ),
    replaced(
        trajectory,
        "x and y swapped",
        (_SAMPLE, "        samples.append((t, x[:, [1, 0, 2]], v[:, [1, 0, 2]]))\n"),
    ),
    replaced(
        trajectory,
        "frame late",
        (_SAMPLE, "        samples.append((t, *last))\n        last = x, v\n"),
        ("    samples = [(t, x, v)]\n", "    samples, last = [(t, x, v)], (x, v)\n"),
    ),
    replaced(
        trajectory,
        "three digits written",
        (_SAMPLE, "        samples.append((t, x.round(3), v.round(3)))\n"),
    ),
    replaced(
        trajectory,
        "Euler to begin with",
        ("    samples = [(t, x, v)]\n", "    samples = [(t, x, v)]\n    first = True\n"),
        (
            _STEP,
            "            if first:\n"
            "                x, v, first = x + dt * v, v, False\n"
            "                continue\n" + _STEP,
        ),
    ),
    replaced(
        trajectory,
        "forces of the last frame",
        (_STEP, "            x, v = x + dt * v, v + dt * a\n"),
        ("        steps =", "        a = own_forces(x, v, args)\n        steps ="),
    ),
)
