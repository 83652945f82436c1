"""What error methods have for what cost, against a reference."""

from __future__ import annotations

import dataclasses
import sys
from collections.abc import Sequence
from typing import Any, ClassVar, Literal, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ropeode.analysis import RESOLUTION_FACTOR, UNSTABLE_FROM, energy_errors, error_series, moved
from ropeode.display import Tabular
from ropeode.errors import InputError
from ropeode.json_form import json_shows
from ropeode.norms import Norm, norm_for
from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.progress import Progress, bar, part_of, shows_progress
from ropeode.references import (
    AskedButRtol,
    Reference,
    ReferenceInNorm,
    ReferenceOptions,
    problem_of,
    reference_for,
)
from ropeode.simulation import step_size
from ropeode.study.accuracy_table import check_steps
from ropeode.study.energy import energies_of
from ropeode.study.in_turns import Errors, Timed, run_in_turns
from ropeode.study.methods import Attempt, LadderMethod, Status, chosen_methods
from ropeode.study.pareto import Reached, cost_to_reach, pareto_front
from ropeode.threads import cores, threads
from ropeode.validation import (
    bad_value,
    check_all,
    check_positive,
    check_whole,
    positive_number,
    unknown,
)

DEFAULT_METHODS = (
    "explicit-euler",
    "semi-implicit-euler",
    "velocity-verlet",
    "yoshida4",
    "rk4",
    "diffrax:Tsit5",
    "scipy:DOP853",
    "scipy:LSODA",
)
DEFAULT_STEPS = tuple(4**k for k in range(1, 8))
DEFAULT_RTOL = tuple(10.0**-k for k in range(3, 13))
RUN_LIMIT = 5.0
ROUNDS = 5
# The errors whose cost people quote, in the unit of the errors.
TARGETS = (1e-2, 1e-4, 1e-6, 1e-9)
_TIGHTEST, _LOOSEST = 1e-13, 0.1
# Stands for the error of an energy that is not finite, as in the norms: None would say that it is
# small.
INFINITE = sys.float_info.max

Cost = Literal["seconds", "rhs_evaluations", "steps"]
Measure = Literal["error_final", "error_max", "error_rms", "energy_error"]
COSTS: tuple[Cost, ...] = ("seconds", "rhs_evaluations", "steps")
MEASURES: tuple[Measure, ...] = ("error_final", "error_max", "error_rms", "energy_error")


@dataclasses.dataclass(frozen=True)
class WorkRow:
    """A method at one effort.

    Arguments:
        method: its name with options.
        family: of methods that it belongs to.
        effort: steps per frame, or the relative tolerance.
        dt: step size (the largest, where frames differ in length); None for adaptive methods.
        rtol: relative tolerance; None for methods with constant steps.
        error_final: at the last sample inside the trust horizon; None where the run is not `ok`
            or `unstable`, or the error is unresolved.
        error_max: the largest over these samples; likewise.
        error_rms: the root mean square over them; likewise.
        energy_error: the largest difference from the true energy; None also where the problem has
            no energy, and the largest float where that of the run is not finite.
        error_over_tolerance: `error_max` over the tolerance, which is the relative one times the
            scale of the state; None for methods with constant steps.
        resolved: whether the reference resolves `error_max`.
        status: `ok`; `unstable`: the error is larger than twice the motion; `diverged`: the state
            is not finite; `unsolved`: the equations of an implicit step were not solved;
            `step limit`; `time limit`; or `failed`.
        why: the status is not `ok`; None if it is.
        rhs_evaluations: of the right-hand side, or the acceleration; None where nobody counts them.
        jacobian_evaluations: of its Jacobian; likewise.
        steps: how many (diffrax counts rejected ones, SciPy does not); None likewise.
        seconds: the median of the rounds, without compiling; of a run that is not `ok`, that of its
            only run, and None where it was not run.
        seconds_min: the shortest.
        seconds_max: the longest.
    """

    method: str
    family: str
    effort: float
    dt: float | None
    rtol: float | None
    error_final: float | None
    error_max: float | None
    error_rms: float | None
    energy_error: float | None
    error_over_tolerance: float | None
    resolved: bool
    status: Status
    why: str | None
    rhs_evaluations: int | None
    jacobian_evaluations: int | None
    steps: int | None
    seconds: float | None = dataclasses.field(compare=False)
    seconds_min: float | None = dataclasses.field(compare=False)
    seconds_max: float | None = dataclasses.field(compare=False)


