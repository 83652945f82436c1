"""The methods of ropeode whose numbers are those in files, on any problem."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np

from ropeode.analysis import distances, largest_distance, moved
from ropeode.checking.convergence import PLURAL
from ropeode.checking.diagnosis.methods import VERLET_START
from ropeode.checking.report import Diagnosis
from ropeode.checking.trajectories.convergence import first_frames, worst_rounding
from ropeode.checking.trajectories.layout import samples_of
from ropeode.checking.trajectories.run_files import Run, finite
from ropeode.norms import NORMS
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.problems.nested_jaxprs import equations
from ropeode.progress import silent
from ropeode.references import Reference
from ropeode.simulation import run_in_python, simulate, step_size
from ropeode.steppers import as_stepper
from ropeode.study import problem_class
from ropeode.validation import listed

# What courses teach and games use.
FIRST = (
    "explicit-euler",
    "semi-implicit-euler",
    "stormer-verlet",
    "velocity-verlet",
    "rk4",
    "constraint-verlet",
    "rattle",
)
# Tried in turn; each only if it is none of those before.
_LIKELY = (
    (*FIRST, "stormer-verlet:start=rest", "constraint-verlet:start=rest"),
    ("heun", "midpoint", "ralston2", "ralston3"),
    ("stormer-verlet:damping=lagged", "stormer-verlet:start=rest,damping=lagged"),
    ("leapfrog:damping=explicit", "leapfrog:form=drift-kick-drift,damping=explicit"),
)
# Positions are like those of a stepper if they differ by this part of their errors, or by rounding,
# and begin so if they do by that part. They are the same if they differ by this part of the motion
# and of their errors.
_ALIKE, _BEGINS, _SAME, _OF_ERRORS = 0.01, 0.1, 1e-9, 1e-3
# The first frame tells most steppers apart. Up to so many steps, Python has it before a run is
# compiled.
MOST_IN_PYTHON = 2048
# How far from a whole number the steps in a frame may be, by rounding of dt.
WHOLE = 1e-3


@functools.lru_cache(maxsize=64)
def run_as(name: str, problem: Problem, steps: int, columns: int) -> Run | None:
    """The run of a stepper in the place of the program; None if it diverges.

    Arguments:
        name: of the stepper.
        problem: that it solves.
        steps: per frame.
        columns: of the program's runs, which have velocities or not.
    """
    made = simulate(problem, name, steps, progress=silent)
    if made.status != "ok":
        return None
    values = samples_of(problem, made.states)[:, :, :columns]
    return Run(problem, Path(f"{steps}.csv"), made.dt, values, step_size(problem, 1))


@functools.lru_cache(maxsize=64)
@in_float64
def _first_frame(name: str, problem: Problem, steps: int) -> np.ndarray:
    """The states ``(2, *state)`` of a stepper at its ends, with so many steps in it."""
    first = problem.changed(ts=problem.ts[:2], exact=None)
    states, *_ = run_in_python(first, as_stepper(name).on(first.structure), steps, math.inf, silent)
    return states


def steps_per_frame(runs: Sequence[Run]) -> list[int]:
    """Those of runs, rounded up."""
    one = step_size(runs[0].problem, 1)
    return [math.ceil(one / run.dt - WHOLE) for run in runs]


def matching(
    reference: Reference,
    runs: Sequence[Run],
    match: Callable[[str, Iterator[tuple[Run, Run | None]]], Any],
    part: float = _BEGINS,
) -> dict[str, Any]:
    """The steppers that match runs; those are tried first that most people write.

    Arguments:
        reference: of the problem.
        runs: from coarse to fine.
        match: what is found of a stepper, from its name and runs, each with that of the stepper.
        part: of the errors in the first frame, by which a stepper may differ there, unless Python
            would take long to compute it.
    """
    # Much of what single precision leaves of a run is rounding, as no stepper has it.
    if not runs or any(run.single for run in runs):
        return {}
    problem, first = reference.problem, runs[0]
    counts, one = steps_per_frame(runs), step_size(problem, 1)
    if any(abs(one / run.dt - n) > WHOLE for run, n in zip(runs, counts, strict=True)):
        return {}
    # Loops, as rigid links have them, are compiled each on its own.
    slow = counts[0] > MOST_IN_PYTHON or bool(operations(problem) & {"scan", "while"})
    kind = problem_class(problem)
    for names in _LIKELY:
        found = {
            name: result
            for name in names
            if (stepper := as_stepper(name)).solves(kind) and stepper.refusal(problem) is None
            if slow or _are_alike(reference, first, _first_frame(name, problem, counts[0]), part)
            if (result := match(name, beside(name, runs)))
        }
        if found:
            return found
    return {}


@in_float64
def operations(problem: Problem) -> set[str]:
    """The names of the primitives that the right-hand side consists of; none if it is in Python."""
    if problem.in_python:
        return set()
    traced = jax.make_jaxpr(problem.rhs)(problem.ts[0], problem.y0, problem.args)
    return {each.primitive.name for each in equations(traced)}


def like_steppers(reference: Reference, runs: Sequence[Run]) -> list[str]:
    """Steppers whose positions are like those of all runs; none where no run is finite."""

    def match(name: str, pairs: Iterator[tuple[Run, Run | None]]) -> bool:
        return all(
            made is not None and _are_alike(reference, run, made.states, _ALIKE)
            for run, made in pairs
        )

    return [*matching(reference, runs, match)]


def beside(name: str, runs: Sequence[Run]) -> Iterator[tuple[Run, Run | None]]:
    """Runs of a program, each with that of a stepper."""
    for run, steps in zip(runs, steps_per_frame(runs), strict=True):
        yield run, run_as(name, run.problem, steps, run.values.shape[2])


def _are_alike(reference: Reference, run: Run, made: np.ndarray, part: float) -> bool:
    """Whether a run and states have the same positions in the first frame, and until they blow up.

    Arguments:
        reference: of the problem.
        run: from a file.
        made: ``(times, *state)``; so many samples are compared.
        part: of the errors of the run, by which they may differ.
    """
    problem, norm = reference.problem, NORMS[f"{reference.problem.quantities[0]}-max"]
    errors = distances(run.states[: len(made)], reference, norm)
    blown_up = errors > moved(reference, norm)
    end = max(int(np.argmax(blown_up)), 2) if blown_up.any() else len(errors)
    apart = largest_distance(problem, norm, run.states[:end], made[:end])
    rounding = float(np.linalg.norm(worst_rounding(run, reference)[: run.layout.dim]))
    return apart <= max(part * float(np.max(errors[:end])), rounding)


def of_the_motion(misfit: float) -> str:
    """How closely positions agree, in words."""
    return f"to {misfit:.1g} of the motion" if misfit else "exactly"


class Identity(NamedTuple):
    """Methods that compute the numbers of all runs.

    Fields:
        names: of the steppers.
        orders: of each on the problem, 0 if it does not converge there.
        frames: the first ones, in which positions agree in all runs.
        misfit: the largest difference of positions there, as a part of the motion.
        complete: whether velocities, if there are any, agree as well, and over all frames.
        quantities: that the runs have.
    """

    names: tuple[str, ...]
    orders: tuple[int, ...]
    frames: int
    misfit: float
    complete: bool
    quantities: tuple[str, ...]

    def shows(self, expected: int | None) -> bool:
        """Whether the identity is evidence of the order that is claimed, as a slope would be."""
        return self.complete and {*self.orders} == {expected}

    def refutes(self, expected: int | None) -> bool:
        """Whether the methods have another order than is claimed, or do not converge at all.

        Methods of different orders that compute the same tell nothing of each other.
        """
        return len({*self.orders}) == 1 and max(self.orders) < (expected or 1)

    @property
    def line(self) -> str:
        """The method and its evidence."""
        what = " and ".join(PLURAL[each] for each in self.quantities[: 2 if self.complete else 1])
        over = "all frames" if self.complete else f"the first {first_frames(self.frames)}"
        orders = listed(dict.fromkeys(self.orders))
        return (
            f"the {what} are those of {listed(self.names)}, {of_the_motion(self.misfit)}, over "
            f"{over}; {'its' if len(self.names) == 1 else 'their'} order is {orders}"
        )

    def diagnosis(self, problem: Problem) -> Diagnosis:
        """Of a method whose order is too low, or whose start is wrong."""
        evidence = {"methods": [*self.names], "order": max(self.orders), "misfit": self.misfit}
        if all("start=rest" in name for name in self.names) and np.any(problem.y0[1]):
            words = f"the initial velocity is forgotten, as with x(-dt) = x(0): {self.line}"
            return Diagnosis("start", words, evidence, VERLET_START)
        return Diagnosis("method", self.line, evidence)


def same_method(reference: Reference, runs: Sequence[Run]) -> Identity | None:
    """The method that computes the numbers of all runs, to rounding; None if none is known.

    Arguments:
        reference: of the problem.
        runs: from coarse to fine; none of them counts that diverged.
    """
    known = finite(runs)
    like = like_steppers(reference, known)
    agreed = [_agreeing(reference, run, made) for name in like for run, made in beside(name, known)]
    # What is only like it, and not the same, would be evidence of another order.
    if min((frames for frames, _, _ in agreed), default=0) < 1:
        return None
    frames, misfits, complete = zip(*agreed, strict=True)
    kind = problem_class(reference.problem)
    return Identity(
        tuple(like),
        tuple(as_stepper(name).order(kind) or 0 for name in like),
        min(frames),
        max(misfits),
        len(known) == len(runs) and all(complete),
        known[0].quantities,
    )


def _agreeing(reference: Reference, run: Run, made: Run | None) -> tuple[int, float, bool]:
    """How far two runs agree; no quantity may differ by much of its error.

    Returns:
        In how many frames positions agree, to which part of the motion; and whether all does.
    """
    assert made is not None
    frames, misfits = [], []
    apart = np.abs(run.values - made.values[: len(run.values)])
    for name, part in zip(run.quantities, run.parts_of(apart), strict=True):
        norm = NORMS[f"{name}-max"]
        way, errors = moved(reference, norm), distances(run.states, reference, norm)
        # Where a run blows up, rounding grows as well.
        known = np.maximum.accumulate(errors)
        sizes = np.maximum(way, known)
        parts = np.max(part, axis=(1, 2))[: len(sizes)] / sizes
        same = parts <= np.minimum(_SAME, _OF_ERRORS * known / sizes)
        # All runs begin alike, and what has no errors yet tells no method from another.
        same[0] = True
        last = len(same) - 1 if same.all() else int(np.argmin(same)) - 1
        frames.append(last if known[last] else 0)
        misfits.append(float(np.max(parts[: frames[-1] + 1], initial=0.0)))
    return frames[0], misfits[0], min(frames) == reference.trusted - 1
