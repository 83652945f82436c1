"""Runs from files, read as they are, or with the mistake in writing them that explains them."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.analysis import distances, moved, resolution
from ropeode.checking.trajectories.clocks import Clock, Times, likely_clocks
from ropeode.checking.trajectories.columns import Explanation, simplest
from ropeode.checking.trajectories.convergence import beginning, order_finding
from ropeode.checking.trajectories.known_methods import same_method
from ropeode.checking.trajectories.run_files import (
    Files,
    Run,
    finite,
    for_each_file,
    read_files,
    read_runs,
    run_of,
)
from ropeode.checking.trajectories.time_errors import RUNS, explains, late_samples
from ropeode.errors import InputError, ReferenceRefused
from ropeode.norms import NORMS
from ropeode.progress import Progress
from ropeode.references import Reference
from ropeode.validation import complaint, not_traced

# Where the step sizes show no order, the errors of the finest run must be tiny, as a part of the
# motion; or small, and at most this part of those of the coarsest.
_VERY_SMALL, _SMALL, _FALLEN = 1e-3, 0.1, 0.5
# How far off, as a part of the problem's size, a first sample in single precision is.
_SINGLE = 4.0 * float(np.finfo(np.float32).eps)
# Nodes in a row of which a distance can be told; and the number of the first, as people count.
_FEWEST_NODES, _FIRSTS = 3, (0.0, 1.0, 0.5)
_TINY = float(np.finfo(np.float64).tiny)
_USUAL_FIX = "start from the initial state of the spec; `ropeode grade --init` writes it"


def checked_runs(
    files: Files, certified: Callable[[], Reference], progress: Progress
) -> tuple[Run, ...]:
    """Read files, and check their first samples.

    Arguments:
        files: of one program.
        certified: makes the reference of the problem, which shows whether files are right but for
            one mistake.
        progress: called with the current task and the fraction that is done.

    Returns:
        The runs, from coarse to fine.

    Raises:
        InputError: they cannot be used; with the mistake that explains it, if there is one.
    """
    not_traced("dts", files.dts)
    try:
        runs = read_runs(files.paths, files.problem, files.dts, progress, fewest=files.fewest)
    except InputError:
        with contextlib.suppress(ReferenceRefused):
            if (found := explain(certified, files)) is not None:
                ts, names = files.problem.ts, ", ".join(Path(path).name for path in files.paths)
                allowed = f"samples from t = {ts[0]:g} to {ts[-1]:g}; {found.line}"
                raise InputError(
                    complaint(names, "samples of other times", allowed, found.fix)
                ) from None
        raise
    if all(run.begins() for run in runs):
        return runs
    why, fix = _why_start(certified, files, finite(runs) or runs) or ("", _USUAL_FIX)

    def check(index: int) -> None:
        if not runs[index].begins():
            raise InputError(_complaint(runs[index], why, fix))

    for_each_file([run.path for run in runs], check)
    return runs


def _complaint(run: Run, why: str, fix: str) -> str:
    """The complaint about another first sample than the initial state."""
    off = run.first_errors > run.allowed_first_errors
    node, column = (int(i[0]) for i in np.nonzero(off))
    name = run.layout.columns(run.values.shape[2] > run.layout.dim)[column]
    return complaint(
        f"{run.path}, initial state, node {node} ({name})",
        float(run.values[0, node, column]),
        f"{run.initial[node, column]:.9g}, the initial state of the problem"
        + (f"; {why}" if why else ""),
        fix,
    )


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
    same_start = all(run.begins(slice(runs[0].layout.dim)) for run in runs)

    def agreement(undone: tuple[Run, ...]) -> str | None:
        return _agreement(reference, undone, runs, coarse=coarse)

    # A mirror through the initial positions is another problem rather than a mistake.
    hows: list[dict[str, Any]] = [{"shifts": not same_start}]
    # The initial state may be written by other lines than the rest.
    hows += [{"after": 1}] if all(run.begins() for run in runs) else []
    for how in hows:
        found = simplest(reference.states[: reference.trusted], runs, agreement, **how)
        if found is not None:
            there, meant = (run.parts_of(run.values)[0] for run in (runs[-1], found.runs[-1]))
            moves = same_start and "after" not in how and not np.array_equal(there, meant)
            return dataclasses.replace(found, like_another_problem=moves)
    return None


def _why_start(
    certified: Callable[[], Reference], files: Files, runs: Sequence[Run]
) -> tuple[str, str] | None:
    """What explains that runs do not begin with the initial state, and how to mend it.

    Arguments:
        certified: makes the reference, which shows whether files are right but for one mistake.
        files: of the runs.
        runs: from coarse to fine.
    """
    if all(np.all(run.values == run.values[0]) for run in runs):
        fix = "write a copy of the state, not the array that the next step overwrites"
        return "all rows of a file are the same", fix
    if all(np.all(run.first_errors <= _SINGLE * run.problem.scale) for run in runs):
        return "it is right in single precision", "compute it in double precision"
    if (placed := _misplaced_nodes(runs)) is not None:
        return placed
    with contextlib.suppress(ReferenceRefused):
        if (explanation := explain(certified, files, runs)) is not None:
            return explanation.line, explanation.fix
        if (late := late_samples(certified(), runs)) is not None:
            return late.line, late.remedy
    return _explain_start(runs)


def _misplaced_nodes(runs: Sequence[Run]) -> tuple[str, str] | None:
    """Nodes in a row at wrong equal distances, as where their number is taken for that of gaps.

    Returns:
        The mistake, and how to mend it.
    """
    dim, nodes = runs[0].layout.dim, runs[0].layout.nodes
    right = runs[0].initial[:, :dim]
    places, way = np.arange(nodes)[:, None], right[-1] - right[0]
    evenly = right[0] + way * places / max(nodes - 1, 1)
    if nodes < _FEWEST_NODES or np.any(np.abs(right - evenly) > runs[0].allowed_first_errors[:dim]):
        return None
    for first, gaps in itertools.product(_FIRSTS, (nodes, nodes + 1, nodes - 1, nodes - 2)):
        off = right[0] + way * (places + first) / gaps - right
        if np.any(off) and all(
            np.all(np.abs(run.values[0, :, :dim] - right - off) <= run.allowed_first_errors[:dim])
            and run.begins(slice(dim, None))
            for run in runs
        ):
            i = f"(i + {first:g})" if first else "i"
            return (
                f"the nodes are placed at {i}/{gaps} of the way in place of i/{nodes - 1}: "
                f"{nodes} nodes have {nodes - 1} gaps",
                "place node i at start + (end - start) * i / (num_nodes - 1)",
            )
    return None


def _explain_start(runs: Sequence[Run]) -> tuple[str, str] | None:
    """The simplest mistake in the columns of the first samples, without which these are right.

    Whether it is in all rows remains open: runs may be too coarse, or wrong otherwise.

    Returns:
        The mistake, and how to mend it.
    """

    def evidence(undone: tuple[Run, ...]) -> str | None:
        return "" if all(run.begins() for run in undone) else None

    found = simplest(runs[0].problem.y0[None], runs, evidence, shifts=True)
    if found is None:
        return None
    return f"in the first sample {found.words}", f"{found.fix}, in the initial state too"


def explain(
    certified: Callable[[], Reference],
    files: Files,
    as_written: Sequence[Run] = (),
    *,
    coarse: bool = True,
) -> Explanation | None:
    """A mistake in the columns of files, or in their rows or times, without which they are right.

    Arguments:
        certified: makes the reference, if files can be read at all.
        files: of one program.
        as_written: the runs, if the files can be read as they are.
        coarse: whether runs without the mistake may be too coarse to show an order.

    Raises:
        ReferenceRefused: no reference can be certified.
    """
    if as_written and (found := explain_columns(certified(), as_written, coarse=coarse)):
        return found
    for clock, runs in _by_other_clocks(files):
        reference = beginning(certified(), files.problem.frames - (not clock.ends))
        if reference is None:
            continue
        if (shown := _agreement(reference, runs, as_written, coarse=coarse)) is not None:
            return Explanation("times", clock.words, clock.fix, shown, runs)
        columns = explain_columns(reference, runs, coarse=coarse) if clock.begins else None
        if columns is not None and _better(reference, columns.runs, as_written):
            words, fix = f"{clock.words}, and {columns.words}", f"{clock.fix}; {columns.fix}"
            return dataclasses.replace(columns, cause="times", words=words, fix=fix)
    return None


def _by_other_clocks(files: Files) -> Iterator[tuple[Clock, tuple[Run, ...]]]:
    """What the times of files may mean instead, and the runs that they are then."""
    problem = files.problem
    try:
        every, dts, _ = read_files(files)
    except InputError:
        return
    times = [Times(written.times, dt) for written, dt in zip(every, dts, strict=True)]
    for clock in likely_clocks(problem, times):
        with contextlib.suppress(InputError):
            read = [
                run_of(clock.read(written, k, problem), clock.files[k].dt, problem)
                for k, written in enumerate(every)
            ]
            runs = finite(sorted(read, key=lambda run: -run.dt))
            if len(runs) >= files.fewest and len({run.quantities for run in runs}) == 1:
                yield clock, runs


def _agreement(
    reference: Reference, runs: Sequence[Run], as_written: Sequence[Run], *, coarse: bool
) -> str | None:
    """How runs agree with a reference, as part of a sentence; None if they do not.

    Arguments:
        reference: at their samples.
        runs: as they may have been meant.
        as_written: as they are, if they can be read.
        coarse: whether they may be too coarse to show an order.
    """
    if not all(run.begins() for run in runs) or not _better(reference, runs, as_written):
        return None
    finding, _ = order_finding(reference, runs, None)
    if finding.status == "undetermined":
        same = same_method(reference, runs)
        if same is not None and same.complete and min(same.orders) > 0:
            return same.line
        return _closeness(reference, runs) if coarse else None
    return finding.line if finding.status == "pass" else None


def _better(reference: Reference, undone: Sequence[Run], runs: Sequence[Run]) -> bool:
    """Whether a mistake explains the errors of all quantities in which it changes them.

    Runs that cannot be read, or do not begin with the initial state, are wrong, however small their
    errors are.
    """
    dts = [run.dt for run in runs]
    if dts != [run.dt for run in undone]:
        return not runs
    if not all(run.begins() for run in runs):
        return True

    def error(run: Run, name: str) -> float:
        return float(np.max(distances(run.states, reference, NORMS[f"{name}-max"])))

    parts = [
        [error(one, name) / max(error(other, name), _TINY) for one, other in pairs]
        for name in undone[0].quantities
        for pairs in [[*zip(undone, runs, strict=True)][: -1 - RUNS : -1]]
    ]
    return all(set(each) == {1.0} or explains(each, dts[: -1 - RUNS : -1]) for each in parts)


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
