"""A sweep in a few numbers, however many rows it has."""

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
_EXPECTED, _RESOLVED = "expected_order", "resolved"
_COUNTS = ("status", "order_verdict", _RESOLVED, _EXPECTED)
# Different reasons that are counted at a time.
_MOST_REASONS = 10_000


@dataclasses.dataclass(frozen=True)
class StepperSummary:
    """What a sweep says of one stepper.

    Arguments:
        counts: for `status`, `order_verdict`, `resolved` and `expected_order`, how many rows
            have which value.
        ranges: the least and the greatest `error_max`, `observed_order` and
            `largest_stable_dt`, where there is one.
    """

    counts: Mapping[str, Counter]
    ranges: Mapping[str, tuple[float, float]]


@dataclasses.dataclass(frozen=True)
class SweepSummary:
    """What is in a sweep's folder.

    Arguments:
        folder: of the sweep.
        spec: what is asked for, as plain values.
        total: cases of the sweep.
        done: rows that are there.
        steppers: by name.
        reasons: how many rows have which status and reason, for those that have a reason.
    """

    folder: Path
    spec: Mapping[str, Any]
    total: int
    done: int
    steppers: Mapping[str, StepperSummary]
    reasons: Mapping[tuple[str, str], int]

    @property
    def statuses(self) -> Counter:
        """How many rows have which status."""
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
    from ropeode.sweep.storage.row_files import read_parts

    index = sweep_in(folder)
    counts: dict[str, dict[str, Counter]] = {}
    ranges: dict[str, dict[str, tuple[float, float]]] = {}
    reasons: Counter[tuple[str, str]] = Counter()
    done = 0
    wanted = ["stepper", "reason", *_COUNTS, *_RANGES]
    for table in read_parts(Path(folder) / index.rows, wanted):
        done += table.num_rows
        for name in _COUNTS:
            for stepper, value, number in _grouped(table, ["stepper", name]):
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
    found = table.select(names).group_by(names).aggregate([([], "count_all")])
    return [tuple(row[name] for name in [*names, "count_all"]) for row in found.to_pylist()]


def _extremes(table: pa.Table) -> list[tuple]:
    """Each stepper with the least and the greatest value of each column of `_RANGES`."""
    asked = [(name, kind) for name in _RANGES for kind in ("min", "max")]
    found = table.select(["stepper", *_RANGES]).group_by("stepper").aggregate(asked)
    names = ["stepper", *(f"{name}_{kind}" for name, kind in asked)]
    return [tuple(row[name] for name in names) for row in found.to_pylist()]
