"""A summary of a sweep, whatever the number of its rows."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ropeode.sweep.storage.load import sweep_in
from ropeode.validation import require

if TYPE_CHECKING:
    import pyarrow as pa

_RANGES = ("error_max", "observed_order", "largest_stable_dt")
_COUNTS = ("status", "order_verdict", "resolved", "expected_order")
# Different reasons that are counted at the same time.
_MOST_REASONS = 10_000


@dataclasses.dataclass(frozen=True)
class StepperSummary:
    """The results of one stepper in a sweep.

    Arguments:
        counts: of the values of `status`, `order_verdict`, `expected_order` and, where the
            status is ok, `resolved`.
        ranges: the least and the greatest `error_max`, `observed_order` and
            `largest_stable_dt`, where there is one.
    """

    counts: Mapping[str, Counter]
    ranges: Mapping[str, tuple[float, float]]


@dataclasses.dataclass(frozen=True)
class SweepSummary:
    """The contents of a sweep's folder.

    Arguments:
        folder: of the sweep.
        spec: of the sweep, as plain values.
        total: cases of the sweep.
        done: finished cases.
        steppers: by name.
        reasons: counts of each status with its reason, for the rows that have one.
    """

    folder: Path
    spec: Mapping[str, Any]
    total: int
    done: int
    steppers: Mapping[str, StepperSummary]
    reasons: Mapping[tuple[str, str], int]

    @property
    def statuses(self) -> Counter:
        """The number of rows with each status."""
        return sum((each.counts["status"] for each in self.steppers.values()), Counter())


def summarize(folder: str | Path) -> SweepSummary:
    """Read a sweep, a partition at a time.

    Arguments:
        folder: of the sweep.

    Raises:
        InputError: there is no sweep in it.
        RopeodeError: a file is damaged.
    """
    require("pyarrow", "data", "sweeps")
    import pyarrow.compute as pc

    from ropeode.sweep.storage.row_files import read_parts

    index = sweep_in(folder)
    counts: dict[str, dict[str, Counter]] = {}
    ranges: dict[str, dict[str, tuple[float, float]]] = {}
    reasons: Counter[tuple[str, str]] = Counter()
    done = 0
    wanted = ["stepper", "reason", *_COUNTS, *_RANGES]
    for table in read_parts(Path(folder) / index.rows, wanted):
        done += table.num_rows
        # A run that diverged has no error at all.
        measured = table.filter(pc.field("status") == "ok")
        for name in _COUNTS:
            rows = measured if name == "resolved" else table
            for stepper, value, number in _grouped(rows, ["stepper", name]):
                of_stepper = counts.setdefault(stepper, {name: Counter() for name in _COUNTS})
                of_stepper[name][value] += number
        for stepper, *ends in _extremes(table):
            own = ranges.setdefault(stepper, {})
            for name, low, high in zip(_RANGES, ends[::2], ends[1::2], strict=True):
                if low is not None:
                    before = own.get(name, (low, high))
                    own[name] = (min(low, before[0]), max(high, before[1]))
        for status, reason, number in _grouped(table, ["status", "reason"]):
            if reason:
                reasons[status, reason] += number
        if len(reasons) > _MOST_REASONS:
            reasons = Counter(dict(reasons.most_common(_MOST_REASONS // 2)))
    return SweepSummary(
        folder=Path(folder),
        spec=index.spec,
        total=index.count,
        done=done,
        steppers={name: StepperSummary(counts[name], ranges[name]) for name in sorted(counts)},
        reasons=dict(reasons.most_common()),
    )


def _grouped(table: pa.Table, names: list[str]) -> list[tuple]:
    """The different values of columns, and how often each occurs."""
    groups = table.select(names).group_by(names).aggregate([([], "count_all")])
    return [tuple(row[name] for name in [*names, "count_all"]) for row in groups.to_pylist()]


def _extremes(table: pa.Table) -> list[tuple]:
    """Each stepper with the least and the greatest value of each column of `_RANGES`."""
    ends = [(name, kind) for name in _RANGES for kind in ("min", "max")]
    groups = table.select(["stepper", *_RANGES]).group_by("stepper").aggregate(ends)
    names = ["stepper", *(f"{name}_{kind}" for name, kind in ends)]
    return [tuple(row[name] for name in names) for row in groups.to_pylist()]
