"""How far a reference can be trusted, by runs that do not depend on each other."""

from __future__ import annotations

import dataclasses
import enum
import functools
import itertools
import platform
from collections.abc import Mapping, Sequence
from importlib import metadata
from typing import Literal

import numpy as np

from ropeode.display import Tabular
from ropeode.equality import ByContent
from ropeode.json_form import Unbounded, json_shows
from ropeode.norms import NORMS, Norm, distance
from ropeode.problems import Problem
from ropeode.references.solvers.solution import Solution
from ropeode.references.solvers.solver import Solver

# The bound is this many times the largest difference between the runs.
# docs/explanation/certificate.md says how often and how tightly it covers the true error.
SAFETY_FACTOR = 3.0
# Units of rounding below which a difference of two float64 runs means nothing.
ROUNDING_UNITS = 4.0
_EPS = float(np.finfo(np.float64).eps)
# The default accuracy, of how far the solution moves; and, of the initial state's scale, the
# finest: what hardly moves cannot be known to 1e-8 of its motion.
RELATIVE_ACCURACY = 1e-8
FINEST_ACCURACY = 1e-12

Role = Literal[
    "looser",
    "tighter",
    "neighbour",
    "short steps",
    "rounding",
    "independent",
    "more digits",
    "close look",
    "fewer digits",
]
Level = Literal["consensus", "extended"]


class Reason(enum.StrEnum):
    """Why the trust in float64 runs ends, in words."""

    UNSETTLED = "tightening the tolerance does not settle the result"
    STOPPED = "a solver got no further"
    INACCURATE = "the estimated bound exceeds the accuracy asked for"
    COARSE = (
        "the right-hand side changes within a unit in the last place of the state or the time; "
        "let both be smaller numbers"
    )


@json_shows("solver", "tolerance", "role", "steps", "difference")
@dataclasses.dataclass(frozen=True, eq=False)
class Witness(ByContent):
    """A run that checks a reference.

    Arguments:
        solver: which one.
        tolerance: its relative tolerance.
        role: `looser` and `tighter` are runs of the primary solver at another tolerance,
            `neighbour` starts one unit of rounding away, `short steps` cannot step over what lasts
            longer than 1/32 of a frame, `rounding` has each rounded number of the right-hand side
            moved by a unit, `independent` is another solver, `more digits` is a run beyond
            float64 (where heyoka is installed), `close look` is another solver that ends its steps
            where the right-hand side does something between those of the others, and `fewer
            digits` checks a reference in extended precision.
        steps: how many (diffrax counts rejected ones, SciPy does not).
        seconds: to run, without compiling.
        differences: its distance from the reference at each sample, for each quantity.
        difference: the largest of the first quantity inside the horizon; not a number where it
            did not arrive.
    """

    solver: Solver
    tolerance: float
    role: Role
    steps: int
    seconds: float = dataclasses.field(compare=False)
    differences: Mapping[str, np.ndarray]
    difference: Unbounded = np.nan


