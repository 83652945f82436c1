"""A stepper explained: what one step does, and what follows for its errors."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from typing import Any, ClassVar, Unpack

import numpy as np
from numpy.typing import ArrayLike

from ropeode.display import Tabular
from ropeode.json_form import json_shows
from ropeode.norms import norm_for
from ropeode.precision import in_float64
from ropeode.problems import PROBLEMS, Problem, free_coordinates
from ropeode.progress import Progress, bar, shows_progress
from ropeode.references import (
    Asked,
    Reference,
    ReferenceOptions,
    largest_norms,
    problem_of,
    reference_for,
)
from ropeode.simulation import Method, Trajectory, method_of, simulate
from ropeode.steppers import BuiltIn, ProblemClass, Stepper, as_stepper, registered_stepper
from ropeode.study.accuracy_table import (
    DEFAULT_STEPS_PER_FRAME,
    AccuracyTable,
    check_steps,
    problem_class,
    tables_in_norms,
)
from ropeode.study.curves import ErrorCurves, error_curve, errors_of
from ropeode.study.error_constant import ErrorConstant
from ropeode.theory import (
    Diagnosis,
    Expansion,
    LinearStability,
    ModifiedEnergy,
    Property,
    StabilityFunction,
    StabilityRegion,
    StepDifference,
    StepSamples,
    StepTableau,
    Term,
    describe,
    diagnose_equation,
    diagnose_identity,
    diagnose_parameters,
    equal_steppers,
    expanded,
    is_rope,
    linear_stability_of,
    modified_energy_of,
    order_once_started,
    stability_region,
    step_difference,
    structure_of,
    tableau_of,
)

# Of a step that runs in Python, which takes some 30 us each time.
_MOST_IN_PYTHON = 1024
# States at which a step is expanded.
_STATES = 8
# Steps per frame of a run that such states are taken from, and how closely it must keep
# constraints, as a part of the state's size.
_STEPS, _KEPT = 256, 1e-12
# How far, as a part of its size, a state is moved where it may be a special one, and how many are
# made of each.
_AWAY, _NEAR = 0.1, 2
# Near this number of steps per frame the energy is looked at.
_SHOWN = 64
# How closely a term is a multiple of the state.
_PROPORTIONAL = 1e-4
# Of the runs whose errors are shown against time, one is finer than the other by so many rows.
_BETWEEN = 4
# Where a problem has none, to see what damping does.
_DAMPING = 0.1


@dataclasses.dataclass(frozen=True)
class Part:
    """A term of the expansion of a step, in one quantity.

    Arguments:
        largest: the largest component at any of the states, in the units of the problem.
        error: its estimated error.
        known: whether the term is certainly not zero at some state.
        time: of the state where it is largest.
        index: of the component there; for a mechanical problem that of the node.
        factor: where the term is this multiple of the quantity itself; else None.
    """

    largest: float
    error: float
    known: bool
    time: float
    index: int
    factor: float | None


@dataclasses.dataclass(frozen=True)
class LocalQuantity:
    """What one step does to one quantity, as dt goes to 0.

    Arguments:
        quantity: position, velocity or state.
        order: at which its error begins; -1: the step is not the identity at dt = 0; 0: another
            equation is solved. None where rounding hides it.
        at_least: up to this order, it is certain that there is no error.
        identity: what a step of dt = 0 changes.
        rate: by how much the rate of change differs from the right-hand side.
        local_error: the coefficient of ``dt**(order + 1)`` in the error of a step, at the order
            of the whole step; None where that is not known, or below 1.
    """

    quantity: str
    order: int | None
    at_least: int
    identity: Part
    rate: Part
    local_error: Part | None


@dataclasses.dataclass(frozen=True)
class LocalStep:
    """What one step does at states along the solution.

    Arguments:
        order: the lowest of the quantities' orders; None where rounding hides it.
        at_least: as in `LocalQuantity`.
        one_step: whether a step depends on nothing but state, time and step size.
        quantities: one for each.
        times: of the states.
        longest: step of the expansion, as the smallest and largest of these states.
        later: the order, at least, of the steps by themselves, where the start is of a lower one;
            else None.
        wrong: what it is at dt = 0, where it is not the identity; or which equation it solves
            in place of the problem's; None where it is right, or where nobody can say.
    """

    order: int | None
    at_least: int
    one_step: bool
    quantities: tuple[LocalQuantity, ...]
    times: tuple[float, ...]
    longest: tuple[float, float]
    later: int | None
    wrong: Diagnosis | None


@json_shows(
    *("of_class.damped", "of_class.at_rest", "of_class.rigid"),
    *("own", "local", "at_least", "declared"),
)
@dataclasses.dataclass(frozen=True)
class ClassOrder:
    """The order on a class of problems.

    Arguments:
        of_class: whether problems are damped, start at rest, and are rigid.
        own: whether the explained problem is one of them.
        local: read off single steps; None where rounding hides it.
        at_least: as in `LocalQuantity`.
        declared: by the stepper; None where it declares nothing.
    """

    of_class: ProblemClass
    own: bool
    local: int | None
    at_least: int
    declared: int | None


@json_shows(
    *("stepper", "problem", "local", "orders", "tables", "stability", "structure"),
    *("modified_energy=modified", "method", "equal_to=equal", "compared_with=compared"),
)
@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Explanation(Tabular):
    """What one step of a stepper does, and what follows from it, beside what its runs show.

    Arguments:
        stepper: its name with options.
        problem: that it is explained on.
        reference: that its runs are compared with.
        local: its expansion at single states.
        orders: local and declared, the problem's own class first.
        tables: errors, observed orders and error constants, one for each norm.
        against_time: errors of a run or two, with the predicted ones, for each norm.
        tableau: its Runge-Kutta or Nystrom coefficients, or why it has none.
        stability: how long its steps may be, predicted and measured.
        region: where on the complex plane a mode does not grow; None where there is no such plane.
        structure: which properties of the exact solution a step has, by name; or why there is
            nothing to say.
        modified: the energy that a symplectic step keeps, with its leading correction, along a
            run; or why there is none; None where the step is not symplectic, or keeps the energy.
        equal: steppers of ropeode that make the same steps.
        compared: the difference from the method that was named, if one was.

    Examples:
        >>> from ropeode import Rope, explain_stepper
        >>> explain_stepper("explicit-euler", Rope(num_nodes=4).problem(frames=3))
        <Explanation: explicit-euler: rope, 4 nodes, damping 0.01, 3 frames; local order 1,
        observed 1.0...>
    """

    SCHEMA: ClassVar[str] = "ropeode.explain/2"

    stepper: str
    problem: Problem
    reference: Reference
    local: LocalStep
    orders: tuple[ClassOrder, ...]
    tables: tuple[AccuracyTable, ...]
    against_time: tuple[ErrorCurves, ...]
    tableau: StepTableau
    stability: LinearStability
    region: StabilityRegion | None
    structure: dict[str, Property] | str
    modified: ModifiedEnergy | str | None
    equal: tuple[StepDifference, ...]
    compared: StepDifference | None

    @property
    def method(self) -> str:
        """What the step is by its coefficients, in a sentence."""
        found, reason = self.tableau
        if found is None:
            return f"Its step shows no Runge-Kutta or Nystrom coefficients: it {reason}."
        words = describe(found)
        return f"By the coefficients that its step shows, {words[0].lower()}{words[1:]}"


@shows_progress
@in_float64
def explain_stepper(
    step: Any,
    problem: Problem | Reference,
    *,
    method: str | None = None,
    steps_per_frame: ArrayLike | None = None,
    norm: str | None = None,
    progress: Progress = bar,
    **asked: Unpack[Asked],
) -> Explanation:
    """Explain a stepper: what one step does, and what follows for its errors.

    Single steps from states of a reference are expanded in dt. That tells what the step is at
    dt = 0, which equation it solves, its order and local error, and from these the leading term
    of its error along the solution, which is then set beside the errors of runs.

    Arguments:
        step: whatever `ropeode.as_stepper` takes.
        problem: on which it is explained, or a reference of it.
        method: the stepper of ropeode that it is meant to be, by name with options.
        steps_per_frame: of the runs, whole numbers, each once; by default 16, 32, ..., 16384, up to
            1024 for a step that runs in Python.
        norm: one of `ropeode.norms.NORMS`; by default the largest error of each quantity.
        progress: called with what is being done and the fraction that is done.
        asked: options of `ropeode.reference`: accuracy, rtol, level, digits and time_limit.

    Raises:
        InputError: one line for each argument that cannot be used.
        UserCodeError: the step raised, or returned what is no state.
        ReferenceRefused: no reference of the problem can be certified.

    Examples:
        >>> from ropeode import Rope, explain_stepper
        >>> explained = explain_stepper("explicit-euler", Rope(num_nodes=4).problem(frames=3))
        >>> explained.local.order, round(explained.tables[0].orders[0].order.observed, 1)
        (1, 1.0)
    """
    own, options = problem_of(problem), ReferenceOptions(**asked)
    norms = tuple(largest_norms(own).values()) if norm is None else (norm_for(own, norm),)
    stepper = as_stepper(step)
    stepper.require(own)
    known = None if method is None else registered_stepper(method)
    if known is not None:
        known.require(own)
    ladder = None if steps_per_frame is None else check_steps(steps_per_frame)
    ready = method_of(stepper, own)
    ready.trial.require_finite()
    if ladder is None:
        most = np.inf if ready.trial.compiled else _MOST_IN_PYTHON
        ladder = check_steps([each for each in DEFAULT_STEPS_PER_FRAME if each <= most])
    reference = reference_for(problem, options, lambda text, _: progress(text, 0.0))

    progress("expanding a step", 0.2)
    samples, label = StepSamples(own, ready), ready.stepper.label
    at = _expansion(samples, *_states(reference, ready))
    local = _from_its_start(at, samples, ready, problem_class(own))
    # What moves nodes in a step of dt = 0 may do so to keep lengths.
    lengths = own.rigid or bool(np.any(_combined(at, -1).known[0]))
    tableau = tableau_of(stepper, own)

    def has_its_order(other: Stepper) -> bool:
        declared = other.order(problem_class(own))
        if local.order is None:
            return declared is None or declared > local.seen
        return declared == local.order

    explicit = tableau.tableau is not None and tableau.tableau.explicit
    # A stepper of ropeode says which it is, also where its step shows no tableau.
    explicit |= isinstance(stepper, BuiltIn) and stepper.family != "implicit"
    implicit = not (stepper.moves_links or explicit)
    equal = list(
        equal_steppers(samples, at, lengths=lengths, implicit=implicit, order=has_its_order)
    )
    compared = None if known is None else step_difference(samples, known, at)
    orders = tuple(_class_orders(ready, own, at, local))
    progress("stability and structure", 0.3)
    stability, properties = linear_stability_of(reference, ready), structure_of(own, ready)
    modified = _modified_energy(own, ready, properties, ladder)
    tables = tables_in_norms(
        reference,
        [stepper],
        ladder,
        norms,
        True,
        options,
        lambda text, done: progress(text, None if done is None else 0.4 + 0.6 * done),
    )
    return Explanation(
        stepper=label,
        problem=own,
        reference=reference,
        local=_local_step(local, _wrong(samples, local)),
        orders=orders,
        tables=tables,
        against_time=tuple(_against_time(ready, tables)),
        tableau=tableau,
        stability=stability,
        region=_region(stability),
        structure=properties,
        modified=modified,
        equal=tuple(each for each in equal if each.name != label),
        compared=compared,
    )


def _modified_energy(
    problem: Problem, ready: Method, found: dict[str, Property] | str, ladder: Sequence[int]
) -> ModifiedEnergy | str | None:
    if isinstance(found, str) or not found["symplectic"].holds or found["energy"].holds:
        return None
    return modified_energy_of(problem, ready, min(ladder, key=lambda n: abs(np.log2(n / _SHOWN))))


def _region(stability: LinearStability) -> StabilityRegion | None:
    if stability.limits is None or not isinstance(stability.function, StabilityFunction):
        return None
    return stability_region(stability.function, stability.limits)


def _states(reference: Reference, ready: Method) -> tuple[np.ndarray, np.ndarray]:
    """Some times at which a reference is trusted, and states there."""
    problem, states = reference.problem, reference.states[: reference.trusted]
    if problem.rigid:
        # A reference drifts from constraints by more than rounding, and steps that keep them would
        # show that. The stepper's own run may keep them as its steps do; its start always does.
        run = simulate(problem, ready, _STEPS).states[: reference.trusted]
        drift = np.max(list(problem.drift(run).values()), axis=0)
        kept = np.cumprod(drift <= _KEPT * problem.scale).astype(bool)
        states = run[: max(1, np.sum(kept))]
    some = np.unique(np.linspace(0, len(states) - 1, _STATES).astype(int))
    return reference.times[some], states[some]


def _expansion(samples: StepSamples, t: np.ndarray, y: np.ndarray) -> Expansion:
    return expanded(samples, t, y, float(np.max(np.diff(samples.problem.ts))))


def _wrong(samples: StepSamples, at: Expansion) -> Diagnosis | None:
    """What is wrong at dt = 0, in terms of the problem, from states where it has no symmetry."""
    if at.order not in (-1, 0):
        return None
    problem, near = samples.problem, at
    rope, own = is_rope(problem), at.samples
    if rope:
        samples, own = samples.with_nodes_first(), own.with_nodes_first()
    if not problem.rigid:
        near = _expansion(samples, *_states_near(samples, at))
        if near.order != at.order:
            near = _expansion(own, at.t, own.turned(at.y))
    if rope:
        return diagnose_identity([near]) if at.order == -1 else diagnose_equation([near])
    return None if at.order == -1 else diagnose_parameters(near)


def _states_near(samples: StepSamples, at: Expansion) -> tuple[np.ndarray, np.ndarray]:
    """States so near to given ones that nothing else is, with times."""
    problem = samples.problem
    t, y = np.tile(at.t, _NEAR), np.concatenate([at.y] * _NEAR)
    draw = np.random.default_rng(7).normal(size=y.shape)
    if problem.mechanics is None:
        return t, y * (1.0 + _AWAY * draw)
    size = float(np.max(np.abs(at.y[:, 0])))
    if is_rope(problem):
        size = float(np.min(problem.args.rest_length, initial=size))
    # As fast as the acceleration makes it on such a way.
    speed = np.sqrt(size * np.max(np.abs(at.slopes[:, 1])))
    away = _AWAY * np.array([size, speed]).reshape(2, *[1] * (y.ndim - 2)) * draw
    return t, samples.turned(y + np.where(free_coordinates(problem), away, 0.0))


def _local_step(at: Expansion, wrong: Diagnosis | None) -> LocalStep:
    order = at.order
    identity, rate = _combined(at, -1), _combined(at, 0)
    local = None if order is None or order < 1 else at.rate(order)
    return LocalStep(
        order=order,
        at_least=at.seen + 1,
        one_step=at.one_step,
        quantities=tuple(
            LocalQuantity(
                quantity=quantity,
                order=None if np.all(np.isnan(at.orders[i])) else int(np.nanmin(at.orders[i])),
                at_least=at.seen + 1,
                identity=_part(at, identity, i),
                rate=_part(at, rate, i),
                local_error=None if local is None else _part(at, local, i),
            )
            for i, quantity in enumerate(at.problem.quantities)
        ),
        times=tuple(at.t.tolist()),
        longest=(float(np.nanmin(at.reach)), float(np.nanmax(at.reach))),
        later=order_once_started(at),
        wrong=wrong,
    )


def _combined(at: Expansion, order: int) -> Term:
    """The term that grows with the steps; where that is not known, the one of the start."""
    grows, start = at.rate(order), at.start(order)
    return start if np.any(start.known) and not np.any(grows.known) else grows


def _part(at: Expansion, term: Term, quantity: int) -> Part:
    problem, name = at.problem, at.problem.quantities[quantity]
    values = np.nan_to_num(problem.quantity(name, term.value))
    sizes = np.max(np.abs(values), axis=2)
    state, index = np.unravel_index(np.argmax(sizes), sizes.shape)
    return Part(
        largest=float(sizes[state, index]),
        error=float(np.nanmax(term.error[quantity])),
        known=bool(np.any(term.known[quantity])),
        time=float(at.t[state]),
        index=int(index),
        factor=_factor(values, problem.quantity(name, at.y)),
    )


def _factor(values: np.ndarray, states: np.ndarray) -> float | None:
    """The factor, where values are a multiple of states."""
    factor = float(np.sum(values * states) / (np.sum(states**2) or 1.0))
    rest = np.max(np.abs(values - factor * states))
    return factor if rest <= _PROPORTIONAL * np.max(np.abs(values)) else None


def _started(at: Expansion, samples: StepSamples, of_class: ProblemClass) -> Expansion:
    """The expansion for problems that start at rest, where a step has memory of its start."""
    if at.one_step or not of_class.at_rest:
        return at
    still = at.y.copy()
    still[:, 1] = 0.0
    return _expansion(samples, at.t, still)


def _from_its_start(
    at: Expansion, samples: StepSamples, ready: Method, of_class: ProblemClass
) -> Expansion:
    """The expansion for the problem's own class."""
    local, problem = _started(at, samples, of_class), samples.problem
    if local is not at and not problem.rigid:
        # A step that does something else at dt = 0 may do it to what moves alone.
        settled = _expansion(StepSamples(problem, ready, settled=True), at.t, at.y)
        if settled.order is not None and settled.order < 1:
            return settled
    return local


