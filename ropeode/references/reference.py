"""A trajectory that can be trusted, with the certificate that says how far."""

from __future__ import annotations

import dataclasses
import platform
from importlib import metadata
from typing import Any, get_args

import numpy as np

from ropeode.errors import InputError, ReferenceRefused
from ropeode.norms import Norm, distance, norm_for
from ropeode.problems.problem import Problem
from ropeode.references.certificate import (
    Certificate,
    Level,
    Role,
    Witness,
    bounds,
    from_tightest,
    trusted_samples,
    witness,
)
from ropeode.references.dense import Dense
from ropeode.references.ladder import (
    EXPLICIT,
    IMPLICIT,
    Method,
    Progress,
    climb,
    recall,
    short_steps,
    solve_independent,
    solve_primary,
    step_budget,
)
from ropeode.references.solution import Solution
from ropeode.validation import check_positive, complaint, unknown

TIGHTEST_RTOL = 1e-14
SMALLEST_RTOL = 1e-13
LARGEST_RTOL = 1e-3
RELATIVE_ACCURACY = 1e-8
# At the level `extended`: float64 has 16 digits, and two to spare.
DIGITS = 18
TIME_LIMIT = 60.0
# Of the initial state's scale; what hardly moves cannot be known to 1e-8 of its motion.
FINEST_ACCURACY = 1e-12
_PACKAGES = ("ropeode", "diffrax", "jax", "jaxlib", "numpy", "scipy")


@dataclasses.dataclass(frozen=True, eq=False)
class Reference:
    """A reference trajectory.

    Arguments:
        problem: what was solved.
        states: ``(times, *state)`` at the problem's sample times; only the first
            `certificate.trusted` of them are inside the trust horizon.
        certificate: how far it can be trusted, and why.
        dense: the states at all times between; None where they were not asked for.
    """

    problem: Problem
    states: np.ndarray
    certificate: Certificate
    dense: Dense | None = None

    @property
    def times(self) -> np.ndarray:
        """The sample times that the solver reached, ``(times,)``."""
        return self.problem.ts[: len(self.states)]

    @property
    def positions(self) -> np.ndarray:
        """Positions, ``(times, nodes, dim)``."""
        return self.problem.positions(self.states)

    @property
    def velocities(self) -> np.ndarray:
        """Velocities, ``(times, nodes, dim)``."""
        return self.problem.velocities(self.states)

    @property
    def trusted(self) -> int:
        """The number of samples inside the trust horizon."""
        return self.certificate.trusted

    @property
    def horizon(self) -> float | None:
        """The first sample time outside the trust horizon; None if there is none."""
        return self.certificate.horizon

    def bound(self, norm: Norm | None = None) -> np.ndarray:
        """The estimated error bound at each sample inside the horizon, ``(trusted,)``.

        Arguments:
            norm: in which the error is measured; the bound is for the largest node, which
                no norm exceeds. By default the problem's first quantity.
        """
        quantity = (norm or norm_for(self.problem)).quantity
        return self.certificate.bounds[quantity][: self.trusted]

    def at(self, times: Any) -> np.ndarray:
        """States at any times, ``(times, *state)``; at samples the same as `states`.

        Arguments:
            times: one or several, in the problem's unit of time, in any order.

        Raises:
            InputError: the reference has no dense output, or it does not cover a time.
        """
        return self._dense().at(times)

    def bound_at(self, times: Any, norm: Norm | None = None) -> np.ndarray:
        """The estimated error bound of `at`, ``(times,)``.

        Arguments:
            times: as for `at`.
            norm: as for `bound`.

        Raises:
            InputError: the reference has no dense output, or it does not cover a time.
        """
        return self._dense().bound_at(times, (norm or norm_for(self.problem)).quantity)

    def _dense(self) -> Dense:
        if self.dense is None:
            allowed = "a reference with dense output"
            fix = "make it with reference(problem, dense=True), or --dense on the command line"
            raise InputError(complaint("dense", self.dense, allowed, fix))
        return self.dense