@dataclasses.dataclass(frozen=True)
class Sampling:
    """Where the right-hand side was evaluated along the solution, to see what steps pass over.

    Arguments:
        times: how many.
        spacing: the longest interval between two of them, or a step's end: what lasts longer was
            seen.
    """

    times: int
    spacing: float


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Certificate(Tabular):
    """What is claimed of a reference, and the evidence.

    Arguments:
        level: `consensus`: the reference and its witnesses are float64 runs, but for one of `more
            digits` where heyoka is installed and that is cheap. `extended`: two runs in extended
            precision agree, and the states are those of the finer one, rounded to float64.
        solver: the primary solver.
        rtol: its relative tolerance.
        atol: its absolute tolerance: one number, or an array of the state's shape.
        steps: its number of steps.
        accuracy: the largest bound that is still trusted, in the units of the first quantity.
        bounds: for each quantity the estimated error bound at each sample, in the largest
            node's norm; it never falls in time. Infinite where a run did not arrive, and past a
            horizon where the runs agree and are not believed.
        drift: for each constrained quantity how far each sample is off the problem's
            constraints (for an inextensible rope: its links' lengths, and the rates at which
            these change). Empty for a problem without constraints.
        trusted: the number of leading samples inside the trust horizon.
        horizon: the first sample time outside the trust horizon; None if there is none.
        horizon_reason: why it ends there; None likewise.
        witnesses: the runs that check the reference.
        stiff: the explicit solver needed too many steps, so that the solvers are implicit.
        seconds: for all the runs, without compiling.
        compile_seconds: for compiling them.
        versions: of the packages involved.
        sampling: how closely it was looked between the steps; None where it was not.
    """

    level: Level
    solver: Solver
    rtol: float
    atol: float | np.ndarray
    steps: int
    accuracy: float
    bounds: Mapping[str, np.ndarray]
    drift: Mapping[str, np.ndarray]
    trusted: int
    horizon: float | None
    horizon_reason: str | None
    witnesses: tuple[Witness, ...]
    stiff: bool
    seconds: float = dataclasses.field(compare=False)
    compile_seconds: float = dataclasses.field(compare=False)
    versions: Mapping[str, str]
    sampling: Sampling | None = None


def witness(problem: Problem, primary: Solution, run: Solution, role: Role) -> Witness:
    """A run, compared with the primary one."""
    return Witness(
        solver=run.solver,
        tolerance=run.rtol,
        role=role,
        steps=run.steps,
        seconds=run.seconds,
        differences={
            quantity: padded(series, problem)
            for quantity, series in distances(problem, run.states, primary.states).items()
        },
    )


def largest_norms(problem: Problem) -> dict[str, Norm]:
    """For each quantity the norm that none of its others exceeds."""
    return {quantity: NORMS[f"{quantity}-max"] for quantity in problem.quantities}


def distances(problem: Problem, a: np.ndarray, b: np.ndarray) -> dict[str, np.ndarray]:
    """The distance of the largest node of two runs, for each quantity.

    Arguments:
        problem: of both.
        a: states, ``(times, *state)``.
        b: states; the longer of the two is cut.
    """
    norms = largest_norms(problem).items()
    return {quantity: distance(problem, norm, a, b) for quantity, norm in norms}


def default_accuracy(problem: Problem, moved: float, relative: float = 0.0) -> float:
    """The largest bound that is trusted where the caller does not say.

    Arguments:
        problem: what was solved.
        moved: how far its solution moves, in the units of the first quantity.
        relative: the least accuracy, as a part of `moved`, if that is more than the usual one.
    """
    relative = max(RELATIVE_ACCURACY, relative)
    return max(relative * moved, FINEST_ACCURACY * problem.scale)


@functools.cache
def versions(*packages: str) -> Mapping[str, str]:
    """The versions of packages that take part in a reference, and of Python."""
    own = {name: metadata.version(name) for name in packages}
    return own | {"python": platform.python_version()}


def smallest(problem: Problem, quantity: str) -> float:
    """A size that is nothing to any solver: a unit of rounding of a unit of rounding.

    What seems to rest may well move by so little.
    """
    natural = problem.scale / (np.ptp(problem.ts) if quantity == "velocity" else 1.0)
    return ROUNDING_UNITS * _EPS**2 * natural


