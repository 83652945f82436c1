"""A summary of a sweep, whatever the number of its rows."""

from __future__ import annotations

import dataclasses
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ropeode.display import Tabular
from ropeode.sweep.storage.load import sweep_in
from ropeode.validation import require

_RANGES = ("error_max", "observed_order", "largest_stable_dt")
_COUNTS = ("status", "order_verdict", "resolved", "expected_order")
_GROUPS = ("stepper", "reason", *_COUNTS)
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


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class SweepSummary(Tabular):
    """The contents of a sweep's folder.

    Arguments:
        folder: of the sweep.
        spec: of the sweep, as plain values.
        total: cases of the sweep.
        done: finished cases.
        steppers: by name.
        reasons: counts of each status with its reason, for the rows that have one.

    Examples:
        >>> from ropeode import run_sweep
        >>> grid = {"damping": [0.0, 0.1], "num_nodes": [4], "frames": [3]}
        >>> dict(run_sweep({"steppers": ["rk4"], "grid": grid}, "ropes").statuses)
        {'ok': 6}
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
    from ropeode.sweep.storage.row_files import read_parts

    index = sweep_in(folder)
    counts: dict[str, dict[str, Counter]] = {}
    ranges: dict[str, dict[str, tuple[float, float]]] = {}
    reasons: Counter[tuple[str, str]] = Counter()
    done = 0
    for table in read_parts(Path(folder) / index.rows, [*_GROUPS, *_RANGES]):
        done += table.num_rows
        ends = [(name, kind) for name in _RANGES for kind in ("min", "max")]
        groups = table.group_by([*_GROUPS]).aggregate([([], "count_all"), *ends])
        for row in groups.to_pylist():
            number, stepper = row["count_all"], row["stepper"]
            own = counts.setdefault(stepper, {name: Counter() for name in _COUNTS})
            for name in _COUNTS:
                # A run that diverged has no error at all.
                if name != "resolved" or row["status"] == "ok":
                    own[name][row[name]] += number
            of_stepper = ranges.setdefault(stepper, {})
            for name in _RANGES:
                if (low := row[f"{name}_min"]) is not None:
                    least, most = of_stepper.get(name, (low, low))
                    of_stepper[name] = min(least, low), max(most, row[f"{name}_max"])
            if row["reason"]:
                reasons[row["status"], row["reason"]] += number
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
