"""What a reference does not say, and what makes a problem harder to solve than it need be."""

from __future__ import annotations

import numpy as np

from ropeode.norms import distance, norm_for
from ropeode.problems import Problem
from ropeode.references.options import SMALLEST_RTOL
from ropeode.references.reference import Reference
from ropeode.references.solvers.solution import Path, Solution

# Steps of fewer units in the last place of t are too coarse to be chosen well.
_UNITS_PER_STEP = 1e6
# The absolute tolerance is the same for all components. At the loosest tolerances it is more than
# a component that is so much smaller than the largest.
_DIFFERENT_SIZES = 1e6
# A component has three digits if it is so many times its error bound.
_DIGITS = 1e3
_LISTED = 6


def hints(
    problem: Problem, run: Solution, path: Path | None = None, rtol: float | None = None
) -> str:
    """Sentences for a refusal or the end of a horizon, each with a space before it.

    Arguments:
        problem: what was to be solved.
        run: the loosest run, with its states.
        path: the steps of another run, if there is one.
        rtol: the tolerance that the user asked for.
    """
    sizes = np.max(np.abs(run.states), axis=0, initial=0.0)
    if path is not None:
        # What is large for a moment only, no sample may show.
        way = np.max(np.abs(path.states), axis=0, initial=0.0).reshape(sizes.shape)
        sizes = np.fmax(sizes, way)
    found = (
        coarse_times(problem, run.steps, run.reached),
        "" if np.ndim(run.atol) else _different_sizes(sizes, rtol or SMALLEST_RTOL),
    )
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
        _shrunk(reference),
        coarse_times(problem, certificate.steps) if certificate.level == "consensus" else "",
    )
    return tuple(sentence for sentence in found if sentence)


def _shrunk(reference: Reference) -> str:
    """A sentence on components that have become too small for an error bound that suits others.

    One that passes through zero, or is all rounding, has not: its sign changes, or it was never
    known.
    """
    problem, inside = reference.problem, reference.states[: reference.trusted]
    if problem.mechanics is not None:
        return ""
    values, bound = inside.reshape(len(inside), -1), reference.bound()[-1]
    least = _DIGITS * bound
    last = np.abs(values[-1])
    shrunk = (last > 0.0) & (last < least) & (np.max(np.abs(values), axis=0) > least)
    shrunk &= np.all(values >= -bound, axis=0) | np.all(values <= bound, axis=0)
    which = np.flatnonzero(shrunk)
    if not len(which):
        return ""
    listed = ", ".join(f"number {index} ({last[index]:.1e})" for index in which[:_LISTED])
    return (
        f"At t = {problem.ts[len(inside) - 1]:g} the bound, {bound:.1e}, leaves fewer "
        f"than three digits of some of the state's numbers, counted from 0: {listed}"
        f"{', ...' if len(which) > _LISTED else ''}. Give each a tolerance of its own (atol, an "
        "array of the state's shape)."
    )


def _different_sizes(sizes: np.ndarray, rtol: float) -> str:
    known = sizes[(sizes > 0.0) & np.isfinite(sizes)]
    if not len(known) or np.max(known) < _DIFFERENT_SIZES * np.min(known):
        return ""
    each = ""
    if sizes.ndim == 1 and len(sizes) == len(known) <= _LISTED:
        each = f", such as atol=[{', '.join(f'{rtol * size:.1g}' for size in sizes)}]"
    return (
        f"The components' sizes differ, from {np.min(known):.1e} to {np.max(known):.1e}, and one "
        "absolute tolerance serves them all: give each its own (atol, an array of the state's "
        f"shape{each}), or other units."
    )