def bounds(
    problem: Problem,
    primary: Solution,
    witnesses: Sequence[Witness],
    *more: Mapping[str, np.ndarray],
) -> dict[str, np.ndarray]:
    """The estimated error bound of the primary at each sample, for each quantity.

    Three times the running maximum of the largest difference from any witness that is at
    least as good as the primary, plus a few units of rounding of the largest value so far.
    The looser runs are left out: they are further from the truth than the primary, so that a
    difference shows their own error.

    Arguments:
        problem: what was solved.
        primary: the run that becomes the reference.
        witnesses: the other runs.
        more: series of quantities at the samples that count like differences. Of the distance from
            a problem's constraints at least half is error.
    """
    result = {}
    # SciPy's steps are not compensated: each may lose as much.
    units = ROUNDING_UNITS * (1 + (primary.steps if primary.solver.library == "SciPy" else 0))
    for quantity in problem.quantities:
        differences = [w.differences[quantity] for w in witnesses if w.role != "looser"]
        differences += [padded(each[quantity], problem) for each in more if quantity in each]
        values = np.abs(problem.quantity(quantity, primary.states)).max(axis=(1, 2))
        rounding = units * _EPS * padded(values, problem) + smallest(problem, quantity)
        result[quantity] = np.maximum.accumulate(
            SAFETY_FACTOR * np.max(differences, axis=0) + rounding
        )
    return result


def trusted_samples(
    problem: Problem,
    rungs: Sequence[Solution],
    from_tightest: Sequence[np.ndarray],
    bound: np.ndarray,
    witnesses: Sequence[Witness],
    accuracy: float,
) -> tuple[int, Reason | None]:
    """How many leading samples can be trusted, and why not more.

    A sample can be trusted if the bound is within the accuracy, and if the ladder has settled.
    Settled means, in distances from the tightest rung: no rung is ten times further away
    than a looser one, and the last but one is at most a third as far away as the loosest.
    Otherwise a rung sees something that others missed. A single sample may break these rules by
    accident: trust ends only where every later sample breaks them too. A difference is excused
    where the tolerance allows it in each step, or where rounding explains it: one unit in each
    step, grown as much as the neighbour's.

    Arguments:
        problem: what was solved.
        rungs: of the tolerance ladder, the loosest first.
        from_tightest: the distance of each rung from the tightest.
        bound: of the first quantity.
        witnesses: of all roles; the neighbour shows how rounding grows.
        accuracy: in the units of the first quantity.
    """
    quantity = problem.quantities[0]
    neighbour = next(w.differences[quantity] for w in witnesses if w.role == "neighbour")

    def allowed(run: Solution) -> np.ndarray:
        rounding = max(run.steps, 100) * (np.maximum.accumulate(neighbour) + bound[0])
        return np.maximum(rounding, run.steps * run.rtol * problem.scale)

    *apart, _ = from_tightest  # The tightest rung is no distance from itself.
    excused = [series <= allowed(run) for series, run in zip(apart, rungs, strict=False)]
    settled = (apart[-1] <= apart[0] / 3.0) | excused[-1]
    for looser, tighter in itertools.combinations(range(len(apart)), 2):
        settled &= (apart[tighter] <= 10.0 * apart[looser]) | excused[tighter]

    enough = int(np.argmin(np.append(bound <= accuracy, False)))
    trusted = int(np.max(np.flatnonzero(settled[:enough]), initial=-1)) + 1
    if trusted < enough:
        return trusted, Reason.UNSETTLED
    if enough == len(bound):
        return enough, None
    if not np.isfinite(bound[enough]):
        return enough, Reason.STOPPED
    return enough, Reason.INACCURATE


def unknown_beyond(
    bounds: Mapping[str, np.ndarray], trusted: int, accuracy: float
) -> Mapping[str, np.ndarray]:
    """Bounds that are infinite past the horizon where those of the runs would be small.

    Trust ends at a small bound where all runs may have passed something by.

    Arguments:
        bounds: of each quantity, estimated from all runs.
        trusted: how many leading samples are.
        accuracy: the largest bound of the first quantity that would be trusted.
    """
    first = next(iter(bounds.values()))
    if trusted == len(first) or first[trusted] > accuracy:
        return bounds
    inside = np.arange(len(first)) < trusted
    return {quantity: np.where(inside, series, np.inf) for quantity, series in bounds.items()}


def padded(series: np.ndarray, problem: Problem) -> np.ndarray:
    """A series over the samples that were reached, infinite at the others."""
    return np.concatenate([series, np.full(len(problem.ts) - len(series), np.inf)])
