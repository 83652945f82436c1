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
DIFFRAX_ORDERS = {
    "Bosh3": 3,
    "Dopri5": 5,
    "Dopri8": 8,
    "Euler": 1,
    "Heun": 2,
    "ImplicitEuler": 1,
    "KenCarp3": 3,
    "KenCarp4": 4,
    "KenCarp5": 5,
    "Kvaerno3": 3,
    "Kvaerno4": 4,
    "Kvaerno5": 5,
    "LeapfrogMidpoint": 2,
    "Midpoint": 2,
    "Ralston": 2,
    "ReversibleHeun": 2,
    "SemiImplicitEuler": 1,
    # 3 in the explicit part and 2 in the implicit one.
    "Sil3": 2,
    "Tsit5": 5,
}
_NOISE = "noise term"
DIFFRAX_REFUSED = {
    "ALIGN": _NOISE,
    "EulerHeun": _NOISE,
    "GeneralShARK": _NOISE,
    "HalfSolver": "cannot be made without arguments",
    "ItoMilstein": _NOISE,
    "QUICSORT": _NOISE,
    "SEA": _NOISE,
    "SPaRK": _NOISE,
    "SRA1": _NOISE,
    "ShARK": _NOISE,
    "ShOULD": _NOISE,
    "SlowRK": _NOISE,
    "StratonovichMilstein": _NOISE,
}
SCIPY_ORDERS = {"RK23": 3, "RK45": 5, "DOP853": 8, "Radau": 5}


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


def test_every_solver_of_diffrax_is_graded_or_refused():
    """Walks diffrax itself, so that a new solver fails here until it is listed."""

    def below(solver):
        return {solver}.union(*(below(each) for each in solver.__subclasses__()))

    solvers = {each.__name__: each for each in below(diffrax.AbstractSolver)}
    exported = {
        name
        for name, each in solvers.items()
        if getattr(diffrax, name, None) is each and not name.startswith("Abstract")
    }
    assert exported == {*DIFFRAX_ORDERS, *DIFFRAX_REFUSED}


def test_every_solver_of_scipy_is_graded_or_refused():
    exported = {
        name
        for name, each in vars(integrate).items()
        if isinstance(each, type) and issubclass(each, integrate.OdeSolver)
    }
    # test_bad_names has those that are refused.
    assert exported == {*SCIPY_ORDERS, "BDF", "LSODA", "OdeSolver"}


@pytest.mark.parametrize(
    ("name", "order"),
    [
        *((f"diffrax:{name}", order) for name, order in DIFFRAX_ORDERS.items()),
        *((f"scipy:{name}", order) for name, order in SCIPY_ORDERS.items()),
    ],
)
def test_it_declares_its_documented_order(name, order):
    assert as_stepper(name).order(ProblemClass()) == order


# Of each kind of solver those that other tests here compile as well: explicit Runge-Kutta methods
# of several orders, implicit ones, and those that are neither. The others are slow tests.
FAST = {
    "Euler",
    "ImplicitEuler",
    "LeapfrogMidpoint",
    "Midpoint",
    "ReversibleHeun",
    "SemiImplicitEuler",
}


def mostly_slow(names):
    return [pytest.param(name, marks=[] if name in FAST else pytest.mark.slow) for name in names]


@pytest.mark.parametrize("name", mostly_slow(DIFFRAX_ORDERS))
@jax.enable_x64(True)
def test_diffrax_has_its_documented_order(name):
    found = examination_of(f"diffrax:{name}").convergence("driven")
    assert holds(found, DIFFRAX_ORDERS[name]) is not False, found.orders


@pytest.mark.slow
@pytest.mark.parametrize("name", DIFFRAX_ORDERS)
@jax.enable_x64(True)
def test_diffrax_has_its_documented_order_on_every_rope(name):
    examination = examination_of(f"diffrax:{name}")
    implicit = isinstance(examination.stepper.solver, diffrax.AbstractImplicitSolver)
    # Each step of these solves equations, which takes its time.
    problems = ("textbook", "uneven") if implicit else convergence_problems()
    results = {
        problem: holds(examination.convergence(problem), DIFFRAX_ORDERS[name])
        for problem in problems
    }
    assert False not in results.values(), results
    assert True in results.values(), results


