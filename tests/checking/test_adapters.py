"""Solvers of diffrax and SciPy have the orders that their documentation gives them."""

from __future__ import annotations

import diffrax
import numpy as np
import pytest
from scipy import integrate

from ropeode.checking import CHECKS, convergence_problems, undamped
from ropeode.errors import InputError, UserCodeError
from ropeode.simulation import simulate
from ropeode.steppers import ProblemClass, as_stepper
from tests.checking.no_time_limit import check_stepper

# As the docstrings of the classes have it.
ORDERS = {
    **dict.fromkeys(("Euler", "ImplicitEuler", "SemiImplicitEuler"), 1),
    **dict.fromkeys(("Heun", "LeapfrogMidpoint", "Midpoint", "Ralston", "ReversibleHeun"), 2),
    # 3 in the explicit part and 2 in the implicit one.
    "Sil3": 2,
    **dict.fromkeys(("Bosh3", "KenCarp3", "Kvaerno3"), 3),
    **dict.fromkeys(("KenCarp4", "Kvaerno4"), 4),
    **dict.fromkeys(("Dopri5", "KenCarp5", "Kvaerno5", "Tsit5"), 5),
    "Dopri8": 8,
}
ORDERS = {f"diffrax:{name}": order for name, order in ORDERS.items()} | {
    "scipy:RK23": 3,
    "scipy:RK45": 5,
    "scipy:DOP853": 8,
    "scipy:Radau": 5,
}
ORDER_ROPES = [name.removeprefix("order-") for name in CHECKS if name.startswith("order-")]
# Those of which no order is known have a reason.
REFUSED = "noise term|cannot be made without arguments|orders 1 to 5|among methods|does not exist"


def test_every_solver_is_graded_or_refused():
    """Walks the libraries themselves, so that a new solver fails here until it is listed."""

    def below(solver):
        return {solver}.union(*(below(each) for each in solver.__subclasses__()))

    solvers = {each.__name__: each for each in below(diffrax.AbstractSolver)}
    exported = {
        f"diffrax:{name}"
        for name, each in solvers.items()
        if getattr(diffrax, name, None) is each and not name.startswith("Abstract")
    }
    exported |= {
        f"scipy:{name}"
        for name, each in vars(integrate).items()
        if isinstance(each, type) and issubclass(each, integrate.OdeSolver)
    }
    assert exported > set(ORDERS)
    for name in exported - set(ORDERS):
        with pytest.raises(InputError, match=REFUSED):
            as_stepper(name)
    for name, order in ORDERS.items():
        assert as_stepper(name).order(ProblemClass()) == order


# Of the kinds of solvers that compile quickly, one each, on one rope. The others are slow tests.
FAST = ("LeapfrogMidpoint", "SemiImplicitEuler")
IMPLICIT = tuple(f"diffrax:{name}" for name in ("ImplicitEuler", "Kvaerno", "KenCarp", "Sil3"))


def ropes_for(name):
    # What runs in Python takes its time, and so does what solves equations in each step.
    if name.startswith("scipy"):
        return ["driven"]
    return ["textbook", "uneven"] if name.startswith(IMPLICIT) else ORDER_ROPES


def is_higher(finding, order):
    """Whether both positions and velocities have a higher order: the slower has the method's."""
    intervals = [found.ci95 for found in finding.convergence.orders.values()]
    return None not in intervals and min(low for low, _ in intervals) > order + 0.25


@pytest.mark.parametrize(
    ("name", "ropes"),
    [
        *((f"diffrax:{name}", ["driven"]) for name in FAST),
        *(pytest.param(name, ropes_for(name), marks=pytest.mark.slow) for name in ORDERS),
    ],
)
def test_a_solver_has_its_documented_order(name, ropes):
    """Some are so exact that few errors can be told from the reference's: undetermined."""
    names = [f"order-{rope}" for rope in ropes]
    report = check_stepper(name, ORDERS[name], only=names, diagnose=False)
    statuses = {finding.status for finding in report.findings}
    assert "fail" not in statuses, report.failed
    assert not any(is_higher(finding, ORDERS[name]) for finding in report.findings)
    assert name.startswith("scipy") or "pass" in statuses


def test_a_wrong_claim_about_a_solver_is_seen():
    (finding,) = check_stepper("diffrax:Midpoint", 3, only="order-driven", diagnose=False).findings
    assert finding.status == "fail"
    assert is_higher(finding, 1)
    assert not is_higher(finding, 2)


def states_of(solver, steps, problem="uneven"):
    return simulate(convergence_problems()[problem], solver, steps).states


def test_a_wrapped_solver_takes_two_half_steps():
    half = as_stepper(diffrax.HalfSolver(diffrax.Euler()))
    assert half.label == "diffrax:HalfSolver"
    np.testing.assert_allclose(states_of(half, 10), states_of("diffrax:Euler", 20), atol=1e-13)


def test_a_step_that_scipy_would_shorten_is_no_step():
    """Radau's iteration does not converge across a spring without length."""
    problem = convergence_problems()["textbook"]
    y0 = problem.y0.copy()
    y0[0, 3] = y0[0, 2]
    run = simulate(problem.changed(y0=y0), "scipy:Radau", 4)
    assert run.diverged_at == 1


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("diffrax:SRA1", "noise term"),
        ("diffrax:HalfSolver", "cannot be made without arguments"),
        ("diffrax:Huen", "did you mean 'Heun'"),
        ("diffrax:AbstractERK", "does not exist"),
        ("scipy:RK54", "does not exist; allowed: BDF, DOP853"),
        ("scipy:BDF", "orders 1 to 5"),
        ("scipy:LSODA", "among methods"),
        ("numpy:RK45", "diffrax:NAME"),
        (integrate.RK45(lambda t, y: y, 0.0, [1.0], 1.0), "give the class"),
    ],
)
def test_bad_names_and_objects(given, words):
    with pytest.raises(InputError, match=words):
        as_stepper(given)


class Broken(diffrax.Euler):
    """A user's own solver that does not work."""

    def step(self, *given, **named):
        raise RuntimeError("not yet written")


def test_a_solver_that_raises():
    with pytest.raises(UserCodeError, match="not yet written"):
        simulate(undamped(), Broken(), 4)
