"""What files hold instead of the samples that they should, if they are right otherwise."""

from __future__ import annotations

import contextlib
import dataclasses
import itertools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ropeode.analysis import distances, moved, resolution
from ropeode.checking.trajectories.clocks import Clock, Times, likely_clocks
from ropeode.checking.trajectories.columns import Explanation, simplest
from ropeode.checking.trajectories.convergence import beginning, order_finding
from ropeode.checking.trajectories.known_methods import same_method
from ropeode.checking.trajectories.layout import Written
from ropeode.checking.trajectories.run_files import Files, Run, finite, opened_files, run_of
from ropeode.checking.trajectories.time_errors import RUNS, explains, late_samples
from ropeode.errors import InputError, ReferenceRefused
from ropeode.norms import NORMS
from ropeode.references import Reference
from ropeode.validation import complaint

# Where the step sizes show no order, the errors of the finest run must be tiny, as a part of the
# motion; or small, and at most this part of those of the coarsest.
_VERY_SMALL, _SMALL, _FALLEN = 1e-3, 0.1, 0.5
# How far off, as a part of the problem's size, a first sample in single precision is.
_SINGLE = 4.0 * float(np.finfo(np.float32).eps)
# Nodes in a row of which a distance can be told; and the number of the first, as people count.
_FEWEST_NODES, _FIRSTS = 3, (0.0, 1.0, 0.5)
_TINY = float(np.finfo(np.float64).tiny)


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
        if not _better(reference, undone, runs):
            return None
        return _agreement(reference, undone, coarse=coarse)

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


def why_start(
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
    try:
        opened, dts, _ = opened_files(*files)
        every = [(file.path, file.samples()) for file in opened]
    except (InputError, OSError):
        return None
    times = [Times(written.times, dt) for (_, written), dt in zip(every, dts, strict=True)]
    for clock in likely_clocks(files.problem, times):
        found = _explained(clock, certified, files, every, as_written, coarse)
        if found is not None:
            return found
    return None


def _explained(
    clock: Clock,
    certified: Callable[[], Reference],
    files: Files,
    every: Sequence[tuple[Path, Written]],
    as_written: Sequence[Run],
    coarse: bool,
) -> Explanation | None:
    """The explanation that files have other times, and maybe other columns, too."""
    problem = files.problem
    try:
        read = [
            run_of(path, clock.files[k].dt, clock.read(written, k, problem), problem)
            for k, (path, written) in enumerate(every)
        ]
    except InputError:
        return None
    runs = finite(sorted(read, key=lambda run: -run.dt))
    if len(runs) < files.fewest or len({run.quantities for run in runs}) > 1:
        return None
    reference = beginning(certified(), problem.frames - (0 if clock.ends else 1))
    if reference is None:
        return None

    def is_better(runs: Sequence[Run]) -> bool:
        if not as_written:
            return True
        same = [run.dt for run in runs] == [run.dt for run in as_written]
        return same and _better(reference, runs, as_written)

    if is_better(runs):
        agreement = _agreement(reference, runs, coarse=coarse)
        if agreement is not None:
            return Explanation("times", clock.words, clock.fix, agreement, runs)
    columns = explain_columns(reference, runs, coarse=coarse) if clock.begins else None
    if columns is None or not is_better(columns.runs):
        return None
    words, fix = f"{clock.words}, and {columns.words}", f"{clock.fix}; {columns.fix}"
    return dataclasses.replace(columns, cause="times", words=words, fix=fix)


def _agreement(reference: Reference, runs: Sequence[Run], *, coarse: bool = True) -> str | None:
    """How runs agree with a reference, as part of a sentence; None if they do not.

    Arguments:
        reference: at their samples.
        runs: as they may have been meant.
        coarse: whether they may be too coarse to show an order.
    """
    if not all(run.begins() for run in runs):
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

    Runs that do not begin with the initial state are wrong, however small their errors are.
    """
    if not all(run.begins() for run in runs):
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
