"""The leading term of the global error, from the local one along a reference."""

from __future__ import annotations

import dataclasses

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import make_interp_spline

from ropeode.precision import in_float64
from ropeode.problems import Problem
from ropeode.progress import Progress, silent
from ropeode.references import Reference
from ropeode.simulation import Method
from ropeode.theory.expansion import EXPANSION_STEPS, SETTLED, Expansion, expanded
from ropeode.theory.solution_along import Pieces, solution_along
from ropeode.theory.spectrum import derivative_of_rhs
from ropeode.theory.step_samples import StepSamples

# Local errors are taken from so many rungs of the ladder, and from more until what is open of them
# is a small part of the largest. They are interpolated by splines of a degree.
_RUNGS, _OPEN, _DEGREE = (9, 13, 17), 1e-3, 5
# How many states the order is read off at.
_STATES = 8
# A prediction that is more uncertain is none: where half of the states say so little of the others,
# all of them may miss what matters, as in the fast parts of a stiff solution.
_MOST_UNCERTAIN = 0.05
# So many more steps are left to the start of a method with memory. Where what is carried settles
# slowly, what is left is up to so many times the change that they make: 5.1 times at most, of all
# steppers on all problems of the library.
_LATER, _LEFT = 2, 5.0
# What may be left of a rate that is explained.
_EXPLAINED = 1e-2
# A root of the method at -1 swings the error from step to step, and the prediction leaves that out.
# There is none where it is more than this part of the error.
_SWINGS = 1e-3
# The relative tolerance of the variational equation.
_RTOL = 1e-7


@dataclasses.dataclass(frozen=True, eq=False)
class PredictedError:
    """What a stepper's error is to leading order in dt: ``dt**order * states``.

    Arguments:
        order: at which the error begins, 1 or higher.
        times: the samples that the reference is trusted for, ``(times,)``.
        states: the coefficient of ``dt**order`` at each, signed: ``(times, *state)``.
        uncertain: by how much it may be wrong, as a part of its largest component.
    """

    order: int
    times: np.ndarray
    states: np.ndarray
    uncertain: float


@in_float64
def predicted_error(
    reference: Reference, method: Method, progress: Progress = silent
) -> PredictedError | str:
    """The leading term of the global error of a stepper on the problem of a reference.

    With the local error ``dt**(p + 1) d(t, y)``, the error is ``dt**p e(t)`` and higher terms,
    where ``e' = f_y(t, y) e + d(t, y)`` along the solution y, and ``dt**p e(t0)`` is the error
    with which the stepper starts (Hairer, Norsett, Wanner, Solving Ordinary Differential Equations
    I, theorem II.8.1; Henrici, Discrete Variable Methods in Ordinary Differential Equations,
    section 3.3).

    Arguments:
        reference: that the solution is taken from, as far as it is trusted.
        method: the stepper, ready to run on the reference's problem.
        progress: called with what is being done and the fraction that is done.

    Returns:
        The prediction, or why there is none.

    Raises:
        UserCodeError: the step raised.
    """
    problem = reference.problem
    times, states = problem.ts[: reference.trusted], reference.states[: reference.trusted]
    if problem.jump_times:
        return "the right-hand side jumps"
    if not problem.equal_frames:
        return "the frames differ in length, and so do the steps"
    if len(times) < 2:
        return "the reference is trusted for no frame"
    progress("expanding a step", 0.0)
    samples, longest = StepSamples(problem, method), float(np.max(np.diff(times)))
    some = np.unique(np.linspace(0, len(times) - 2, _STATES).astype(int))
    local = begin = expanded(samples, times[some], states[some], longest)
    if local.order is not None and local.order < 1 and not local.one_step:
        # A start that is wrong at other states may be right at the first one.
        begin = expanded(samples, times[:1], states[:1], longest)
        samples = StepSamples(problem, method, settled=True)
        local = expanded(samples, times[some], states[some], longest)
    if begin is not local and local.order is not None and local.order < 1:
        return (
            "started from other states than the first, it solves another equation, or what is "
            "carried is still settling"
        )
    lacking = _lacks_order("the step", local) or _lacks_order("the start", begin)
    if lacking:
        return lacking
    order = min(each.order for each in (local, begin) if each.order is not None)
    progress("following the solution", 0.2)
    along = solution_along(reference)
    if isinstance(along, str):
        return along
    pieces, index = along
    t, y = (np.concatenate([getattr(each, of) for each in pieces])[index] for of in ("t", "y"))
    zeros = order + 1 if samples.carries_state else order
    later = SETTLED if local.one_step else SETTLED + _LATER
    one_step = local.one_step and not samples.may_begin
    rates: dict[int, list[np.ndarray]] = {SETTLED: [], later: []}
    for done, each in enumerate(pieces):
        progress("the local error", 0.6 + 0.4 * done / len(pieces))
        for settled, found in rates.items():
            found.append(_local_error(samples, each, order, zeros, settled, one_step))
    start = begin.start(order).value[0]

    def propagated(settled: int, stride: int = 1, ladder: int = -1) -> np.ndarray:
        progress("the error's equation", 1.0)
        rate = np.concatenate(rates[settled], axis=1)[ladder]
        each = (values[::stride] for values in (t, y, rate[index]))
        return _propagated(problem, times, start, *each)

    fine = propagated(SETTLED)
    size = float(np.max(np.abs(fine))) or 1.0

    def changed(other: np.ndarray) -> float:
        return float(np.max(np.abs(fine - other))) / size

    if np.max(begin.swing(order)) > _SWINGS * size:
        return "its error swings from step to step, which does not die away"
    # Half of the states show what chance does to the rates, coarser ladders what each owes to its
    # longest steps.
    uncertain = changed(propagated(SETTLED, stride=2))
    if any(np.any(coarse != fine) for coarse, fine in rates[SETTLED]):
        uncertain = max(uncertain, changed(propagated(SETTLED, ladder=0)))
    unsettled = 0.0 if local.one_step else changed(propagated(later))
    if _LEFT * unsettled > _MOST_UNCERTAIN:
        return f"what is carried settles slowly: {_LATER} steps more change it by {unsettled:.1%}"
    if uncertain > _MOST_UNCERTAIN:
        return f"the prediction is uncertain by {uncertain:.0%}"
    return PredictedError(order, times, fine, max(uncertain, _LEFT * unsettled))