@dataclasses.dataclass(frozen=True)
class CostToReach:
    """What an error costs with one method.

    Arguments:
        method: its name with options.
        family: of methods that it belongs to.
        error: that is reached.
        cost: the least that is known to suffice; None where nothing certified does.
        at_most: `cost` is that of a run with a smaller error, since none has a larger one.
        ratio: `cost` over that of the best method; None likewise.
        best_of_family: whether no method of the family costs less.
    """

    method: str
    family: str
    error: float
    cost: float | None
    at_most: bool
    ratio: float | None
    best_of_family: bool


@dataclasses.dataclass(frozen=True)
class FrontRun:
    """A run on a Pareto front.

    Arguments:
        method: as in `rows`.
        effort: as in `rows`.
    """

    method: str
    effort: float


@dataclasses.dataclass(frozen=True)
class CostAxis:
    """What is best where one kind of cost counts, against `error_max`.

    Arguments:
        cost: `seconds`, `rhs_evaluations` or `steps`.
        front: the certified runs that no other one beats, from cheap to costly.
        costs_to_reach: what each error costs with each method.
    """

    cost: Cost
    front: tuple[FrontRun, ...]
    costs_to_reach: tuple[CostToReach, ...]


@json_shows(
    *("problem", "norm", "reference=measured_against", "resolution", "energy_resolution"),
    *("run_limit", "rounds", "rows", "costs"),
)
@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class WorkPrecision(Tabular):
    """Errors of methods, and what they cost.

    Arguments:
        problem: what was solved: up to the reference's trust horizon.
        reference: that the errors are measured against.
        norm: in which they are measured.
        resolution: below which an error is unresolved: ten times the reference's estimated bound.
        energy_resolution: the same for errors of the energy; None where there is none.
        run_limit: seconds that a run might take.
        rounds: how often each run was timed.
        rows: the methods in the order asked for, each from cheap to costly efforts.

    Examples:
        >>> from ropeode import Rope, work_precision
        >>> rope = Rope(num_nodes=4).problem(frames=3)
        >>> study = work_precision(rope, ["rk4"], steps_per_frame=[16, 64], rounds=1)
        >>> [(row.effort, f"{row.error_max:.1e}", row.rhs_evaluations) for row in study.rows]
        [(16, '9.0e-07', 192), (64, '3.9e-09', 768)]
    """

    SCHEMA: ClassVar[str] = "ropeode.work-precision/1"

    problem: Problem
    reference: Reference
    norm: Norm
    resolution: float
    energy_resolution: float | None
    run_limit: float
    rounds: int
    rows: tuple[WorkRow, ...]

    @property
    def measured_against(self) -> ReferenceInNorm:
        """What the errors are measured against: the reference, in their norm."""
        return ReferenceInNorm(self.reference, self.norm)

    @property
    def costs(self) -> tuple[CostAxis, ...]:
        """What is best, for each kind of cost."""
        return tuple(
            CostAxis(
                cost,
                tuple(FrontRun(row.method, row.effort) for row in self.front(cost)),
                tuple(each for target in TARGETS for each in self.costs_to_reach(target, cost)),
            )
            for cost in COSTS
        )

    @property
    def methods(self) -> dict[str, str]:
        """The family of each method, in the order asked for."""
        return {row.method: row.family for row in self.rows}

    def front(self, cost: Cost = "seconds", measure: Measure = "error_max") -> tuple[WorkRow, ...]:
        """The certified runs that no other one beats, from cheap to costly.

        A run whose error is unresolved has a smaller one than all that are certified, so that it
        beats those that cost more.

        Arguments:
            cost: `seconds`, `rhs_evaluations` or `steps`.
            measure: `error_final`, `error_max`, `error_rms` or `energy_error`.

        Raises:
            InputError: there is no such cost or measure.

        Examples:
            >>> from ropeode import Rope, work_precision
            >>> rope = Rope(num_nodes=4).problem(frames=3)
            >>> study = work_precision(
            ...     rope, ["explicit-euler", "rk4"], steps_per_frame=[16, 64], rounds=1
            ... )
            >>> [(row.method, row.effort) for row in study.front("rhs_evaluations")]
            [('rk4', 16), ('rk4', 64)]
        """
        check_axes(self, cost, measure)
        unresolved = (_unresolved(row, cost, measure) for row in self.rows)
        beaten = min((paid for paid in unresolved if paid is not None), default=np.inf)
        certified = [
            (row, point)
            for row in self.rows
            if (point := _point(row, cost, measure)) and point[0] < beaten
        ]
        return tuple(certified[i][0] for i in pareto_front([point for _, point in certified]))

    def costs_to_reach(
        self, error: float, cost: Cost = "seconds", measure: Measure = "error_max"
    ) -> tuple[CostToReach, ...]:
        """What an error costs with each method, in their order.

        Between neighbouring certified runs, log(cost) is interpolated; nothing is extrapolated. Of
        a run whose error is unresolved it is known that it suffices for all that is resolved.

        Arguments:
            error: in the unit of the errors.
            cost: as for `front`.
            measure: as for `front`.

        Raises:
            InputError: the error is no positive number, or there is no such cost or measure.

        Examples:
            >>> from ropeode import Rope, work_precision
            >>> rope = Rope(num_nodes=4).problem(frames=3)
            >>> study = work_precision(
            ...     rope, ["velocity-verlet", "rk4"], steps_per_frame=[16, 64], rounds=1
            ... )
            >>> for each in study.costs_to_reach(1e-7, "rhs_evaluations"):
            ...     print(each.method, each.cost and round(each.cost), each.ratio)
            velocity-verlet None None
            rk4 336 1.0
        """
        error = check_positive("error", error, example="1e-6")
        resolution = check_axes(self, cost, measure)
        reached = {
            method: _reached(
                [row for row in self.rows if row.method == method], error, cost, measure, resolution
            )
            for method in self.methods
        }
        known = {method: each.cost for method, each in reached.items() if each}
        best = min(known.values(), default=None)
        found = []
        for method, family in self.methods.items():
            each = reached[method]
            of_family = [value for name, value in known.items() if self.methods[name] == family]
            found.append(
                CostToReach(
                    method=method,
                    family=family,
                    error=error,
                    cost=each.cost if each else None,
                    at_most=bool(each and each.at_most),
                    ratio=each.cost / best if each and best else None,
                    best_of_family=each is not None and each.cost <= min(of_family),
                )
            )
        return tuple(found)


