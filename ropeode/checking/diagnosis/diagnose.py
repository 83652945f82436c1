"""From a stepper that failed a check to what is wrong with it, as far as the evidence goes."""

from __future__ import annotations

from ropeode.checking.candidate import Candidate
from ropeode.checking.check_context import Examination
from ropeode.checking.diagnosis.damping_per_step import damping_per_step
from ropeode.checking.diagnosis.effective_problem import solved_instead
from ropeode.checking.diagnosis.heterogeneous_parameters import wrong_where_unlike
from ropeode.checking.diagnosis.in_place_updates import in_place
from ropeode.checking.diagnosis.low_order_causes import causes_of_low_order
from ropeode.checking.diagnosis.order_tests import outcome
from ropeode.checking.diagnosis.single_precision import single_precision
from ropeode.checking.diagnosis.time_scaling import another_pace
from ropeode.checking.problems import convergence_problems
from ropeode.checking.report import Convergence, Diagnosis
from ropeode.precision import in_float64


@in_float64
def diagnose(examination: Examination) -> tuple[Diagnosis, ...]:
    """Find out by experiment what is wrong with a stepper that failed a check.

    Arguments:
        examination: of the stepper.

    Returns:
        One for each cause that the evidence singles out; one `unknown` if there is none, which
        says what is known all the same.

    Raises:
        UserCodeError: the step raised.
    """
    candidate = examination.candidate
    convergences = {
        name: examination.convergence(name)
        for name, problem in convergence_problems().items()
        if examination.refusal(problem) is None
    }
    # A method that is known to solve something else on a rope is not wrong for that.
    wrong = [
        name
        for name, found in convergences.items()
        if found.expected != 0 and outcome(found, 0) == "wrong"
    ]
    lost = [
        found.expected
        for found in convergences.values()
        if found.expected and outcome(found, found.expected) == "low"
    ]
    single = single_precision(candidate)
    if single is not None:
        # What it rounds away looks like other mistakes; it has to be mended first.
        return (single,)
    causes: list[Diagnosis | None] = []
    if wrong:
        causes += _of_another_solution(candidate)
    if lost:
        causes += causes_of_low_order(examination, max(lost))
    elif not wrong:
        causes.append(in_place(examination))
    named = tuple(cause for cause in causes if cause is not None)
    return named or (_unknown(convergences, wrong),)


def _of_another_solution(candidate: Candidate) -> list[Diagnosis | None]:
    per_step = damping_per_step(candidate)
    if per_step is not None:
        return [per_step]
    solved = solved_instead(candidate)
    if isinstance(solved, Diagnosis):
        return [solved]
    return [wrong_where_unlike(candidate) if solved else another_pace(candidate)]


def _unknown(convergences: dict[str, Convergence], wrong: list[str]) -> Diagnosis:
    """What is known all the same."""
    if wrong:
        return Diagnosis(
            "unknown",
            f"it converges to something else than the solution on {', '.join(wrong)}, and no "
            "change of gravity, damping, stiffness, mass, rest length, initial velocity or pace "
            "was found that explains it",
            {"wrong": wrong},
        )
    orders = [order.observed for found in convergences.values() for order in found.orders.values()]
    known = [order for order in orders if order is not None]
    if len(known) < len(orders):
        return Diagnosis("unknown", "no cause stands out")
    return Diagnosis(
        "unknown",
        f"no cause stands out; it converges to the right solution on all {len(convergences)} "
        f"ropes, with observed orders from {min(known):.2f} to {max(known):.2f}",
        {"lowest_order": min(known), "highest_order": max(known)},
    )
