"""The accuracy table: errors and observed orders of steppers on one problem."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from functools import partial
from pathlib import Path
from time import process_time
from typing import TYPE_CHECKING, Any, ClassVar, Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ropeode.analysis import (
    RESOLUTION_FACTOR,
    ObservedOrder,
    error_series,
    in_other_units,
    moved,
    observed_order,
    round_off,
)
from ropeode.display import Tabular
from ropeode.errors import InputError
from ropeode.json_form import json_shows
from ropeode.norms import Norm, norm_for
from ropeode.problems import Problem
from ropeode.progress import Progress, bar, shows_progress, silent
from ropeode.references import (
    Asked,
    Reference,
    ReferenceInNorm,
    ReferenceOptions,
    problem_of,
    reference_for,
)
from ropeode.simulation import Method, Status, Trajectory, method_of, simulate
from ropeode.steppers import ProblemClass, StepFunction, Stepper, as_stepper
from ropeode.study.each_once import each_once, repeated
from ropeode.study.error_constant import ErrorConstant, error_constant
from ropeode.threads import cores, threads
from ropeode.validation import bad_value, counted, whole_number

if TYPE_CHECKING:
    from ropeode.theory import PredictedError

DEFAULT_STEPPERS = (
    "explicit-euler",
    "semi-implicit-euler",
    "stormer-verlet:start=rest",
    "stormer-verlet",
    "rk4",
    "constraint-verlet",
    "rattle",
)
DEFAULT_STEPS_PER_FRAME = tuple(2**k for k in range(4, 15))

# Seconds of processor time that predictions "in time" may take where runs take less. Not wall time:
# what a table says may not depend on what else the machine does.
_LEAST_TIME = 15.0
# Of the states of runs that run side by side.
_MOST_BYTES = 2**28

IN_TIME: Literal["in time"] = "in time"
Predict = bool | Literal["in time"]


@dataclasses.dataclass(frozen=True)
class Row:
    """One run of the table.

    Arguments:
        stepper: its name with options.
        steps_per_frame: steps between two samples.
        dt: step size (the largest, where frames differ in length).
        status: of the run: `ok`, `diverged` or `unsolved`, as for a `Trajectory`.
        diverged_at: frame of the first state that is not finite.
        error_final: at the last sample inside the trust horizon; None if there is none, or
            if it is below `resolution`.
        error_max: the largest over these samples; likewise.
        error_rms: the root mean square over them; likewise.
        resolved: whether the reference resolves `error_max`.
        resolution: ten times the reference's estimated bound.
        round_off: estimated from the same run in other units; None if it diverged, or if the
            stepper computes its own forces, in its own units.
        rhs_evaluations: of the right-hand side; None where nobody can count them.
        seconds: to run, without compiling, beside another run on each other processor;
            not-a-number for a trajectory from a file.
    """

    stepper: str
    steps_per_frame: int
    dt: float
    status: Status
    diverged_at: int | None
    error_final: float | None
    error_max: float | None
    error_rms: float | None
    resolved: bool
    resolution: float
    round_off: float | None
    rhs_evaluations: int | None
    seconds: float = dataclasses.field(compare=False)


@json_shows(
    *("stepper", "solves_this_problem=solves", "expected", "order.observed", "order.ci95"),
    *("order.verdict", "order.why", "order.used", "order.left_out", "error_constant=constant"),
)
@dataclasses.dataclass(frozen=True)
class StepperOrder:
    """The order of one stepper.

    Arguments:
        stepper: its name with options.
        expected: what it declares for this class of problem (0: it converges to another
            solution); None where it declares nothing, or for a multistep method where the
            right-hand side jumps.
        order: what was observed.
        solves: whether the stepper is meant for this kind of problem. One that keeps lengths is
            not, on a rope with springs: it solves another one.
        constant: of the error, as theory predicts it and as the runs show it; None where nobody
            asked for it (``accuracy_table(..., predict=True)`` asks).
    """

    stepper: str
    expected: int | None
    order: ObservedOrder
    solves: bool = True
    constant: ErrorConstant | None = None


@json_shows("problem", "norm", "reference=measured_against", "rows", "orders")
@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class AccuracyTable(Tabular):
    """Errors and observed orders, with the reference that they rest on.

    Arguments:
        problem: what was solved.
        reference: with its certificate.
        norm: in which errors are measured.
        rows: one for each run, steppers in the order asked for.
        orders: one for each stepper.

    Examples:
        >>> from ropeode import Rope, accuracy_table
        >>> table = accuracy_table(Rope(num_nodes=4).problem(frames=3), ["rk4"], [16, 32, 64])
        >>> [f"{row.dt}: {row.error_max:.1e}" for row in table.rows]
        ['0.0625: 9.0e-07', '0.03125: 6.1e-08', '0.015625: 3.9e-09']
    """

    SCHEMA: ClassVar[str] = "ropeode.accuracy-table/1"

    problem: Problem
    reference: Reference
    norm: Norm
    rows: tuple[Row, ...]
    orders: tuple[StepperOrder, ...]

    @property
    def measured_against(self) -> ReferenceInNorm:
        """What the errors are measured against: the reference, in their norm."""
        return ReferenceInNorm(self.reference, self.norm)


@shows_progress
def accuracy_table(
    problem: Problem | Reference,
    steppers: Any = None,
    steps_per_frame: ArrayLike = DEFAULT_STEPS_PER_FRAME,
    *,
    norm: str | None = None,
    predict: Predict = False,
    progress: Progress = bar,
    **asked: Unpack[Asked],
) -> AccuracyTable:
    """Run steppers at several step sizes and compare them with a reference.

    The steppers are compiled while the reference is computed, and then run side by side, one on
    each processor.

    Arguments:
        problem: what to solve, or a reference of it that exists already.
        steppers: a list of whatever `ropeode.as_stepper` takes; by default those of
            `DEFAULT_STEPPERS` that can run on the problem and are meant for it.
        steps_per_frame: whole numbers, each once.
        norm: one of `ropeode.norms.NORMS`; by default the problem's first.
        predict: predict the error constants from single steps, and compare them with the runs.
            "in time": those that take no more processor time than the runs, or 15 seconds if that
            is more; so it depends on the machine which they are.
        progress: called with what is being done and the fraction that is done.
        asked: options of `ropeode.reference`: accuracy, rtol, level, digits and time_limit.

    Raises:
        InputError: one line for each argument that cannot be used.
        ReferenceRefused: no reference can be had for the problem.

    Examples:
        >>> from ropeode import Rope, accuracy_table
        >>> rope = Rope(num_nodes=4).problem(frames=3)
        >>> table = accuracy_table(rope, ["rk4", "velocity-verlet"], [16, 32, 64])
        >>> for each in table.orders:
        ...     print(each.stepper, round(each.order.observed, 1), each.order.verdict)
        rk4 3.9 converges
        velocity-verlet 2.0 converges
    """
    measure = norm_for(problem_of(problem), norm)
    options = ReferenceOptions(**asked)
    (table,) = tables_in_norms(
        problem, steppers, steps_per_frame, (measure,), predict, options, progress
    )
    return table


def tables_in_norms(
    given: Problem | Reference,
    steppers: Any,
    steps_per_frame: ArrayLike,
    norms: Sequence[Norm],
    predict: Predict,
    options: ReferenceOptions,
    progress: Progress,
) -> tuple[AccuracyTable, ...]:
    """The same runs, measured in several norms; arguments and exceptions of `accuracy_table`."""
    problem = problem_of(given)
    chosen, steps_per_frame = chosen_steppers(problem, steppers), check_steps(steps_per_frame)
    # Each run is repeated in other units, which shows its round-off.
    rescaled = in_other_units(problem)
    with threads(_side_by_side(problem)) as pool:
        methods = [method_of(stepper, problem) for stepper in chosen]
        compiled = [
            pool.submit(simulate, each, method, 1)
            for method in methods
            for each in (problem, rescaled)
        ]
        progress("compiling the steppers", 0.0)
        reference = reference_for(given, options, lambda text, _: progress(text, 0.0))
        for each in compiled:
            each.result()
        began = process_time()
        # Those that take longest first, so that no processor is left without work at the end.
        running = {
            pool.submit(rows_of_run, problem, rescaled, method, steps, reference, norms): steps
            for steps in sorted(steps_per_frame, reverse=True)
            for method in methods
        }
        finished, done = {}, 0
        for each in as_completed(running):
            rows, done = each.result(), done + running[each]
            finished[rows[0].stepper, rows[0].steps_per_frame] = rows
            text = f"{rows[0].stepper}: {counted(rows[0].steps_per_frame, 'step')} per frame"
            progress(text, done / (len(chosen) * sum(steps_per_frame)))
        predictions: list[PredictedError | str | None] = [None] * len(chosen)
        if predict:
            progress("predicting the errors", 1.0)
            in_time, ran = predict == IN_TIME, process_time() - began
            latest = process_time() + max(_LEAST_TIME, ran) if in_time else None
            # The fastest first: as many as there is time for.
            seconds = [finished[each.label, max(steps_per_frame)][0].seconds for each in chosen]
            predicting = {
                i: pool.submit(_predicted_error, reference, methods[i], latest)
                for i in np.argsort(seconds)
            }
            predictions = [predicting[i].result() for i in range(len(chosen))]
    progress("done", 1.0)
    every = [finished[stepper.label, steps] for stepper in chosen for steps in steps_per_frame]
    return tuple(
        table_of_rows([rows[i] for rows in every], chosen, predictions, reference, norm)
        for i, norm in enumerate(norms)
    )


class _TooLate(Exception):
    """A prediction would take longer than it may."""


def _predicted_error(
    reference: Reference, method: Method, latest: float | None
) -> PredictedError | str:
    """What theory predicts, or why it predicts nothing.

    Arguments:
        latest: the processor time at which it is given up, between two of its parts; None for
            no limit.
    """
    # Not above: it takes as long to import as JAX, and most tables predict nothing.
    from ropeode.theory import predicted_error

    def in_time(text: str, done: float | None) -> None:
        del text, done
        if latest is not None and process_time() > latest:
            raise _TooLate

    try:
        in_time("", None)
        return predicted_error(reference, method, in_time)
    except _TooLate:
        return "that would have taken longer than the runs"


def table_of_rows(
    rows: Sequence[Row],
    chosen: Sequence[Stepper],
    predictions: Sequence[PredictedError | str | None],
    reference: Reference,
    norm: Norm,
) -> AccuracyTable:
    """The table of runs.

    Arguments:
        rows: of the runs, in the order of the steppers.
        chosen: the steppers.
        predictions: for each of them what theory predicts; None where nobody asked for it.
        reference: that the rows rest on.
        norm: of the errors in the rows.
    """
    problem = reference.problem
    resolution = float(RESOLUTION_FACTOR * reference.bound(norm)[-1])
    size = moved(reference, norm)
    orders = []
    for stepper, prediction in zip(chosen, predictions, strict=True):
        runs = [row for row in rows if row.stepper == stepper.label]
        constant_of = None
        if prediction is not None:
            errors = {row.dt: (row.error_max, row.round_off) for row in runs}
            constant_of = partial(error_constant, reference, norm, errors, prediction=prediction)
        orders.append(order_of(problem, stepper, runs, resolution, size, constant_of))
    return AccuracyTable(problem, reference, norm, tuple(rows), tuple(orders))


def _side_by_side(problem: Problem) -> int:
    """How many runs run at a time; each keeps its states and those of its double."""
    of_a_run = 2 * len(problem.ts) * problem.y0.nbytes
    return max(1, min(cores(), _MOST_BYTES // of_a_run))


def default_steppers(problem: Problem) -> list[str]:
    """Those of `DEFAULT_STEPPERS` that can run on a problem and do not solve another one."""
    return [
        name
        for name in DEFAULT_STEPPERS
        if (stepper := as_stepper(name)).refusal(problem) is None
        and stepper.solves(problem_class(problem))
    ]


def chosen_steppers(problem: Problem, given: Any) -> list[Stepper]:
    """Steppers that can run on a problem; for None, those that a table has by default.

    Raises:
        InputError: one line for each that does not exist, is repeated or cannot run.
    """
    problem.require_equations()
    chosen = check_steppers(default_steppers(problem) if given is None else given)
    if refusals := [refusal for each in chosen if (refusal := each.refusal(problem))]:
        raise InputError(refusals)
    return chosen


def check_steppers(given: Any, folder: Path | None = None) -> list[Stepper]:
    """Steppers from whatever `ropeode.as_stepper` takes, each once.

    Arguments:
        given: a list; one stepper may stand alone.
        folder: that relative file names start from; the current one by default.

    Raises:
        InputError: one line for each that does not exist or is repeated.
    """

    def fault(stepper: Stepper, earlier: Stepper | None) -> str | None:
        if earlier is None:
            return None
        another = earlier is not stepper and isinstance(stepper, StepFunction)
        fix = "name them apart with as_stepper(function, label=...)" if another else "drop one"
        return repeated("stepper", stepper.label, fix)

    def make(what: Any) -> Stepper:
        return as_stepper(what, folder=folder or Path())

    return each_once("stepper", given, make, "rk4", fault)


class StepsPerFrame(tuple[int, ...]):
    """Numbers of steps per frame that have been checked."""


def check_steps(given: Any) -> StepsPerFrame:
    """Numbers of steps per frame, each once.

    Raises:
        InputError: one is not a whole number >= 1, or is repeated, or there is none.
    """
    if isinstance(given, StepsPerFrame):
        return given
    try:
        steps = StepsPerFrame(whole_number(each, at_least=1) for each in given)
        if not steps:
            raise ValueError("there is none")
        if len(set(steps)) < len(steps):
            raise ValueError("one is repeated")
    except (TypeError, ValueError) as error:
        allowed = f"different whole numbers >= 1 ({error})"
        raise bad_value("steps_per_frame", given, allowed, "for example 16, 32, 64") from None
    return steps


def rows_of_run(
    problem: Problem,
    rescaled: Problem,
    method: Method,
    steps: int,
    reference: Reference,
    norms: Sequence[Norm],
    progress: Progress = silent,
) -> tuple[Row, ...]:
    """One run as a row in each norm.

    Arguments:
        problem: what is solved.
        rescaled: the same `in_other_units`, which shows the round-off.
        method: with what, ready to run.
        steps: per frame.
        reference: of the problem.
        norms: in which the error is measured.
        progress: of the run.
    """
    run = simulate(problem, method, steps, progress=progress)
    rounding: Sequence[float | None] = [None] * len(norms)
    if run.status == "ok":
        rounding = round_off(run, rescaled, reference.trusted, norms, method)
    return tuple(
        _row(run, each, reference, norm) for norm, each in zip(norms, rounding, strict=True)
    )


def _row(run: Trajectory, rounding: float | None, reference: Reference, norm: Norm) -> Row:
    errors: dict[str, Any] = dict.fromkeys(("error_final", "error_max", "error_rms"))
    if run.status == "ok":
        series = error_series(run, reference, norm.name)
        errors = {
            "error_final": series.final,
            "error_max": series.max,
            "error_rms": series.rms,
        }
    return Row(
        stepper=run.stepper.label,
        steps_per_frame=run.steps_per_frame,
        dt=run.dt,
        status=run.status,
        diverged_at=run.diverged_at,
        **errors,
        round_off=rounding,
        resolved=errors["error_max"] is not None,
        resolution=float(RESOLUTION_FACTOR * reference.bound(norm)[-1]),
        rhs_evaluations=run.rhs_evaluations,
        seconds=run.seconds,
    )


def order_of(
    problem: Problem,
    stepper: Stepper,
    runs: Sequence[Any],
    resolution: float,
    size: float,
    constant_of: Callable[[ObservedOrder], ErrorConstant] | None = None,
) -> StepperOrder:
    """The order of a stepper, from its runs with several step sizes.

    Arguments:
        problem: what was solved.
        stepper: with what.
        runs: one for each step size, with the fields `dt`, `status`, `error_max` and
            `round_off` of a `Row`.
        resolution: below which an error is unresolved.
        size: how far the solution moves.
        constant_of: holds the runs against theory, given the order that they show; None where
            nothing is predicted.
    """

    def error_of(run: Any) -> float:
        if run.status != "ok":
            return np.inf
        # Unresolved: any number below the resolution is left out for that.
        return run.error_max if run.error_max is not None else 0.0

    of_class = problem_class(problem)
    # After a jump a multistep method has no earlier slopes of the same smooth force.
    declared = None if problem.jump_times and stepper.equal_frames else stepper.order(of_class)
    observed = partial(
        observed_order,
        [run.dt for run in runs],
        [error_of(run) for run in runs],
        resolution=resolution,
        rounding=[run.round_off or 0.0 for run in runs],
        motion=size,
        solved=[run.status != "unsolved" for run in runs],
    )
    constant = None if constant_of is None else constant_of(observed())
    if constant is not None and constant.predicted is not None:
        order = observed(expected=constant.order, constant=constant.predicted)
    else:
        order = observed(expected=declared)
    return StepperOrder(
        stepper=stepper.label,
        expected=declared,
        order=order,
        solves=stepper.solves(of_class),
        constant=constant,
    )


def problem_class(problem: Problem) -> ProblemClass:
    """What the declared orders of steppers depend on."""
    mechanics = problem.mechanics
    if mechanics is None:
        return ProblemClass(damped=True, at_rest=False, rigid=problem.rigid)
    # A stepper that keeps lengths sees the damping of the nodes apart from that of the links.
    damping = mechanics.links(problem.args).damping if mechanics.links else None
    if damping is None and mechanics.damping is not None:
        damping = mechanics.damping(problem.args)
    return ProblemClass(
        damped=damping is None or bool(np.any(damping.rate)),
        at_rest=not np.any(problem.y0[1]),
        rigid=problem.rigid,
    )