def check_axes(study: WorkPrecision, cost: Cost, measure: Measure) -> float:
    """See that runs can be compared by a cost and a measure.

    Returns:
        Below which the error is unresolved.

    Raises:
        InputError: there is no such cost or measure, or the problem has no energy.
    """
    faults = [
        unknown(name, str(given), allowed)
        for name, given, allowed in (("cost", cost, COSTS), ("measure", measure, MEASURES))
        if given not in allowed
    ]
    if faults:
        raise InputError(faults)
    if measure != "energy_error":
        return study.resolution
    if study.energy_resolution is None:
        raise bad_value(
            "measure",
            measure,
            f"error_final, error_max or error_rms: {study.problem.name!r} has no energy",
            "choose one of these, or build the problem with its energy",
        )
    return study.energy_resolution


def _reached(
    rows: Sequence[WorkRow], error: float, cost: Cost, measure: Measure, resolution: float
) -> Reached | None:
    """What an error costs with a method, whose runs are these."""
    certified = cost_to_reach(error, [_point(row, cost, measure) for row in rows])
    known = [] if certified is None else [certified]
    if resolution <= error:
        unresolved = (_unresolved(row, cost, measure) for row in rows)
        known += [Reached(paid, True) for paid in unresolved if paid is not None]
    return min(known, default=None)


def _point(row: WorkRow, cost: Cost, measure: Measure) -> tuple[float, float] | None:
    """Cost and error of a run, if both are certain."""
    paid, error = getattr(row, cost), getattr(row, measure)
    certain = row.status == "ok" and paid and error and error < INFINITE
    return (float(paid), error) if certain else None


def _unresolved(row: WorkRow, cost: Cost, measure: Measure) -> float | None:
    """The cost of a run whose error is unresolved."""
    paid, error = getattr(row, cost), getattr(row, measure)
    return float(paid) if row.status == "ok" and paid and error is None else None


