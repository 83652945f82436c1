"""References of many problems that differ in their numbers only."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from typing import Any

from ropeode.errors import ReferenceRefused
from ropeode.problems import Ensemble, Problem, without_memory
from ropeode.progress import Progress, silent
from ropeode.references.consensus import Comparison, certified, independent_run, primary_runs
from ropeode.references.ladder import EXPLICIT_SOLVERS
from ropeode.references.options import ReferenceOptions
from ropeode.references.reference import Reference
from ropeode.references.solvers.solution import Solution
from ropeode.references.witnesses import independent_rtol, independent_steps
from ropeode.threads import threads

# Members that a thread takes on at a time.
_MOST_AT_ONCE = 128
# For the states of all members that are being solved.
_MOST_BYTES = 2**28

Outcome = Reference | ReferenceRefused


def side_by_side(
    ensemble: Ensemble, options: ReferenceOptions, workers: int, progress: Progress
) -> Iterator[Outcome]:
    """References of level `consensus`, one after the other, as `each_reference` yields them."""
    total, done = len(ensemble), 0
    first = ensemble.first
    member_bytes = 8 * len(first.ts) * first.y0.nbytes
    at_once = min(_MOST_AT_ONCE, math.ceil(total / workers), _MOST_BYTES // member_bytes // workers)
    at_once = max(1, at_once)
    starts = iter(range(0, total, at_once))

    def solve(start: int) -> list[Outcome]:
        members = [ensemble[i] for i in range(start, min(start + at_once, total))]
        with without_memory(first):
            return _references(members, options)

    with threads(workers) as pool:
        running: deque[Future[list[Outcome]]] = deque()
        while True:
            # One more than there are threads, so that none waits for the caller.
            while len(running) <= workers and (start := next(starts, None)) is not None:
                running.append(pool.submit(solve, start))
            if not running:
                return
            progress(f"references: {done} of {total}", done / total)
            outcomes = running.popleft().result()
            done += len(outcomes)
            yield from outcomes


def or_refused(solve: Callable, *inputs: Any) -> Any:
    """What a function returns, or the refusal that it raises."""
    try:
        return solve(*inputs)
    except ReferenceRefused as refused:
        return refused


def _references(members: Sequence[Problem], options: ReferenceOptions) -> list[Outcome]:
    """References of members whose independent runs are computed together."""
    primaries = [or_refused(primary_runs, member, options, silent) for member in members]
    independent = _independent([each for each in primaries if isinstance(each, Comparison)])
    return [
        or_refused(certified, each, next(independent), options)
        if isinstance(each, Comparison)
        else each
        for each in primaries
    ]


def _independent(primaries: Sequence[Comparison]) -> Iterator[Solution]:
    """The independent run of each: side by side where that is possible, and gets to the end."""
    # Not above: it imports SciPy's solvers, which takes long.
    from ropeode.references.solvers import dop853

    def goes_together(each: Comparison) -> bool:
        whole = each.problem.frames == each.solved.frames
        return each.method is EXPLICIT_SOLVERS and not each.problem.jump_times and whole

    together = [each for each in primaries if goes_together(each)]
    rtols = [independent_rtol(each.method, each.next_tighter) for each in together]
    runs = dop853.solve(
        [each.problem for each in together],
        rtols,
        [rtol * each.budget.scale for rtol, each in zip(rtols, together, strict=True)],
        max_steps=[independent_steps(each.next_tighter) for each in together],
    )
    remaining = iter(runs)
    for each in primaries:
        run = next(remaining) if goes_together(each) else None
        if run is None or run.failure is not None:
            run = independent_run(each)
        yield run