@pytest.mark.parametrize("name", mostly_slow(SCIPY_ORDERS))
@jax.enable_x64(True)
def test_scipy_has_its_documented_order(name):
    # What runs in Python takes its time.
    found = examination_of(f"scipy:{name}").convergence("driven")
    assert holds(found, SCIPY_ORDERS[name]) is not False, found.orders


@jax.enable_x64(True)
def test_a_wrong_claim_about_a_solver_is_seen():
    examination = examination_of("diffrax:Midpoint")
    assert holds(examination.convergence("driven"), 3) is False
    assert holds(examination.convergence("driven"), 1) is False


@pytest.mark.parametrize(
    "name", [pytest.param("KenCarp4", marks=pytest.mark.slow), "ImplicitEuler"]
)
@jax.enable_x64(True)
def test_what_a_root_finder_leaves_over_breaks_no_symmetry(name):
    examination = examination_of(f"diffrax:{name}")
    for check in ("translation", "rotation", "time-shift"):
        found = CHECKS[check](examination)
        assert found.status == "pass", found.line


def test_a_solver_object_keeps_its_own_root_finder():
    finder = optimistix.Chord(rtol=1e-3, atol=1e-3)
    stepper = as_stepper(diffrax.ImplicitEuler(root_finder=finder))
    assert stepper.solver.root_finder is finder


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


@pytest.mark.parametrize(
    ("solver", "other", "same"),
    [
        ("diffrax:Dopri5", integrate.RK45, True),
        pytest.param("diffrax:Bosh3", integrate.RK23, True, marks=pytest.mark.slow),
        ("diffrax:Midpoint", integrate.RK45, False),
    ],
)
@jax.enable_x64(True)
def test_both_libraries_make_the_same_of_the_same_method(solver, other, same):
    """Dormand and Prince's method of order 5, and Bogacki and Shampine's, are in both."""
    problem = convergence_problems()["uneven"]
    first, second = (examination_of(each).run(problem, 6) for each in (solver, other))
    assert (np.max(np.abs(first - second)) < 1e-13) == same


@jax.enable_x64(True)
def test_a_semi_implicit_solver_is_not_told_of_damping():
    examination = examination_of("diffrax:SemiImplicitEuler")
    assert not np.any(examination.problems["damped"].args.damping)
    assert np.any(examination.problems["driven"].args.drive)


@jax.enable_x64(True)
def test_a_step_that_scipy_would_shorten_is_no_step():
    """Radau's iteration does not converge across a spring without length."""
    problem = convergence_problems()["textbook"]
    y0 = problem.y0.copy()
    y0[0, 3] = y0[0, 2]
    states = examination_of("scipy:Radau").run(problem.changed(y0=y0), 4)
    assert np.all(np.isnan(states[1:]))


@pytest.mark.parametrize("name", DIFFRAX_REFUSED)
def test_refused_by_diffrax(name):
    with pytest.raises(InputError, match=DIFFRAX_REFUSED[name]):
        as_stepper(f"diffrax:{name}")


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ("diffrax:Huen", "did you mean 'Heun'"),
        ("diffrax:heum", "did you mean 'Heun'"),
        ("diffrax:", "does not exist"),
        ("diffrax:AbstractERK", "does not exist"),
        ("scipy:RK54", "does not exist; allowed: BDF, DOP853"),
        ("scipy:BDF", "orders 1 to 5"),
        ("scipy:LSODA", "among methods"),
        ("numpy:RK45", "diffrax:NAME"),
        (integrate.BDF, "orders 1 to 5"),
        (diffrax.HalfSolver, "without arguments"),
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
