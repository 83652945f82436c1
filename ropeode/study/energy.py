"""The energy of runs against time, and what it should be."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Unpack

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike

from ropeode.analysis import RESOLUTION_FACTOR, energy_errors
from ropeode.display import Tabular
from ropeode.precision import in_float64
from ropeode.problems import Problem, compiled
from ropeode.progress import Progress, bar, shows_progress
from ropeode.references import Asked, Reference, ReferenceOptions, problem_of, reference_for
from ropeode.steppers import Stepper
from ropeode.study.accuracy_table import check_steps, chosen_steppers
from ropeode.study.curves import Curve, curve_of, runs_of
from ropeode.validation import bad_value

# One step size, with which all steppers share a panel.
_STEPS_PER_FRAME = (64,)
# An energy is conserved if it cannot change by more than this part of its terms over the span.
_CONSERVED = 1e-9
# The slope of the energy is looked at for each state at so many times, and so often in all if the
# states have no more numbers than that together.
_TIMES, _LOOKS, _NUMBERS = 4, 4096, 2_000_000


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class EnergyCurves(Tabular):
    """Energies against time, and the true energy as far as it is known.

    Where the equation conserves the energy, the true one is that of the initial state, at all
    sample times. Otherwise it is the reference's, inside its trust horizon.

    Arguments:
        problem: the problem of the runs.
        reference: with its certificate; None where none was needed.
        conserved: whether the equation conserves the energy.
        times: the sample times at which the true energy is known, ``(times,)``.
        values: the true energy there, ``(times,)``.
        bound: the estimated error of `values`, ``(times,)``.
        curves: the energy of each run at all of its samples, in the order of the steppers.
    """

    problem: Problem
    reference: Reference | None
    conserved: bool
    times: np.ndarray
    values: np.ndarray
    bound: np.ndarray
    curves: tuple[Curve, ...]

    @property
    def resolution(self) -> np.ndarray:
        """Ten times `bound`; no digit of an energy error below it is to be believed."""
        return RESOLUTION_FACTOR * self.bound

    def errors(self, curve: Curve) -> np.ndarray:
        """The energy of one of `curves` minus the true one, at those of `times` that it has."""
        return energy_errors(curve.values, self.values)


@shows_progress
def energy_curves(
    problem: Problem | Reference,
    steppers: Sequence[str | Stepper] | None = None,
    steps_per_frame: ArrayLike = _STEPS_PER_FRAME,
    *,
    progress: Progress = bar,
    **asked: Unpack[Asked],
) -> EnergyCurves:
    """Run steppers and compute their energy at each sample, and the true one.

    A reference is computed only where the equation does not conserve the energy.

    Arguments:
        problem: the problem to solve, which must have an energy; or a reference of it.
        steppers: as for `ropeode.accuracy_table`.
        steps_per_frame: whole numbers, each once.
        progress: called with what is being done and the fraction that is done.
        asked: options of `ropeode.reference`: accuracy, rtol, level, digits and time_limit.

    Raises:
        InputError: one line for each argument that cannot be used.
        ReferenceRefused: the energy is not conserved, and no reference can be certified.

    Examples:
        >>> from ropeode import Rope, energy_curves
        >>> energy_curves(Rope(num_nodes=4).problem(frames=3), ["rk4"], [16])
        <EnergyCurves: rope, 4 nodes, damping 0.01, 3 frames; energies of 1 run (rk4)>
    """
    own = problem_of(problem)
    check_energy(own)
    options = ReferenceOptions(**asked)
    chosen, ladder = chosen_steppers(own, steppers), check_steps(steps_per_frame)

    def running(text: str, part: float | None) -> None:
        progress(text, None if part is None else 0.9 * part)

    drawn: list[Curve] = []
    # The states of the run that keeps its energy best, which is most like the solution.
    best, least = None, np.inf
    for run in runs_of(own, chosen, ladder, running):
        energies = own.energies(run.states)
        drawn.append(curve_of(run, run.times, energies))
        change = float(np.max(np.abs(energies - energies[0]))) if run.status == "ok" else np.inf
        if change < least:
            best, least = run.states, change
    known = problem if isinstance(problem, Reference) else None
    along = known.states[: known.trusted] if known else best
    slopes = None if along is None else _slopes(own, along)
    if known is None and (slopes is None or not _conserved(own, slopes)):
        known = reference_for(own, options, lambda text, _: progress(text, 0.9))
        along = known.states[: known.trusted]
        slopes = _slopes(own, along)
    assert along is not None
    assert slopes is not None
    found = energies_of(own, known, along, drawn, slopes)
    progress("done", 1.0)
    return found


def energies_of(
    problem: Problem,
    reference: Reference | None,
    along: np.ndarray,
    curves: Sequence[Curve],
    slopes: _Slopes | None = None,
) -> EnergyCurves:
    """Energies of runs with the true ones.

    Arguments:
        problem: of the runs.
        reference: of the problem; may be None where its equation conserves the energy.
        along: states of the reference inside its trust horizon, or else of a good run,
            ``(times, *state)``.
        curves: of energies.
        slopes: how the energy changes at these states, where that is known already.
    """
    if slopes is None:
        slopes = _slopes(problem, along)
    start = problem.energies(problem.y0[None])
    rounding = np.maximum.accumulate(np.finfo(np.float64).eps * slopes.size[: len(along)])
    conserved, known = _conserved(problem, slopes), None
    if reference is not None:
        times, values = problem.ts[: reference.trusted], problem.energies(along)
        # What an error of each quantity, as large as its bound at every node, can change.
        gradient = slopes.gradient[: len(along)]
        sizes = [
            np.sum(np.linalg.norm(problem.quantity(name, gradient), axis=2), axis=1)
            * reference.certificate.bounds[name][: len(times)]
            for name in problem.quantities
        ]
        known = times, values, np.maximum.accumulate(np.sum(sizes, axis=0)) + rounding
        # What acts too briefly to be met by a look may still show in the solution.
        change = energy_errors(values, np.repeat(start, len(values)))
        conserved &= bool(np.all(np.abs(change) <= known[2] + rounding[0]))
    if conserved:
        times, values = problem.ts, np.repeat(start, len(problem.ts))
        drift = np.max(np.abs(slopes.rate)) * (times - times[0])
        longer = np.append(rounding, np.repeat(rounding[-1], len(times) - len(rounding)))
        known = times, values, drift + longer
    assert known is not None
    times, values, bound = known
    return EnergyCurves(problem, reference, conserved, times, values, bound, tuple(curves))


def check_energy(problem: Problem) -> None:
    """Refuse a problem without an energy.

    Raises:
        InputError: it has none.
    """
    if problem.energy is None:
        fix = "give it one, Problem(..., energy=...), or choose what needs none"
        raise bad_value("problem", problem.name, "a problem that has an energy", fix)


def _conserved(problem: Problem, slopes: _Slopes) -> bool:
    """Whether ``dE/dt`` along the equation is zero, but for rounding, wherever it is looked at."""
    span = float(problem.ts[-1] - problem.ts[0])
    kept = span * np.abs(slopes.rate) <= _CONSERVED * slopes.size
    return not len(problem.jump_times) and bool(np.all(kept))


class _Slopes(NamedTuple):
    """How the energy changes, at some states.

    Fields:
        gradient: with the state, ``(times, *state)``.
        rate: with time, along the equation, ``(times,)``.
        size: of the terms of the energy, ``(times,)``.
    """

    gradient: np.ndarray
    rate: np.ndarray
    size: np.ndarray


@in_float64
def _slopes(problem: Problem, states: np.ndarray) -> _Slopes:
    """At the first sample times, for which the states are, and then at other times of the span.

    Arguments:
        problem: with an energy.
        states: ``(times, *state)``.
    """
    assert problem.energy is not None
    count, looks = len(states), _TIMES * len(states)
    if not problem.in_python:
        looks = max(looks, min(_LOOKS, _NUMBERS // max(1, states[0].size)))
    others = np.random.default_rng(0).uniform(problem.ts[0], problem.ts[-1], looks - count)
    times, which = np.append(problem.ts[:count], others), np.arange(looks) % count
    found = compiled(_slopes_along, problem.energy, problem.rhs)(times, states[which], problem.args)
    return _Slopes(*map(np.asarray, found))


def _slopes_along(energy: Callable, rhs: Callable) -> Callable:
    """The fields of `_Slopes`, for many times and states at once."""

    def one(t: Any, y: Any, args: Any) -> Any:
        value, (by_time, gradient) = jax.value_and_grad(energy, argnums=(0, 1))(t, y, args)
        rate = by_time + jnp.sum(gradient * rhs(t, y, args))
        return gradient, rate, jnp.abs(value) + jnp.sum(jnp.abs(gradient * y))

    return jax.vmap(one, in_axes=(0, 0, None))