def _class_orders(
    ready: Method, problem: Problem, at: Expansion, local: Expansion
) -> Iterator[ClassOrder]:
    """The order on the problem's own class, and on others that differ in damping and start."""

    def order(of_class: ProblemClass, at: Expansion) -> ClassOrder:
        declared = ready.stepper.order(of_class)
        return ClassOrder(of_class, of_class == own, at.order, at.seen + 1, declared)

    own = problem_class(problem)
    yield order(own, local)
    if problem.mechanics is None or len(at.t) == 1:
        return
    moving = own._replace(at_rest=not own.at_rest)
    yield order(moving, _started(at, StepSamples(problem, ready), moving))
    other = _with_other_damping(problem, own)
    if other is None or ready.stepper.refusal(other) is not None:
        return
    samples = StepSamples(other, ready)
    at = _expansion(samples, at.t, at.y)
    for of_class in (own, moving):
        of_class = of_class._replace(damped=not own.damped)
        yield order(of_class, _started(at, samples, of_class))


def _with_other_damping(problem: Problem, own: ProblemClass) -> Problem | None:
    """The same problem without damping, or with some where it has none; None if nobody can say."""
    parameters = dict(problem.parameters)
    kind = parameters.pop("kind", None)
    if kind not in PROBLEMS or "damping" not in parameters:
        return None
    return PROBLEMS[kind](**{**parameters, "damping": 0.0 if own.damped else _DAMPING})


def _against_time(ready: Method, tables: Sequence[AccuracyTable]) -> Iterator[ErrorCurves]:
    """The errors of two runs: the finest that the constant is measured at, and a coarser one."""
    runs: dict[int, Trajectory] = {}
    for table in tables:
        constant, curves = table.orders[0].constant, []
        assert constant is not None
        for steps in _shown_steps(table, constant):
            if steps not in runs:
                runs[steps] = simulate(table.problem, ready, steps)
            leading = constant.predicted_at, constant.order
            curves.append(error_curve(runs[steps], table.reference, table.norm, *leading))
        yield errors_of(table.reference, table.norm, curves)


def _shown_steps(table: AccuracyTable, constant: ErrorConstant) -> list[int]:
    shown = [row for row in table.rows if row.dt in constant.measured_at]
    shown = shown or [row for row in table.rows if row.status == "ok"]
    shown.sort(key=lambda row: row.dt)
    return [row.steps_per_frame for row in shown[: _BETWEEN + 1 : _BETWEEN]]
