"""The JSON form of accuracy tables."""

from __future__ import annotations

from typing import Any, Literal, TypedDict

from ropeode.analysis.order import LeftOut, Verdict
from ropeode.references.certificate import Level, Role, Sampling
from ropeode.study.accuracy_table import Row


class ProblemForm(TypedDict):
    """What was solved.

    Fields:
        name: of the problem.
        frames: number of intervals between samples.
        t_start: first sample time.
        t_end: last sample time.
        parameters: of the problem; for a rope `kind`, `frames` and the arguments of `Rope`; empty
            if the problem has none.
    """

    name: str
    frames: int
    t_start: float
    t_end: float
    parameters: dict[str, Any]


class WitnessForm(TypedDict):
    """A run that the reference was checked against.

    Fields:
        solver: library and name.
        tolerance: its relative tolerance.
        role: `looser`, `tighter` (the primary solver at another tolerance), `neighbour` (from an
            initial state one unit of rounding away), `short steps` (with a limit on the step),
            `rounding` (with each rounding of the right-hand side moved by a unit), `independent`
            (another library), `more digits` (Taylor series beyond float64, where heyoka is
            installed), `close look` (another library, with steps that end where the right-hand side
            does something between those of the others), `fewer digits` (beside a run in extended
            precision).
        steps: number of steps that it tried; for SciPy, that it accepted.
        difference: its largest distance from the reference inside the horizon, in positions (or
            the state); null where it did not arrive.
    """

    solver: str
    tolerance: float
    role: Role
    steps: int
    difference: float | None


class ReferenceForm(TypedDict):
    """What the errors are measured against.

    Fields:
        level: `consensus`: checked against other float64 runs; `extended`: computed in extended
            precision and rounded.
        solver: library and name of the primary solver.
        rtol: its relative tolerance.
        atol: its absolute tolerance, in the units of the state; one number, or one for each
            component.
        steps: number of steps that it tried.
        stiff: whether the solvers are implicit.
        witnesses: the runs that it was checked against.
        sampling: where the right-hand side was evaluated between the steps; null in old files.
        drift_max: for a problem with constraints, how far the trusted samples violate them, by
            quantity; else empty.
        bound_max: estimated error bound in this norm's quantity at the last trusted sample, where
            it is largest.
        accuracy: largest bound that counts as trusted, in the units of positions (or of the state).
        horizon: first sample time that is not trusted; null if all are.
        horizon_reason: why; null if all are trusted.
        versions: of the packages and of Python.
    """

    level: Level
    solver: str
    rtol: float
    atol: float | list[Any]
    steps: int
    stiff: bool
    witnesses: list[WitnessForm]
    sampling: Sampling | None
    drift_max: dict[str, float]
    bound_max: float
    accuracy: float
    horizon: float | None
    horizon_reason: str | None
    versions: dict[str, str]


class ConstantForm(TypedDict):
    """The error constant C of C dt^p, by theory and in the runs.

    Fields:
        order: p: the order of a step; where nothing is predicted, the one whole number that the
            observed order can be, else null.
        predicted: C by theory; null where there is none.
        why: the reason for that.
        measured: the largest error over dt^p at `dt`; null where no run can be used.
        dt: the finest step size whose run is stable, and whose error is 300 times what the
            reference and round-off leave open, and 30 times what one rounding in each step would
            make if it repeated.
        ratio: `measured` over `predicted`.
        agree_10_percent: the largest step size from which on, down to `dt`, the two agree to within
            10%; null where they do not.
        agree_1_percent: the same to within 1%.
    """

    order: int | None
    predicted: float | None
    why: str | None
    measured: float | None
    dt: float | None
    ratio: float | None
    agree_10_percent: float | None
    agree_1_percent: float | None


class OrderForm(TypedDict):
    """The observed order of one stepper.

    Fields:
        stepper: as in `rows`.
        solves_this_problem: false for a stepper that is meant for another kind of problem, such as
            one that keeps lengths, on a rope with springs.
        expected: declared order; 0 if the stepper declares that it converges to another solution;
            null where the right-hand side jumps, since orders are declared for smooth ones.
        observed: the slope of log(error) over log(dt); null if undetermined.
        ci95: its 95% confidence interval; null if undetermined.
        verdict: `converges`, `does not converge` or `undetermined`.
        why: what is missing, if undetermined; else null.
        used: step sizes in the fit, from coarse to fine.
        left_out: the others.
        error_constant: predicted and measured; null where it was not asked for
            (`accuracy_table(..., predict=True)` asks).
    """

    stepper: str
    solves_this_problem: bool
    expected: int | None
    observed: float | None
    ci95: list[float] | None
    verdict: Verdict
    why: str | None
    used: list[float]
    left_out: list[LeftOut]
    error_constant: ConstantForm | None


class AccuracyTableForm(TypedDict):
    """Errors and observed orders of steppers on one problem: `ropeode table --format json`.

    Fields:
        schema: name and version of this form.
        problem: what was solved.
        norm: name of the norm.
        reference: what the errors are measured against.
        rows: one for each run.
        orders: one for each stepper.
    """

    schema: Literal["ropeode.accuracy-table/1"]
    problem: ProblemForm
    norm: str
    reference: ReferenceForm
    rows: list[Row]
    orders: list[OrderForm]