def reference(
    problem: Problem,
    accuracy: float | None = None,
    rtol: float | None = None,
    *,
    level: Level = "consensus",
    digits: int = DIGITS,
    time_limit: float = TIME_LIMIT,
    dense: bool = False,
    progress: Progress = lambda text: None,
) -> Reference:
    """Solve a problem so that the solution can be trusted, and say how far.

    The primary solver is diffrax Dopri8. It is run on a ladder of tolerances as far as
    rounding lets it; the run before the tightest is the reference. That is held against the
    other rungs, against itself from a neighbouring initial state and with steps too short to
    miss much, and against SciPy's DOP853. If the explicit solver needs too many steps the
    problem counts as stiff, and the solvers are diffrax Kvaerno5 and SciPy's Radau.

    At the level `extended` it is solved by Taylor series (heyoka) in as many digits as it
    takes, twice; see `ropeode.references.extended.solution`.

    Arguments:
        problem: what to solve.
        accuracy: the largest error bound that is still trusted, in the units of the positions
            (of the state, for a problem that is not mechanical); by default 1e-8 (or 1e4 times
            `rtol`, if that is given and more) of how far a node (or component) moves.
        rtol: relative tolerance of the reference; by default as tight as gains anything. The
            absolute tolerance is `rtol` times the largest component of the initial state.
        level: `consensus` of float64 solvers, or `extended` precision, which needs heyoka.
        digits: to which two runs in extended precision are to agree.
        time_limit: in seconds, for all runs in extended precision.
        dense: whether the states between the samples are to be known as well; see
            `ropeode.references.refine`.
        progress: called with a few words before each run.

    Raises:
        InputError: an argument cannot be used.
        ReferenceRefused: not even the first sample can be trusted; says why.
    """
    if dense:
        # Not above: that module builds on this one.
        from ropeode.references.refine import with_dense_output

        known = reference(
            problem,
            accuracy,
            rtol,
            level=level,
            digits=digits,
            time_limit=time_limit,
            progress=progress,
        )
        return with_dense_output(known, time_limit=time_limit, progress=progress)
    if level not in get_args(Level):
        raise InputError(unknown("level", level, get_args(Level)))
    if level == "extended":
        # Not above: that module builds on this one, and heyoka is an extra.
        from ropeode.references.extended.reference import extended_reference

        return extended_reference(
            problem, accuracy, rtol, digits=digits, time_limit=time_limit, progress=progress
        )
    if accuracy is not None:
        accuracy = check_positive("accuracy", accuracy, example="1e-6")
    if rtol is not None:
        rtol = check_positive("rtol", rtol, example="1e-12")
        if not SMALLEST_RTOL <= rtol <= LARGEST_RTOL:
            raise InputError(
                complaint(
                    "rtol",
                    rtol,
                    f"from {SMALLEST_RTOL:g} (float64 carries no more) to {LARGEST_RTOL:g}",
                    f"for example rtol={SMALLEST_RTOL:g}",
                )
            )

    method, rungs = _ladder(problem, rtol, progress)
    primary_index = len(rungs) - 2 if rtol is None else 2
    if not 0 < primary_index < len(rungs) - 1 or len(rungs[-1].states) < 2:
        last = rungs[-1]
        why = last.failure or "is the tightest run that gains anything; three rungs are needed"
        raise ReferenceRefused(
            f"no reference for {problem.name!r}: {last.solver} at rtol {last.rtol:.0e} "
            f"{why}. Start where the right-hand side is smooth, declare its jump times, sample "
            "earlier, or ask for a looser rtol."
        )
    primary, tightest = recall(problem, method, rungs[primary_index], progress), rungs[-1]
    witnesses, away = [], []
    for index, rung in enumerate(rungs):
        run = primary if index == primary_index else recall(problem, method, rung, progress)
        away.append(from_tightest(problem, run, tightest))
        if index != primary_index:
            role = "looser" if index < primary_index else "tighter"
            witnesses.append(witness(problem, primary, run, role))
        del run
    every = [rung.without_states() for rung in rungs]
    next_tighter = every[primary_index + 1]
    del rungs, tightest

    def hold_against(run: Solution, role: Role) -> None:
        witnesses.append(witness(problem, primary, run, role))
        every.append(run.without_states())

    hold_against(
        solve_primary(problem, method, primary.rtol, progress, y0=neighbour(problem)), "neighbour"
    )
    hold_against(
        solve_primary(
            problem,
            method,
            primary.rtol,
            progress,
            max_steps=2 * step_budget(problem),
            longest_steps=short_steps(problem, problem.ts),
        ),
        "short steps",
    )
    hold_against(solve_independent(problem, method, next_tighter, primary, progress), "independent")

    drift = problem.drift(primary.states)
    estimated = bounds(problem, primary, witnesses, drift)
    bound = estimated[problem.quantities[0]]
    if accuracy is None:
        relative = max(RELATIVE_ACCURACY, 1e4 * rtol if rtol else 0.0)
        accuracy = max(
            relative * _motion_while_known(problem, primary.states, bound),
            FINEST_ACCURACY * problem.scale,
        )
    trusted, reason = trusted_samples(problem, every[: len(away)], away, bound, witnesses, accuracy)
    if trusted < 2:
        failures = "; ".join(f"{run.solver} {run.failure}" for run in every if run.failure)
        raise ReferenceRefused(
            f"no reference for {problem.name!r}: at t = {problem.ts[1]:g} already {reason} (bound "
            f"{bound[1]:.1e}, accuracy {accuracy:.1e}"
            + (f"; {failures}" if failures else "")
            + "). Ask for less accuracy, declare jump times if the right-hand side has jumps, "
            "or see whether it is smooth and in float64."
        )
    return Reference(
        problem=problem,
        states=primary.states,
        certificate=Certificate(
            level="consensus",
            solver=primary.solver,
            rtol=primary.rtol,
            atol=primary.atol,
            steps=primary.steps,
            accuracy=accuracy,
            bounds=estimated,
            drift=drift,
            trusted=trusted,
            horizon=float(problem.ts[trusted]) if trusted < len(problem.ts) else None,
            horizon_reason=reason,
            witnesses=tuple(_inside(w, problem, trusted) for w in witnesses),
            stiff=method is IMPLICIT,
            seconds=sum(run.seconds for run in every),
            compile_seconds=sum(run.compile_seconds for run in every),
            versions={name: metadata.version(name) for name in _PACKAGES}
            | {"python": platform.python_version()},
        ),
    )


