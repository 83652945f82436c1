"""Solvers of diffrax and SciPy have the orders that their documentation gives them."""

from __future__ import annotations

import functools

import diffrax
import jax
import numpy as np
import optimistix
import pytest
from scipy import integrate

from ropeode.checking import CHECKS, Examination, convergence_problems, undamped
from ropeode.errors import InputError, UserCodeError
from ropeode.simulation import simulate
from ropeode.steppers import ProblemClass, as_stepper

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
FOR_NOISE = (
    *("ALIGN", "EulerHeun", "GeneralShARK", "ItoMilstein", "QUICSORT", "SEA", "SPaRK", "SRA1"),
    *("ShARK", "ShOULD", "SlowRK", "StratonovichMilstein"),
)


@functools.cache
def examination_of(given):
    return Examination(given)


def holds(convergence, order) -> bool | None:
    """Whether the observed orders are the documented one; None where they are undetermined.

    They may be undetermined where a method is so exact that few errors can be told from the
    reference's: an interval then holds several orders. A determined one may miss the order by
    0.25, where the last of these errors are still bent. The slower of positions and velocities
    has the method's order; a method of another order is off by 1.
    """
    intervals = []
    for found in convergence.orders.values():
        if found.ci95 is None:
            assert "which holds the orders" in (found.why or ""), (convergence.problem, found)
            return None
        intervals.append(found.ci95)
    low, high = min(intervals)[0], min(high for _, high in intervals)
    return low - 0.25 <= order <= high + 0.25


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
    # test_bad_names_and_objects has those that are refused.
    refused = {"diffrax:HalfSolver", "scipy:BDF", "scipy:LSODA", "scipy:OdeSolver"}
    assert exported == {*ORDERS, *(f"diffrax:{name}" for name in FOR_NOISE), *refused}
    for name, order in ORDERS.items():
        assert as_stepper(name).order(ProblemClass()) == order


# Of the kinds of solvers that compile quickly, one each. The others are slow tests.
FAST = ("Euler", "LeapfrogMidpoint", "ReversibleHeun", "SemiImplicitEuler")


@pytest.mark.parametrize("name", FAST)
@jax.enable_x64(True)
def test_a_solver_has_its_documented_order(name):
    name = f"diffrax:{name}"
    found = examination_of(name).convergence("driven")
    assert holds(found, ORDERS[name]) is not False, found.orders


@pytest.mark.slow
@pytest.mark.parametrize("name", ORDERS)
@jax.enable_x64(True)
def test_a_solver_has_its_documented_order_on_every_rope(name):
    examination = examination_of(name)
    solver = getattr(examination.stepper, "solver", None)
    problems = [*convergence_problems()]
    # What runs in Python takes its time, and so does what solves equations in each step.
    if name.startswith("scipy"):
        problems = ["driven"]
    elif isinstance(solver, diffrax.AbstractImplicitSolver):
        problems = ["textbook", "uneven"]
    results = {
        problem: holds(examination.convergence(problem), ORDERS[name]) for problem in problems
    }
    assert False not in results.values(), results
    assert name.startswith("scipy") or True in results.values(), results


@jax.enable_x64(True)
def test_a_wrong_claim_about_a_solver_is_seen():
    examination = examination_of("diffrax:Midpoint")
    assert holds(examination.convergence("driven"), 3) is False
    assert holds(examination.convergence("driven"), 1) is False


@pytest.mark.slow
@jax.enable_x64(True)
def test_what_a_root_finder_leaves_over_breaks_no_symmetry():
    for check in ("translation", "rotation", "time-shift"):
        found = CHECKS[check](examination_of("diffrax:ImplicitEuler"))
        assert found.status == "pass", found.line


@pytest.mark.slow
@jax.enable_x64(True)
def test_a_loose_root_finder_shows_in_the_states():
    finder = optimistix.Chord(rtol=1e-3, atol=1e-3)
    exact = examination_of("diffrax:ImplicitEuler")
    loose = examination_of(diffrax.ImplicitEuler(root_finder=finder))
    problem = convergence_problems()["unequal"]
    apart = np.max(np.abs(exact.run(problem, 8) - loose.run(problem, 8)))
    assert 1e-9 < apart < 1e-2


@jax.enable_x64(True)
def test_a_wrapped_solver_takes_two_half_steps():
    half = examination_of(diffrax.HalfSolver(diffrax.Euler()))
    problem = convergence_problems()["uneven"]
    twice = examination_of("diffrax:Euler").run(problem, 20)
    np.testing.assert_allclose(half.run(problem, 10), twice, atol=1e-13)
    assert half.stepper.label == "diffrax:HalfSolver"


@jax.enable_x64(True)
def test_both_libraries_make_the_same_of_the_same_method():
    """Dormand and Prince's method of order 5 is in both."""
    problem = convergence_problems()["uneven"]
    solvers = ("diffrax:Dopri5", integrate.RK45)
    first, second = (examination_of(each).run(problem, 6) for each in solvers)
    assert np.max(np.abs(first - second)) < 1e-13


@jax.enable_x64(True)
def test_a_step_that_scipy_would_shorten_is_no_step():
    """Radau's iteration does not converge across a spring without length."""
    problem = convergence_problems()["textbook"]
    y0 = problem.y0.copy()
    y0[0, 3] = y0[0, 2]
    states = examination_of("scipy:Radau").run(problem.changed(y0=y0), 4)
    assert np.all(np.isnan(states[1:]))


@pytest.mark.parametrize(
    ("given", "words"),
    [
        *((f"diffrax:{name}", "noise term") for name in FOR_NOISE),
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