def _lacks_order(what: str, local: Expansion) -> str | None:
    """Why there is no leading term of order 1 or more."""
    if local.order is None and not local.one_step:
        return (
            f"{what} shows no order within {EXPANSION_STEPS} steps: what is carried is still "
            "settling, or rounding hides its error"
        )
    if local.order is None:
        return f"rounding hides the local error, which is of order {local.seen + 2} or higher"
    if local.order < 1 and local.problem.rigid:
        return (
            "the problem has constraints, which its reference keeps less exactly than the steps do"
        )
    if local.order < 0:
        return f"{what} is not the identity at dt = 0"
    if local.order == 0:
        return f"{what} solves another equation"
    return None


def _local_error(
    samples: StepSamples, pieces: Pieces, order: int, zeros: int, settled: int, one_step: bool
) -> np.ndarray:
    """The rates at which the error grows by itself, ``(2, states, *state)``.

    Those from the finest ladder of step sizes that was needed come last, before them those from the
    ladder before; the same if the first was fine enough.
    """
    own = pieces.t, pieces.y, pieces.reach, pieces.increments
    found: list[np.ndarray] = []
    for rungs in _RUNGS:
        local = Expansion(samples, *own, rungs, zeros, settled, one_step)
        rate = local.rate(order)
        found.append(rate.value)
        if not local.one_step:
            # Of many short steps, rounding limits the rates.
            moved = derivative_of_rhs(samples.problem)(pieces.t, pieces.y, local.start(order).value)
            found = [rate.value - moved]
            break
        change = rate.error if len(found) == 1 else found[-1] - found[-2]
        if np.max(np.abs(change)) <= _OPEN * np.max(np.abs(rate.value)):
            break
    return np.stack([found[-2:][0], found[-1]])


def _propagated(
    problem: Problem,
    times: np.ndarray,
    begin: np.ndarray,
    t: np.ndarray,
    y: np.ndarray,
    rate: np.ndarray,
) -> np.ndarray:
    """The solution of ``e' = f_y e + rate`` at the sample times, ``(times, *state)``."""
    # Every other state of a single frame may be as few as four.
    along = make_interp_spline(t, np.stack([y, rate], axis=1), min(_DEGREE, len(t) - 1))
    along_tangent, shape = derivative_of_rhs(problem), begin.shape
    scale = max(float(np.max(np.abs(rate))) * float(t[-1] - t[0]), float(np.max(np.abs(begin))))

    def slope(t: float, e: np.ndarray) -> np.ndarray:
        y, rate = along(t)
        tangent = e.reshape(1, *shape)
        return (along_tangent(np.array([t]), y[None], tangent)[0] + rate).ravel()

    solution = solve_ivp(
        slope,
        (times[0], times[-1]),
        begin.ravel(),
        method="DOP853",
        t_eval=times,
        rtol=_RTOL,
        atol=_RTOL * scale,
    )
    return solution.y.T.reshape(-1, *shape)


@in_float64
def order_once_started(local: Expansion) -> int | None:
    """The least order of the steps by themselves, where the start is of a lower one.

    An error of the start moves on as a disturbance of the state does: its rate is f_y times itself,
    up to twice its order, where its square comes in.

    Arguments:
        local: whose order is 1 or more.

    Returns:
        None where the start is not what the order is owed to.
    """
    if local.one_step or local.order is None or local.order < 1:
        return None
    least = max(local.order + 1, min(2 * local.order, local.seen + 1))
    for order in range(local.order, least):
        moved = derivative_of_rhs(local.problem)(local.t, local.y, local.start(order).value)
        rest = np.max(np.abs(local.rate(order).value - moved))
        if not rest <= _EXPLAINED * np.max(np.abs(moved)):
            return order if order > local.order else None
    return least
