"""The JSON form of horizon studies."""

from __future__ import annotations

from typing import Literal, TypedDict

from ropeode.references.certificate import Role
from ropeode.render.schemas.accuracy_table import ProblemForm
from ropeode.study.horizon import DigitsLeft, Growth, Need


class TruthForm(TypedDict):
    """The runs in extended precision that stand for the truth.

    Fields:
        bits: working precision of the coarser and of the finer run.
        digits: to which the two agree.
        t_end: up to this time.
        failure: why they agree no longer; null if they do to the end.
        seconds: for both.
    """

    bits: tuple[int, int]
    digits: int
    t_end: float
    failure: str | None
    seconds: float


class RunForm(TypedDict):
    """A float64 run and its errors.

    Fields:
        solver: library and name.
        tolerance: its relative tolerance.
        role: `reference`, or that of a witness.
        steps: how many.
        errors: distance from the truth at each of `times`; null where the run did not arrive.
    """

    solver: str
    tolerance: float
    role: Literal["reference"] | Role
    steps: int
    errors: list[float | None]


class GrowthsForm(TypedDict):
    """How differences grow.

    Fields:
        float64: of the float64 runs; null where they grow by less than a digit.
        extended: of the runs in extended precision; null likewise.
    """

    float64: Growth | None
    extended: Growth | None


class ExponentForm(TypedDict):
    """The largest Lyapunov exponent, over the longest span.

    Fields:
        value: per time unit.
        ci95: the 95% interval.
        sign: `positive`, `negative` or `not told from zero`.
        resolution: what a separation that grows like t^2 would show as a rate in this span.
        t_end: the end of the span.
        failure: why it ends before it should; null if it does not.
    """

    value: float
    ci95: list[float]
    sign: Literal["positive", "negative", "not told from zero"]
    resolution: float
    t_end: float
    failure: str | None


class HorizonForm(TypedDict):
    """Where float64 loses which digit, and the precision that spans need: `ropeode horizon`.

    Fields:
        schema: name and version of this form.
        problem: what was solved.
        truth: what the runs are compared with.
        size: the largest component of the problem's first quantity, against which digits count.
        times: sample times that the truth covers.
        bound: the certificate's estimated bound at each of them; null past the last that all runs
            reached.
        horizon: first sample time at which the certificate is not trusted; null if it always is.
        horizon_reason: why; null likewise.
        largest_error_over_bound: of the reference, inside its horizon.
        runs: the reference and its witnesses.
        digits_lost_in_extended_precision: up to each of `times`.
        digits_left: for 15, 14, ... digits, where any run loses them.
        growth: of the differences between runs.
        lyapunov_exponent: the largest one.
        needs: one for each span.
    """

    schema: Literal["ropeode.horizon/1"]
    problem: ProblemForm
    truth: TruthForm
    size: float
    times: list[float]
    bound: list[float | None]
    horizon: float | None
    horizon_reason: str | None
    largest_error_over_bound: float
    runs: list[RunForm]
    digits_lost_in_extended_precision: list[float]
    digits_left: list[DigitsLeft]
    growth: GrowthsForm
    lyapunov_exponent: ExponentForm
    needs: list[Need]
