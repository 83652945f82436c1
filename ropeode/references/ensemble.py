"""References of many problems that differ in their numbers only."""

from __future__ import annotations

import functools
import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from typing import Any, get_args

from ropeode.errors import InputError, ReferenceRefused
from ropeode.problems.ensemble import Ensemble
from ropeode.problems.problem import Problem
from ropeode.references.certificate import Level
from ropeode.references.consensus import Primary, certified, primary_runs
from ropeode.references.ladder import (
    EXPLICIT,
    Progress,
    independent_budget,
    solve_independent,
)
from ropeode.references.reference import (
    DIGITS,
    TIME_LIMIT,
    Reference,
    checked,
    reference,
)
from ropeode.references.solvers.solution import Solution
from ropeode.threads import cores, threads
from ropeode.validation import check_whole, unknown

# Members that a thread takes on at a time.
_MOST_AT_ONCE = 128
# Of the states of all members that are being solved.
_MOST_BYTES = 2**28

Outcome = Reference | ReferenceRefused


def each_reference(
    ensemble: Ensemble,
    accuracy: float | None = None,
    rtol: float | None = None,
    *,
    level: Level = "consensus",
    digits: int = DIGITS,
    time_limit: float = TIME_LIMIT,
    dense: bool = False,
    workers: int | None = None,
    progress: Progress = lambda text: None,
) -> Iterator[Outcome]:
    """References of the members of an ensemble, one after the other, in its order.

    Those that nobody keeps take no memory, however many there are.

    The primary solver makes of each member what it makes of that alone, to the last bit, on
    as many threads as there are processors. The independent solver solves many members side
    by side; see `references.solvers.dop853`. Stiff members, those with jump times, and where
    it fails have SciPy's solver in its place, as `reference` has.

    Arguments:
        ensemble: what to solve.
        accuracy: as for `ropeode.reference`, for all members.
        rtol: as for `ropeode.reference`, for all members.
        level: as for `ropeode.reference`; at `extended` members are solved one by one.
        digits: as for `ropeode.reference`.
        time_limit: as for `ropeode.reference`, for each member.
        dense: as for `ropeode.reference`; where it is asked for, one by one as well.
        workers: how many threads; by default as many as there are processors.
        progress: called with a few words now and then.

    Yields:
        For each member its reference, or the `ReferenceRefused` that says why it has none.

    Raises:
        InputError: an argument cannot be used.
    """
    accuracy, rtol = checked(accuracy, rtol)
    count = cores() if workers is None else check_whole("workers", workers, at_least=1, example="2")
    if level not in get_args(Level):
        raise InputError(unknown("level", level, get_args(Level)))
    if level != "consensus" or dense:
        ask = functools.partial(
            reference,
            accuracy=accuracy,
            rtol=rtol,
            level=level,
            digits=digits,
            time_limit=time_limit,
            dense=dense,
            progress=progress,
        )
        return (_or_refused(ask, member) for member in ensemble)
    return _side_by_side(ensemble, accuracy, rtol, count, progress)


def _side_by_side(
    ensemble: Ensemble,
    accuracy: float | None,
    rtol: float | None,
    count: int,
    progress: Progress,
) -> Iterator[Outcome]:
    total, done = len(ensemble), 0
    first = ensemble.first
    of_a_member = 8 * len(first.ts) * first.y0.nbytes
    at_once = min(_MOST_AT_ONCE, math.ceil(total / count), _MOST_BYTES // of_a_member // count)
    pieces = iter(range(0, total, max(1, at_once)))

    def solve(start: int) -> list[Outcome]:
        members = [ensemble[i] for i in range(start, min(start + max(1, at_once), total))]
        return _references(members, accuracy, rtol)

    with threads(count) as pool:
        ahead: deque[Future[list[Outcome]]] = deque()
        while True:
            # One more than run, so that no thread waits for who takes the results.
            while len(ahead) <= count and (start := next(pieces, None)) is not None:
                ahead.append(pool.submit(solve, start))
            if not ahead:
                return
            progress(f"references: {done} of {total}")
            found = ahead.popleft().result()
            done += len(found)
            yield from found


def _references(
    members: Sequence[Problem], accuracy: float | None, rtol: float | None
) -> list[Outcome]:
    """References of members, whose independent runs are made together."""
    made = [_or_refused(primary_runs, member, rtol, _quiet) for member in members]
    found: list[Any] = made
    independent = _independent([each for each in made if isinstance(each, Primary)])
    for index, each in enumerate(made):
        if isinstance(each, Primary):
            run = next(independent)
            found[index] = _or_refused(certified, each, run, accuracy, rtol)
    return found


def _independent(made: Sequence[Primary]) -> Iterator[Solution]:
    """The independent run of each."""
    # Not above: it imports SciPy's solvers, which takes long.
    from ropeode.references.solvers import dop853

    together = [
        index
        for index, each in enumerate(made)
        if each.method is EXPLICIT and not each.problem.jump_times
    ]
    runs: dict[int, Solution] = {}
    if together:
        tighter = [made[index].next_tighter for index in together]
        found = dop853.solve(
            [made[index].problem for index in together],
            [run.rtol for run in tighter],
            max_steps=[
                independent_budget(made[index].problem, run)
                for index, run in zip(together, tighter, strict=True)
            ],
        )
        runs = dict(zip(together, found, strict=True))
    for index, each in enumerate(made):
        run = runs.get(index)
        if run is None or run.failure is not None:
            run = solve_independent(each.problem, each.method, each.next_tighter, each.run, _quiet)
        yield run


def _or_refused(ask: Callable, *inputs: Any) -> Any:
    """What a function returns, or the refusal that it raises."""
    try:
        return ask(*inputs)
    except ReferenceRefused as refused:
        return refused


def _quiet(text: str) -> None:
    del text
