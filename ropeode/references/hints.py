"""What a reference does not say, and what makes a problem harder to solve than it need be."""

from __future__ import annotations

import numpy as np

from ropeode.norms import distance, norm_for
from ropeode.problems.problem import Problem
from ropeode.references.reference import Reference
from ropeode.references.solvers.solution import Solution

# Steps of fewer units in the last place of t are too coarse to be chosen well.
_UNITS_PER_STEP = 1e6
# The absolute tolerance is the same for all components. At the loosest tolerances it is more than
# a component that is so much smaller than the largest.
_DIFFERENT_SIZES = 1e6


def hints(problem: Problem, run: Solution) -> str:
    """Sentences for a refusal or the end of a horizon, each with a space before it.

    Arguments:
        problem: what was to be solved.
        run: the loosest run, with its states.
    """
    found = (coarse_times(problem, run.steps, run.reached), _different_sizes(run))
    return "".join(f" {sentence}" for sentence in found if sentence)


def coarse_times(problem: Problem, steps: int, reached: float = np.inf) -> str:
    """A sentence on times that are large beside the steps; empty where they are not.

    Arguments:
        problem: what was to be solved.
        steps: of a run.
        reached: the time that it came to.
    """
    start, end = problem.ts[0], min(reached, problem.ts[-1])
    largest = np.maximum(np.abs(problem.ts[:-1]), np.abs(problem.ts[1:]))
    spacing = np.spacing(largest)
    # Frames may be far longer at late times than at first.
    shortest = np.minimum((end - start) / max(steps, 1), np.diff(problem.ts))
    worst = int(np.argmax(spacing / shortest))
    if spacing[worst] * _UNITS_PER_STEP <= shortest[worst]:
        return ""
    late = abs(start) > 0.5 * largest[worst]
    mend = (
        f"let t start at 0, and add the {start:g} inside the right-hand side where it needs t"
        if late
        else "ask for samples that are further apart there"
    )
    return (
        f"At t = {largest[worst]:g} the floating-point numbers are {spacing[worst]:.1e} apart, "
        f"which is coarse beside the frames and steps ({shortest[worst]:.1e}): {mend}."
    )


def unresolved_motion(problem: Problem, states: np.ndarray, bound: np.ndarray) -> str:
    """A sentence on a solution that moves less than its error bound; empty if it moves more.

    Arguments:
        problem: what was solved.
        states: ``(times, *state)``.
        bound: of the first quantity at these times.
    """
    start = np.broadcast_to(problem.y0, states.shape)
    farthest = float(np.max(distance(problem, norm_for(problem), states, start)))
    if farthest == 0.0 or bound[-1] < farthest:
        return ""
    return (
        f"Up to t = {problem.ts[len(states) - 1]:g} the solution moves by {farthest:.1e} only, "
        f"which is not resolved by a bound of {bound[-1]:.1e}."
    )


def remarks(reference: Reference) -> tuple[str, ...]:
    """Sentences on a reference that can be trusted, but says little.

    Arguments:
        reference: of either level.
    """
    problem, certificate = reference.problem, reference.certificate
    inside = reference.states[: reference.trusted]
    found = (
        unresolved_motion(problem, inside, reference.bound()),
        coarse_times(problem, certificate.steps) if certificate.level == "consensus" else "",
    )
    return tuple(sentence for sentence in found if sentence)


def _different_sizes(run: Solution) -> str:
    sizes = np.max(np.abs(run.states), axis=0, initial=0.0)
    sizes = sizes[sizes > 0.0]
    if np.ndim(run.atol) or not len(sizes) or np.max(sizes) < _DIFFERENT_SIZES * np.min(sizes):
        return ""
    return (
        f"The components' sizes differ, from {np.min(sizes):.1e} to {np.max(sizes):.1e}, and one "
        "absolute tolerance serves them all: give each its own (atol, an array of the state's "
        "shape), or other units."
    )
