"""The columns of a sweep's table: the meaning and the type of each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

# A row by column name.
Row = dict[str, Any]
# Names as pyarrow has them; every value may be missing.
Type = Literal["string", "int64", "double", "bool"]


class Column(NamedTuple):
    """A column.

    Fields:
        type: of its values, each of which may also be None.
        meaning: in one line.
    """

    type: Type
    meaning: str


STATUSES: Mapping[str, str] = {
    "ok": "the run stayed finite and was compared with the reference",
    "diverged": "the state stopped being finite, at frame `diverged_at`",
    "unsolved": "the equations of an implicit step were not solved, at frame `diverged_at`",
    "no-reference": "the run stayed finite, but there is no reference; `reason` says why",
    "failed": "the case could not be run; `reason` says why",
    "timed-out": "the case took longer than its time limit, twice",
    "worker-died": "the process that ran the case died each time",
}

INPUTS: Mapping[str, Column] = {
    "key": Column("string", "sha256 of everything that determines the row"),
    "problem": Column("string", "name of the problem, or FILE.py:NAME"),
    "seed": Column("int64", "of the random design; missing without one"),
    "draw": Column("int64", "number of the draw with this seed, from 0 on"),
    "stepper": Column("string", "its name with options"),
    "steps_per_frame": Column("int64", "steps between two samples"),
    "norm": Column("string", "in which errors are measured"),
    "parameters": Column("string", "all parameters of the problem, as JSON"),
}

RESULTS: Mapping[str, Column] = {
    "status": Column("string", "one of " + ", ".join(STATUSES)),
    "reason": Column("string", "why the status is not ok, or why a result is missing"),
    "dt": Column("double", "step size; the largest where frames differ in length"),
    "diverged_at": Column("int64", "frame of the first state that is not finite"),
    "rhs_evaluations": Column("int64", "evaluations of the right-hand side in the run"),
    "error_final": Column("double", "at the last trusted sample; missing if unresolved"),
    "error_max": Column("double", "largest over the trusted samples; missing if unresolved"),
    "error_rms": Column("double", "root mean square over them; missing if unresolved"),
    "resolved": Column("bool", "whether the reference resolves error_max"),
    "resolution": Column("double", "ten times the reference's bound; unresolved below it"),
    "round_off": Column("double", "estimated from the same run in other units"),
    "motion_size": Column("double", "how far the solution moves inside the horizon, in the norm"),
    "reference": Column("string", "key of the reference, and the name of its file"),
    "trusted": Column("int64", "number of leading samples inside the trust horizon"),
    "horizon": Column("double", "first sample time outside it; missing if there is none"),
    "horizon_reason": Column("string", "why the horizon ends there"),
    "observed_order": Column("double", "slope of log(error) over log(dt); missing if undetermined"),
    "order_low": Column("double", "lower end of its 95% interval"),
    "order_high": Column("double", "upper end of its 95% interval"),
    "order_verdict": Column("string", "converges, does not converge or undetermined"),
    "order_used": Column("string", "steps per frame from which the order was observed"),
    "order_left_out": Column("string", "steps per frame that were left out, with the reasons"),
    "order_why": Column("string", "what is missing where the order is undetermined"),
    "expected_order": Column("int64", "the stepper's own claim; 0: it solves another problem"),
    "motion": Column("string", "of a rope: diverges, settles, never_settles, ..."),
    "swings": Column("int64", "how often a rope swung from one side to the other"),
    "settled_at": Column("int64", "frame from which on a rope was at rest"),
    "stability_limit": Column("int64", "fewest stable steps per frame, if requested"),
    "largest_stable_dt": Column("double", "step size there, if requested"),
    "seconds": Column("double", "that the case took; the only column that another run changes"),
}
# Rows that say nothing of the case alone: a longer limit, or another machine, may change them.
TIMED_OUT, DIED = "timed-out", "worker-died"

# Each sweep has these, and one column for each parameter of its problem, named after it.
COLUMNS: Mapping[str, Column] = {**INPUTS, **RESULTS}


def failed_row(
    inputs: Mapping[str, object], status: str, reason: str, seconds: float | None = None
) -> Row:
    """The row of a case that has no results.

    Arguments:
        inputs: the values of its input columns.
        status: one of `STATUSES`.
        reason: in one line.
        seconds: that it took, where that is known.
    """
    results = {"status": status, "reason": reason, "seconds": seconds}
    return {**inputs, **dict.fromkeys(RESULTS), **results}
