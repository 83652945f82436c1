"""What is wrong with a stepper that failed a check, as far as the evidence goes."""

from __future__ import annotations

from ropeode.checking.check_context import Examination
from ropeode.checking.check_ropes import convergence_problems
from ropeode.checking.diagnosis.damping_per_step import diagnose_damping_per_step
from ropeode.checking.diagnosis.heterogeneous_parameters import diagnose_heterogeneity
from ropeode.checking.diagnosis.in_place_updates import diagnose_in_place_updates
from ropeode.checking.diagnosis.low_order_causes import diagnose_low_order
from ropeode.checking.diagnosis.order_tests import outcome
from ropeode.checking.diagnosis.single_precision import diagnose_single_precision
from ropeode.checking.diagnosis.time_scaling import diagnose_time_scaling
from ropeode.checking.diagnosis.wrong_parameters import diagnose_parameters
from ropeode.checking.report import Convergence, Diagnosis
from ropeode.precision import in_float64


@in_float64
def diagnose_stepper(examination: Examination) -> tuple[Diagnosis, ...]:
    """Find by experiment what is wrong with a stepper that failed a check.

    Returns:
        One diagnosis for each cause that the evidence singles out. If there is none, one of the
        cause `unknown`, with what the evidence does say.

    Raises:
        UserCodeError: the step raised.
    """
    convergences = {
        name: examination.convergence(name)
        for name, problem in convergence_problems().items()
        if examination.refusal(problem) is None
    }
    # A declared order of 0 says that the method solves another problem on that rope.
    wrong = [
        name
        for name, convergence in convergences.items()
        if convergence.expected != 0 and outcome(convergence, 0) == "wrong"
    ]
    too_low = [
        convergence.expected
        for convergence in convergences.values()
        if convergence.expected and outcome(convergence, convergence.expected) == "low"
    ]
    single = diagnose_single_precision(examination)
    if single is not None:
        # Rounding to float32 looks like other mistakes; it has to be mended first.
        return (single,)
    causes: list[Diagnosis | None] = []
    if wrong:
        causes.append(_diagnose_wrong_limit(examination))
    if too_low:
        causes += diagnose_low_order(examination, max(too_low))
    elif not wrong:
        causes.append(diagnose_in_place_updates(examination))
    named = tuple(cause for cause in causes if cause is not None)
    return named or (_unknown(convergences, wrong),)


def _diagnose_wrong_limit(examination: Examination) -> Diagnosis | None:
    per_step = diagnose_damping_per_step(examination)
    if per_step is not None:
        return per_step
    parameters = diagnose_parameters(examination)
    if isinstance(parameters, Diagnosis):
        return parameters
    is_right_on_uniform_rope = parameters
    if is_right_on_uniform_rope:
        return diagnose_heterogeneity(examination)
    return diagnose_time_scaling(examination)


def _unknown(convergences: dict[str, Convergence], wrong: list[str]) -> Diagnosis:
    if wrong:
        return Diagnosis(
            "unknown",
            f"the stepper converges to a wrong solution on {', '.join(wrong)}; no change of "
            "gravity, damping, stiffness, mass, rest length, initial velocity or time scale "
            "explains it",
            {"wrong": wrong},
        )
    observed = [
        order.observed
        for convergence in convergences.values()
        for order in convergence.orders.values()
    ]
    orders = [order for order in observed if order is not None]
    if len(orders) < len(observed):
        return Diagnosis("unknown", "no cause stands out")
    return Diagnosis(
        "unknown",
        f"no cause stands out; the stepper converges to the right solution on all "
        f"{len(convergences)} ropes, with observed orders from {min(orders):.2f} to "
        f"{max(orders):.2f}",
        {"lowest_order": min(orders), "highest_order": max(orders)},
    )
