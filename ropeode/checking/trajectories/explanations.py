"""What files hold instead of the samples that they should, if they are right otherwise."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ropeode.analysis import distances, moved, resolution
from ropeode.checking.trajectories.arrangement import (
    Arrangement,
    Mistake,
    arrangements,
    mistakes_in,
)
from ropeode.checking.trajectories.clocks import Clock, Extent, extent_of, likely_clocks
from ropeode.checking.trajectories.convergence import order_finding
from ropeode.checking.trajectories.initial_states import begins_right, check_initial_states
from ropeode.checking.trajectories.layout import Block
from ropeode.checking.trajectories.run_files import Files, Run, finite, opened_files, read_runs
from ropeode.checking.trajectories.time_errors import RUNS, explains
from ropeode.errors import InputError
from ropeode.norms import NORMS
from ropeode.problems import Problem
from ropeode.references import Reference
from ropeode.validation import complaint

# Where the step sizes show no order, the errors of the finest run must be tiny, as a part of the
# motion; or small, and at most this part of those of the coarsest.
_VERY_SMALL, _SMALL, _FALLEN = 1e-3, 0.1, 0.5
_TINY = float(np.finfo(np.float64).tiny)


@dataclasses.dataclass(frozen=True)
class Explanation:
    """A mistake in writing files, without which they agree with the reference.

    Arguments:
        cause: `columns` or `times`.
        words: the mistake, in a sentence without its end.
        fix: how to mend it.
        agreement: what the files show if they are read so.
        runs: as they should have been written.
        reference: at their samples.
        like_another_problem: whether another problem with the same initial state moves so, too.
    """

    cause: str
    words: str
    fix: str
    agreement: str
    runs: tuple[Run, ...]
    reference: Reference
    like_another_problem: bool = False

    @property
    def line(self) -> str:
        """The mistake and its evidence."""
        return f"{self.words}; read so, {self.agreement}"


def explain_columns(
    reference: Reference, runs: Sequence[Run], *, coarse: bool = True
) -> Explanation | None:
    """The simplest mistake in the columns without which runs agree with a reference.

    If the runs cannot decide between several that are as simple, the words name all of them.

    Arguments:
        reference: of the problem.
        runs: from coarse to fine.
        coarse: whether runs without the mistake may be too coarse to show an order.
    """
    same_start = begins_right(runs, slice(0, runs[0].layout.dim))

    def agreement(arrangement: Arrangement) -> str | None:
        # A mirror through the initial positions is another problem rather than a mistake.
        if same_start and arrangement.held[0].offset:
            return None
        undone = arrangement.undone_in(runs)
        if not _better(reference, undone, runs):
            return None
        return _agreement(reference, undone, coarse=coarse)

    states = reference.states[: reference.trusted]
    found = _simplest(states, runs, agreement)
    if found is None and begins_right(runs, slice(None)):
        found = _simplest(states, runs, agreement, after=1)
    if found is None:
        return None
    undone = found.arrangement.undone_in(runs)
    moves = same_start and found.arrangement.moves_positions and not found.arrangement.after
    return Explanation("columns", found.words, found.fix, found.evidence, undone, reference, moves)


def explain_start(runs: Sequence[Run]) -> tuple[str, str] | None:
    """The simplest mistake in the columns of the first samples, without which these are right.

    Whether it is in all rows remains open: runs may be too coarse, or wrong otherwise.

    Returns:
        The mistake, and how to mend it.
    """

    def evidence(arrangement: Arrangement) -> str | None:
        try:
            check_initial_states(arrangement.undone_in(runs))
        except InputError:
            return None
        return ""

    found = _simplest(runs[0].problem.y0[None], runs, evidence)
    if found is None:
        return None
    return f"in the first sample {found.words}", f"{found.fix}, in the initial state too"


class _Found(NamedTuple):
    """An arrangement with its mistakes, and what the files show if they are read so."""

    arrangement: Arrangement
    words: str
    fix: str
    evidence: str


def _simplest(
    states: np.ndarray,
    runs: Sequence[Run],
    evidence: Callable[[Arrangement], str | None],
    after: int = 0,
) -> _Found | None:
    """The arrangement with the fewest mistakes for which there is evidence."""
    found: list[tuple[list[Mistake], Arrangement, str]] = []
    with np.errstate(all="ignore"):  # Runs that blew up have huge numbers.
        tried = [(mistakes_in(each, runs[0]), each) for each in arrangements(states, runs, after)]
        for mistakes, arrangement in sorted(tried, key=lambda pair: len(pair[0])):
            if found and len(mistakes) > len(found[0][0]):
                break
            if (shown := evidence(arrangement)) is not None:
                found.append((mistakes, arrangement, shown))
    if not found:
        return None
    mistakes, arrangement, shown = found[0]
    words = dict.fromkeys(" and ".join(each.words for each in several) for several, *_ in found)
    fix = "; ".join(each.fix for each in mistakes)
    text = "; or, which is the same here, ".join(words)
    return _Found(arrangement, f"after the first row, {text}" if after else text, fix, shown)


def explain(reference: Reference, runs: Sequence[Run], files: Files) -> Explanation | None:
    """A mistake in the columns of files, or else in their rows or times.

    Arguments:
        reference: of the problem.
        runs: from coarse to fine.
        files: of the runs.
    """
    return explain_columns(reference, runs) or explain_times(lambda: reference, files, runs)


def explain_times(
    certified: Callable[[], Reference], files: Files, as_written: Sequence[Run] | None = None
) -> Explanation | None:
    """A mistake in the rows of files, or in their times, without which they agree with a reference.

    Arguments:
        certified: makes the reference, if files can be read at all.
        files: of one program.
        as_written: the runs, if the files can be read as they are.

    Raises:
        ReferenceRefused: no reference can be certified.
    """
    for clock in likely_clocks(files.problem, _extents(files)):
        found = _explained(clock, certified, files)
        if found is not None and (
            as_written is None
            or (
                len(found.runs) == len(as_written)
                and _better(found.reference, found.runs, as_written)
            )
        ):
            return found
    return None


def _extents(files: Files) -> list[Extent]:
    """The times of files; none if one of them cannot be read."""
    try:
        opened, steps, _ = opened_files(*files)
        return [extent_of(file.blocks(), dt) for file, dt in zip(opened, steps, strict=True)]
    except (InputError, OSError):
        return []


def _explained(
    clock: Clock, certified: Callable[[], Reference], files: Files
) -> Explanation | None:
    """The explanation that files have other times, and maybe other columns, too."""
    paths, problem, dts, fewest = files
    shown = problem if clock.ends else problem.changed(ts=problem.ts[:-1], exact=None)

    def reading(index: int, blocks: Iterator[Block]) -> tuple[float, Iterator[Block]]:
        return clock.dts[index], clock.blocks(blocks, index, shown)

    try:
        runs = finite(read_runs(paths, shown, dts, fewest=fewest, reading=reading))
    except InputError:
        return None
    if len(runs) < fewest:
        return None
    reference = certified() if clock.ends else _without_last(certified(), shown)
    if (agreement := _agreement(reference, runs)) is not None:
        return Explanation("times", clock.words, clock.fix, agreement, runs, reference)
    columns = explain_columns(reference, runs) if clock.begins else None
    if columns is None:
        return None
    words, fix = f"{clock.words}, and {columns.words}", f"{clock.fix}; {columns.fix}"
    return dataclasses.replace(columns, cause="times", words=words, fix=fix)


def _without_last(reference: Reference, problem: Problem) -> Reference:
    """The reference of a problem with one sample less."""
    trusted = min(reference.trusted, len(problem.ts))
    return dataclasses.replace(
        reference,
        problem=problem,
        states=reference.states[: len(problem.ts)],
        certificate=dataclasses.replace(reference.certificate, trusted=trusted),
    )


def _agreement(reference: Reference, runs: Sequence[Run], *, coarse: bool = True) -> str | None:
    """How runs agree with a reference, as part of a sentence; None if they do not.

    Arguments:
        reference: at their samples.
        runs: as they may have been meant.
        coarse: whether they may be too coarse to show an order.
    """
    try:
        check_initial_states(runs)
    except InputError:
        return None
    finding, _ = order_finding(reference, runs, None)
    if finding.status == "undetermined":
        return _closeness(reference, runs) if coarse else None
    return finding.line if finding.status == "pass" else None


def _better(reference: Reference, undone: Sequence[Run], runs: Sequence[Run]) -> bool:
    """Whether a mistake explains the errors of all quantities in which it changes them.

    Runs that do not begin with the initial state are wrong, however small their errors are.
    """
    if not begins_right(runs, slice(None)):
        return True

    def error(run: Run, name: str) -> float:
        return float(np.max(distances(run.states, reference, NORMS[f"{name}-max"])))

    parts = [
        [error(one, name) / max(error(other, name), _TINY) for one, other in pairs]
        for name in undone[0].quantities
        for pairs in [[*zip(undone, runs, strict=True)][: -1 - RUNS : -1]]
    ]
    dts = [run.dt for run in runs][: -1 - RUNS : -1]
    return all(set(each) == {1.0} or explains(each, dts) for each in parts)


def _closeness(reference: Reference, runs: Sequence[Run]) -> str | None:
    """How close the finest run is, and comes closer than the coarsest."""
    words = []
    for name in runs[0].quantities:
        norm = NORMS[f"{name}-max"]
        coarse, fine = (
            float(np.max(distances(run.states, reference, norm)[1:])) for run in (runs[0], runs[-1])
        )
        way = moved(reference, norm)
        tiny = max(_VERY_SMALL * way, float(resolution(reference, norm)[-1]))
        if fine > max(tiny, min(_SMALL * way, _FALLEN * coarse)):
            return None
        words.append(f"the error in {name} is {100.0 * fine / way:.2g}% of the motion")
    return " and ".join(words) + f" at dt = {runs[-1].dt:.4g}"


def times_complaint(explanation: Explanation, files: Files) -> str:
    """The complaint about files whose times or rows are not those of the problem."""
    ts = files.problem.ts
    return complaint(
        ", ".join(Path(path).name for path in files.paths),
        "samples of other times",
        f"samples from t = {ts[0]:g} to {ts[-1]:g}; {explanation.line}",
        explanation.fix,
    )