def reference_for(
    given: Problem | Reference,
    accuracy: float | None = None,
    rtol: float | None = None,
    *,
    progress: Progress = lambda text: None,
    **more: Any,
) -> Reference:
    """The reference that is given, or else that of the problem that is given.

    Arguments:
        given: a problem, or a reference of it that exists already.
        accuracy: as for `reference`; not with a reference.
        rtol: as for `reference`; not with a reference.
        progress: as for `reference`.
        more: `level`, `digits`, `time_limit` and `dense` of `reference`.

    Raises:
        InputError: an argument cannot be used.
        ReferenceRefused: no reference can be had.
    """
    if not isinstance(given, Reference):
        return reference(given, accuracy, rtol, progress=progress, **more)
    faults = [
        complaint(name, value, "none with a reference that exists already", "leave one of them out")
        for name, value in (("accuracy", accuracy), ("rtol", rtol))
        if value is not None
    ]
    if faults:
        raise InputError(faults)
    return given


def problem_of(given: Problem | Reference) -> Problem:
    """The problem that is given, or that of the reference that is given."""
    return given.problem if isinstance(given, Reference) else given


def motion(problem: Problem, states: np.ndarray, norm: Norm | None = None) -> np.ndarray:
    """How far any node (or component) has got from where it started, up to each sample.

    This is the size against which an error is large or small; unlike the size of the state
    it does not change when the whole problem is moved. At least 1e-8 of the state's scale.

    Arguments:
        problem: whose motion it is.
        states: ``(times, *state)``.
        norm: by default the problem's first.
    """
    start = np.broadcast_to(problem.y0, states.shape)
    apart = distance(problem, norm or norm_for(problem), states, start)
    farthest = np.maximum.accumulate(apart)
    return np.maximum(farthest, 1e-8 * problem.scale)


def _motion_while_known(problem: Problem, states: np.ndarray, bound: np.ndarray) -> float:
    """The motion over the samples where it is known to three digits; past a pole it is not."""
    farthest = motion(problem, states)
    known = bound[: len(farthest)] <= 1e-3 * farthest
    return float(farthest[max(int(np.argmin(known)) - 1, 0)] if not all(known) else farthest[-1])


def _ladder(
    problem: Problem, rtol: float | None, progress: Progress
) -> tuple[Method, list[Solution]]:
    """The ladder of the method that fits the problem: explicit if it gets anywhere."""

    def tolerances(method: Method) -> list[float]:
        if rtol is None:
            return list(method.tolerances)
        asked = [100 * rtol, 10 * rtol, rtol, rtol / 10, rtol / 100]
        return [tolerance for tolerance in asked if tolerance > 0.99 * TIGHTEST_RTOL]

    method = EXPLICIT
    first = solve_primary(problem, method, tolerances(method)[0], progress)
    if first.failure and first.steps >= step_budget(problem):
        other = solve_primary(problem, IMPLICIT, tolerances(IMPLICIT)[0], progress)
        if len(other.states) > len(first.states):
            method, first = IMPLICIT, other
    return method, climb(problem, method, first, tolerances(method)[1:], progress)


def neighbour(problem: Problem) -> np.ndarray:
    """The initial state with each component moved by one unit of rounding, up or down.

    Zeros are moved up, by a unit of rounding of the largest component: a solution that is
    not unique must not be held against itself. But in a mechanical problem they stay, since
    a node that is pinned or at rest would begin to drift, unless all are zero.
    """
    y0 = problem.y0
    up = np.random.default_rng(1).integers(0, 2, size=y0.shape).astype(bool)
    moved = np.nextafter(y0, np.where(up, np.inf, -np.inf))
    stays = problem.mechanics is not None and np.any(y0)
    from_zero = 0.0 if stays else np.finfo(np.float64).eps * problem.scale
    return np.where(y0 == 0.0, from_zero, moved)


def _inside(w: Witness, problem: Problem, trusted: int) -> Witness:
    """A witness with its largest difference inside the horizon filled in."""
    differences = w.differences[problem.quantities[0]][:trusted]
    return dataclasses.replace(w, difference=float(np.max(differences)))
