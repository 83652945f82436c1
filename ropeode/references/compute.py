"""Computing references, of one problem or of an ensemble."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Literal, Unpack, overload

import numpy as np

from ropeode.errors import InputError, ReferenceRefused
from ropeode.problems import Ensemble, Problem, require_memory, require_problem, without_memory
from ropeode.progress import Progress, bar, shows_progress, silent
from ropeode.references.certificate import Level, Role
from ropeode.references.kept import kept_or_computed
from ropeode.references.options import (
    DIGITS,
    SMALLEST_RTOL,
    TIME_LIMIT,
    More,
    ReferenceOptions,
)
from ropeode.references.reference import Reference
from ropeode.references.solvers.solution import Solution
from ropeode.threads import cores
from ropeode.validation import check_kind, check_whole, complaint

if TYPE_CHECKING:
    from ropeode.references.ensemble import Outcome


@overload
def reference(
    problem: Problem,
    accuracy: float | None = None,
    rtol: float | None = None,
    *,
    progress: Progress = bar,
    **more: Unpack[More],
) -> Reference: ...
@overload
def reference(
    problem: Ensemble,
    accuracy: float | None = None,
    rtol: float | None = None,
    *,
    progress: Progress = bar,
    **more: Unpack[More],
) -> list[Reference | ReferenceRefused]: ...
@shows_progress
def reference(
    problem: Problem | Ensemble,
    accuracy: float | None = None,
    rtol: float | None = None,
    *,
    atol: Any = None,
    level: Level = "consensus",
    digits: int = DIGITS,
    time_limit: float = TIME_LIMIT,
    progress: Progress = bar,
    **others: Any,
) -> Reference | list[Reference | ReferenceRefused]:
    """Solve a problem, and say how far the solution can be trusted.

    The primary solver, diffrax Dopri8, runs on a ladder of tolerances until rounding makes
    tighter ones useless. The last run but one is the reference. The witnesses are the other
    rungs, a run from a neighbouring initial state, a run with steps too short to miss much, two
    whose right-hand side rounds in other directions, SciPy's DOP853, and, where heyoka is installed
    and that is cheap, a run with more digits. A problem for which the explicit solver needs too
    many steps counts as stiff; Radau IIA of order 9 and SciPy's Radau solve it instead, or SciPy's
    BDF and Radau, where there are more than 300 unknowns and the Jacobian is sparse.

    At the level `extended`, Taylor series (heyoka) solve the problem twice, with as many digits
    as it needs; see `ropeode.references.extended.solution`.

    Each member of an ensemble gets its own reference. `ropeode.each_reference` yields them one
    after the other.

    Arguments:
        problem: what to solve, or an ensemble of problems.
        accuracy: the largest error bound that is still trusted, in the units of the positions
            (of the state, for a problem that is not mechanical); by default 1e-8 (or 1e4 times
            `rtol`, if that is more) of how far a node (or component) moves.
        rtol: relative tolerance of the reference; by default the tightest that still helps.
        atol: absolute tolerance of the reference at that `rtol` (at 1e-13 where `rtol` is left
            to the ladder, whose other runs keep the ratio of the two): one number, or an array of
            the state's shape, for components of very different size. By default `rtol` times
            the largest component of the initial state.
        level: `consensus` of float64 solvers, or `extended` precision, which needs heyoka.
        digits: to which the two runs in extended precision must agree.
        time_limit: in seconds, for all runs together, without compiling. Where it does not
            suffice, the horizon ends earlier, or the reference is refused; where it does, the
            result does not depend on it.
        progress: called before each run, with what it is.
        others: none; what `solve_ivp` takes is met with what to write instead.

    Returns:
        The reference. For an ensemble, a list that holds for each member its reference, or the
        `ReferenceRefused` that says why it has none.

    Raises:
        InputError: an argument cannot be used.
        ReferenceRefused: not even the first sample can be trusted; says why.

    Examples:
        >>> from ropeode import Rope, reference
        >>> truth = reference(Rope(num_nodes=4).problem(frames=3))
        >>> truth
        <Reference: rope, 4 nodes, damping 0.01, 3 frames; diffrax Dopri8, estimated bound ...>
        >>> truth.positions[-1, 3].round(6)
        array([-399.931534,  195.544665])
    """
    options = ReferenceOptions(
        accuracy=accuracy,
        rtol=rtol,
        atol=atol,
        level=level,
        digits=digits,
        time_limit=time_limit,
        **others,
    )
    if isinstance(problem, Ensemble):
        return list(_each(problem, options, cores(), progress))
    require_problem(problem)
    return _reference(problem, options, progress)


@shows_progress
def each_reference(
    ensemble: Ensemble,
    accuracy: float | None = None,
    rtol: float | None = None,
    *,
    workers: int | None = None,
    progress: Progress = bar,
    **more: Unpack[More],
) -> Iterator[Outcome]:
    """The references of an ensemble's members, one after the other, in its order.

    A reference takes no memory after the caller has dropped it, so that an ensemble may be large.

    The primary solver runs on as many threads as there are processors; each member's states are
    the same as those of `reference`, to the last bit. The independent solver solves many
    members side by side; see `references.solvers.dop853`. SciPy's solver replaces it, as in
    `reference`, for stiff members, for members with jump times, and where it fails.

    Arguments:
        ensemble: what to solve.
        accuracy: as for `ropeode.reference`, for all members.
        rtol: as for `ropeode.reference`, for all members.
        workers: how many threads; by default as many as there are processors.
        progress: called now and then, with how many members are done.
        more: options by name, as for `ropeode.reference`. At the level `extended` the members are
            solved one by one.

    Yields:
        For each member its reference, or the `ReferenceRefused` that says why it has none.

    Raises:
        InputError: an argument cannot be used.

    Examples:
        >>> from ropeode import Rope, each_reference
        >>> ropes = Rope(num_nodes=4).ensemble(frames=3, damping=[0.01, 0.1])
        >>> for truth in each_reference(ropes):
        ...     print(truth.problem.name, truth.positions[-1, 3].round(4))
        rope [-399.9315  195.5447]
        rope [-399.9424  195.9182]
    """
    options = ReferenceOptions(accuracy=accuracy, rtol=rtol, **more)
    count = cores() if workers is None else check_whole("workers", workers, at_least=1, example="2")
    return _each(ensemble, options, count, progress)


def reference_for(
    problem: Problem | Reference,
    options: ReferenceOptions = ReferenceOptions(),  # noqa: B008
    progress: Progress = silent,
) -> Reference:
    """A reference itself, or one of a problem: a new one, or one that an earlier command kept.

    Arguments:
        problem: a problem, or a reference that exists already.
        options: of the new one. With a reference, `accuracy`, `rtol` and `atol` are refused.
        progress: as for `reference`.

    Raises:
        InputError: an option is set that an existing reference has fixed.
        ReferenceRefused: the problem has no reference.
    """
    if isinstance(problem, Problem):
        solve = functools.partial(_reference, problem, options, progress)
        return kept_or_computed(problem, options, solve)
    faults = [
        complaint(name, value, "none with a reference that exists already", "leave one of them out")
        for name in ("accuracy", "rtol", "atol")
        if (value := getattr(options, name)) is not None
    ]
    if faults:
        raise InputError(faults)
    return problem


def solved_again(
    known: Reference,
    ts: np.ndarray,
    time_limit: float = TIME_LIMIT,
    progress: Progress = silent,
) -> Reference:
    """A new reference of the same problem, at the same level and to the same accuracy.

    Arguments:
        known: the reference that exists already.
        ts: the sample times of the new one.
        time_limit: as for `reference`.
        progress: as for `reference`.

    Raises:
        InputError: the problem has no equations.
        ReferenceRefused: it has no reference with these samples.
    """
    certificate = known.certificate
    # One number is the default; at least it serves all components alike.
    atol = certificate.atol * (SMALLEST_RTOL / certificate.rtol)
    options = ReferenceOptions(
        accuracy=certificate.accuracy,
        atol=atol if np.ndim(atol) else None,
        level=certificate.level,
        time_limit=time_limit,
    )
    problem = known.problem.changed(ts=ts).until(len(ts))
    return _reference(problem, options, progress)


def _each(
    ensemble: Ensemble, options: ReferenceOptions, workers: int, progress: Progress
) -> Iterator[Outcome]:
    # Not above: a command that finds its reference in the cache folder needs no solver.
    from ropeode.references.ensemble import or_refused, side_by_side

    check_kind("ensemble", ensemble, Ensemble, "Ensemble.of")
    ensemble.first.require_equations()
    if options.level == "consensus":
        return side_by_side(ensemble, options, workers, progress)
    solve = functools.partial(_reference, options=options, progress=progress)
    return (or_refused(solve, member) for member in ensemble)


def reference_and_runs(
    problem: Problem, options: ReferenceOptions, progress: Progress = silent
) -> tuple[Reference, list[tuple[Role | Literal["reference"], Solution]]]:
    """A new reference of level `consensus`, and all runs that it rests on, with their states.

    A certificate keeps the differences of its witnesses only.

    Arguments:
        problem: what is solved.
        options: of the reference.
        progress: as for `reference`.

    Returns:
        The reference; and of each run its role, and the solution. The first is the reference's own.

    Raises:
        ReferenceRefused: the problem has no reference.
    """
    runs: list[tuple[Role | Literal["reference"], Solution]] = []
    found = _reference(problem, options, progress, seen=lambda *each: runs.append(each))
    return found, runs


def _reference(
    problem: Problem, options: ReferenceOptions, progress: Progress, **seen: Any
) -> Reference:
    # Of the ladder, of the witnesses, and of the differences between them.
    require_memory(problem, copies=6)
    problem.require_equations()
    with without_memory(problem):
        if options.level == "extended":
            # Not above: heyoka is an extra.
            from ropeode.references.extended.reference import extended_reference

            return extended_reference(problem, options, progress)
        from ropeode.references.consensus import consensus_reference

        return consensus_reference(problem, options, progress, **seen)