@shows_progress
@in_float64
def work_precision(
    problem: Problem | Reference,
    methods: Any = None,
    *,
    steps_per_frame: ArrayLike | None = None,
    rtol: ArrayLike | None = None,
    norm: str | None = None,
    run_limit: float = RUN_LIMIT,
    rounds: int = ROUNDS,
    progress: Progress = bar,
    **asked: Unpack[AskedButRtol],
) -> WorkPrecision:
    """Run methods at a ladder of efforts, and say what error each has for what cost.

    A method is a stepper, whose effort is the number of steps per frame, or an adaptive solver,
    whose effort is a relative tolerance; the absolute one is that times the largest component of
    the initial state. The steps of adaptive solvers end on the sample times, so that no error is
    one of interpolation.

    Everything is compiled first. Each method runs once at each effort, and its errors are measured.
    Then all of these run in turns, `rounds` times, for their seconds.

    Arguments:
        problem: what to solve, or a reference of it. Only what is inside its trust horizon is
            solved.
        methods: a list of ``diffrax:NAME`` and ``scipy:NAME`` (adaptive; for constant steps
            ``diffrax:NAME:constant``), of functions ``solve(problem, rtol)`` that return the states
            at ``problem.ts`` and how often they evaluated the right-hand side (or None), and of
            whatever `ropeode.as_stepper` takes. By default those of `DEFAULT_METHODS` that can run
            on the problem.
        steps_per_frame: for methods with constant steps; by default 4, 16, ..., 16384.
        rtol: for adaptive methods; by default 1e-3, 1e-4, ..., 1e-12.
        norm: one of `ropeode.norms.NORMS`; by default the problem's first.
        run_limit: seconds that one run may take. Solvers of diffrax and SciPy are stopped there;
            others are not run where shorter runs show that they would take longer.
        rounds: how often each run is timed.
        progress: called with what is being done and the fraction that is done.
        asked: options of `ropeode.reference`: accuracy, atol, level, digits and time_limit.

    Raises:
        InputError: one line for each argument that cannot be used.
        UserCodeError: a user's step fails at any step size.
        ReferenceRefused: no reference can be had for the problem.

    Examples:
        >>> from ropeode import Rope, work_precision
        >>> rope = Rope(num_nodes=4).problem(frames=3)
        >>> methods = ["velocity-verlet", "scipy:DOP853"]
        >>> study = work_precision(rope, methods, steps_per_frame=[64], rtol=[1e-6], rounds=1)
        >>> for row in study.rows:
        ...     print(row.method, row.family, f"{row.error_max:.0e}", row.rhs_evaluations)
        velocity-verlet symplectic 1e-06 193
        scipy:DOP853 adaptive explicit 1e-04 134
    """
    own = problem_of(problem)
    measured_in = norm_for(own, norm)
    options = ReferenceOptions(**asked)
    chosen = chosen_methods(own, methods, DEFAULT_METHODS)
    ladders = check_ladders(chosen, steps_per_frame, rtol)
    run_limit = check_positive("run_limit", run_limit, example="10")
    rounds = check_whole("rounds", rounds, at_least=1, example="5")
    reference = reference_for(problem, options, lambda text, _: progress(text, 0.0))
    own.require_equations()
    solved = own
    if reference.trusted < len(solved.ts):
        solved = solved.until(reference.trusted)
    progress("compiling the methods", 0.1)
    with threads(cores()) as pool:
        runs = list(pool.map(lambda method: method.ready(solved), chosen))
    measuring = _Measuring(reference, measured_in)
    timed = run_in_turns(
        [(method, run, ladders[method.adaptive]) for method, run in zip(chosen, runs, strict=True)],
        solved,
        measuring.measure,
        run_limit,
        rounds,
        part_of(progress, 0.2, 1.0),
    )
    progress("done", 1.0)
    return WorkPrecision(
        problem=solved,
        reference=reference,
        norm=measured_in,
        resolution=measuring.resolution,
        energy_resolution=measuring.energy_resolution,
        run_limit=run_limit,
        rounds=rounds,
        rows=tuple(_row(each, solved) for each in timed),
    )


def check_ladders(
    methods: Sequence[LadderMethod], steps_per_frame: Any, rtol: Any
) -> dict[bool, tuple[float, ...]]:
    """The efforts of methods with constant steps (False) and of adaptive ones (True), cheap first.

    Raises:
        InputError: one line for each ladder that is none, or that no method has a use for.
    """
    kinds = {method.adaptive for method in methods}

    def steps() -> tuple[float, ...]:
        if steps_per_frame is None:
            return DEFAULT_STEPS
        if False not in kinds:
            fix = (
                "leave it out, or add one of constant steps, such as rk4 or diffrax:Tsit5:constant"
            )
            allowed = "none where all methods are adaptive"
            raise bad_value("steps_per_frame", steps_per_frame, allowed, fix)
        return tuple(sorted(check_steps(steps_per_frame)))

    def tolerances() -> tuple[float, ...]:
        if rtol is None:
            return DEFAULT_RTOL
        if True not in kinds:
            fix = "leave it out, or add an adaptive one, such as diffrax:Tsit5"
            raise bad_value("rtol", rtol, "none where all methods have constant steps", fix)
        return _tolerances(rtol)

    return dict(zip((False, True), check_all(steps, tolerances), strict=True))


def _tolerances(given: Any) -> tuple[float, ...]:
    allowed = f"different numbers from {_TIGHTEST:g} to {_LOOSEST:g}"
    fix = "for example 1e-3, 1e-6, 1e-9"
    try:
        numbers = [positive_number(each) for each in given]
    except (TypeError, ValueError) as error:
        raise bad_value("rtol", given, f"{allowed} ({error})", fix) from None
    in_range = all(_TIGHTEST <= each <= _LOOSEST for each in numbers)
    if not numbers or not in_range or len(set(numbers)) < len(numbers):
        raise bad_value("rtol", given, allowed, fix)
    return tuple(sorted(numbers, reverse=True))


class _Measuring:
    """The errors of runs against a reference."""

    def __init__(self, reference: Reference, norm: Norm):
        problem, trusted = reference.problem, reference.trusted
        self._reference, self._norm, self._energies = reference, norm, None
        self.resolution = float(RESOLUTION_FACTOR * reference.bound(norm)[-1])
        self._motion = moved(reference, norm)
        self.energy_resolution = None
        if problem.energy is not None:
            self._energies = energies_of(problem, reference, reference.states[:trusted], ())
            self.energy_resolution = float(np.max(self._energies.resolution[:trusted]))

    def measure(self, attempt: Attempt) -> tuple[Attempt, Errors]:
        """The errors of a run, by the names of `MEASURES`; one that is far off is `unstable`."""
        if attempt.status != "ok":
            return attempt, dict.fromkeys(MEASURES)
        series = error_series(attempt.states, self._reference, self._norm.name)
        energy = self._energy_error(attempt.states)
        sizes = series.final, series.max, series.rms, energy
        found: Errors = dict(zip(MEASURES, sizes, strict=True))
        if series.max is not None and series.max > UNSTABLE_FROM * self._motion:
            why = "its error is larger than twice the motion"
            attempt = dataclasses.replace(attempt, status="unstable", why=why)
        return attempt, found

    def _energy_error(self, states: np.ndarray) -> float | None:
        if self._energies is None or self.energy_resolution is None:
            return None
        truth = self._energies.values[: len(states)]
        error = np.max(np.abs(energy_errors(self._reference.problem.energies(states), truth)))
        if not np.isfinite(error):
            return INFINITE
        return float(error) if error >= self.energy_resolution else None


def _row(timed: Timed, problem: Problem) -> WorkRow:
    method, attempt, largest = timed.method, timed.attempt, timed.errors["error_max"]
    adaptive = method.adaptive
    seconds = timed.seconds
    if not seconds and attempt.status in ("unstable", "diverged", "unsolved"):
        seconds = [attempt.seconds]
    over = None
    if adaptive and largest is not None:
        over = largest / (timed.effort * problem.scale)
    return WorkRow(
        method=method.label,
        family=method.family,
        effort=timed.effort,
        dt=None if adaptive else step_size(problem, int(timed.effort)),
        rtol=timed.effort if adaptive else None,
        **timed.errors,
        error_over_tolerance=over,
        resolved=largest is not None,
        status=attempt.status,
        why=attempt.why,
        rhs_evaluations=attempt.rhs_evaluations,
        jacobian_evaluations=attempt.jacobian_evaluations,
        steps=attempt.steps,
        seconds=float(np.median(seconds)) if seconds else None,
        seconds_min=min(seconds, default=None),
        seconds_max=max(seconds, default=None),
    )
