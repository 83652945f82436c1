"""What all float64 runs lose alike: motion too small for the state, and digits of the equation."""

from __future__ import annotations

import importlib.util

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from ropeode import reference
from ropeode.precision import in_float64
from ropeode.problems import Problem, Rope
from ropeode.references import DOPRI8, RADAU9, solve
from ropeode.references.solvers.rounding import change_by_rounding
from tests.references.covered import covered, reference_and
from tests.references.scalar_problems import scalar

EPS = np.finfo(np.float64).eps
Exact = np.longdouble


# Each returns about zero, and has lost something on the way.
LOSSES = {
    "a sum of two": lambda one, small: (one + small) - one,
    "both sides alike": lambda one, small: (one + small) - (one + 2 * small),
    "1 - cos": lambda one, small: one - jnp.cos(1e8 * small),
    "of one array": lambda one, small: jnp.diff(jnp.cos(1e8 * small * jnp.array([1.0, 2.0])))[0],
    # Nothing else in these is moved: a product with 1.0 is exact.
    "a product": lambda one, small: 0.3 * (3.0 * one) - 0.9,
    "a quotient": lambda one, small: one / (3.0 * one) - 1 / 3,
    "a sum of many": lambda one, small: jnp.sum(jnp.stack([one, small, -one])),
    "a product of matrices": lambda one, small: jnp.stack([one, small, -one]) @ jnp.ones(3),
    "a running sum": lambda one, small: jnp.cumsum(jnp.stack([one, small, -one]))[2],
    "sums by index": lambda one, small: (
        jnp.zeros(1).at[jnp.array([0, 0, 0])].add(jnp.stack([one, small, -one]))[0]
    ),
    "whole turns": lambda one, small: (1e9 * one + small) % 1.0,
    "scan": lambda one, small: lax.scan(
        lambda sum, x: (sum + x, None), 0 * one, jnp.stack([one, small, -one])
    )[0],
    "two rounds of a scan": lambda one, small: jnp.diff(
        lax.scan(lambda _, x: (_, jnp.cos(x)), 0.0, 1e8 * small * jnp.arange(2.0))[1]
    )[0],
    "while_loop": lambda one, small: (
        lax.while_loop(lambda x: x > 10, lambda x: x - one, 12.0 + small) - 10.0
    ),
    "cond": lambda one, small: lax.cond(small > 0, lambda: (one + small) - one, lambda: one),
    "where": lambda one, small: jnp.where(small > 0, (one + small) - one, one),
    "jit": lambda one, small: jax.jit(lambda: (one + small) - one)(),
    "a derivative of its own": lambda one, small: jax.nn.softplus(40 * one + small) - 40 * one,
    "a comparison of equal numbers": lambda one, small: jnp.where(one + small > one, 1.0, 0.0),
    "complex numbers": lambda one, small: jnp.real((one + 1j * one + small) - one),
    "linear equations": lambda one, small: jnp.linalg.solve(
        jnp.array([[1, 3.0], [1, 3.0 + 1e-12]]), jnp.stack([one, one])
    )[1],
}


def newton(y):
    """A root. The iteration would never meet its tolerance if each round were moved."""

    def closer(state):
        x, _ = state
        step = (x * x - y) / (2 * x)
        return x - step, step

    return lax.while_loop(lambda state: jnp.abs(state[1]) > 1e-15, closer, (1.5 * y, y))[0]


# Nothing is rounded here, or no more than the input is; and so much is seen of it.
EXACT = {
    "differences of close numbers": (lambda x: (3.0 + 0 * x) - x, 10 * EPS),
    "powers of two": (lambda x: 0.25 * (4.0 * x) - x / 8.0 + x / 8.0, 10 * EPS),
    "whole parts": (lambda x: jnp.floor(3.3 * x), 0.0),
    "a table": (lambda x: jnp.array([5.0, 7.0, 9.0])[jnp.floor(x * 1.1).astype(int)], 0.0),
    "comparisons": (lambda x: jnp.where(x * 1.1 >= np.nextafter(2.2, 3), 1.0, 2.0), 0.0),
    "from oneself": (lambda x: jnp.trace(jnp.subtract.outer(*2 * [jnp.stack([x, x / 3])])), 0.0),
    "a loop that ends": (newton, 8 * EPS),
    "at the edge of a domain": (lambda x: jnp.sqrt(x - 2.0), 1e-7),
    "the state": (lambda x: x, 4 * EPS),
}


@pytest.fixture(scope="module")
def changes():
    """For each loss and what is exact, the changes by many seeds."""

    @jax.jit
    def of_seed(seed, one, small):
        def all_of_them(y):
            losses = [loss(one, small) for loss in LOSSES.values()]
            return jnp.stack([*losses, *(exact(y[0]) for exact, _ in EXACT.values()), y[1]])

        return change_by_rounding(all_of_them, jnp.stack([2 * one, 0 * one]), seed)

    @in_float64
    def computed():
        return np.array([of_seed(seed, 1.0, 1e-17) for seed in range(1, 17)])

    return dict(zip([*LOSSES, *EXACT, "a zero"], computed().T, strict=True))


# Of which a comparison may go the right way by chance, and moves may cancel.
BY_CHANCE = {
    *("a comparison of equal numbers", "linear equations", "complex numbers"),
    "a derivative of its own",
}
LARGEST = {"whole turns": 1.0, "a comparison of equal numbers": 1.0, "linear equations": 1e-2}


@pytest.mark.parametrize("name", LOSSES)
def test_what_is_lost_shows(name, changes):
    pairs = changes[name].reshape(-1, 2)
    seen = np.mean(np.any(pairs != 0, axis=1))
    assert seen >= (0.5 if name in BY_CHANCE else 1.0)
    assert np.max(np.abs(pairs)) <= LARGEST.get(name, 200 * EPS)


@pytest.mark.parametrize("name", EXACT)
def test_what_is_exact_stays(name, changes):
    _, largest = EXACT[name]
    assert np.all(np.isfinite(changes[name]))
    assert np.max(np.abs(changes[name])) <= largest


def test_the_state_itself_is_moved(changes):
    """By two units in the runs that turn directions."""
    places = (2.0 + changes["the state"]).view(np.int64) - np.float64(2.0).view(np.int64)
    assert np.abs(places).tolist() == [1, 2] * 8
    assert not np.any(changes["a zero"])


def loses(loss):
    """``y' = size loss - rate y``; but for rounding, `loss` is ``constant + square t^2``."""
    return lambda t, y, size, small, wave, rate: size * loss(t, small, wave) - rate * y


EQUATIONS = [
    # Its surge is over soon after t = 0.
    lambda t, y, rate, slope, surge, _: rate * y + slope + surge * jnp.exp(-100 * t),
    loses(lambda t, small, wave: (1.0 + small) - 1.0),
    loses(lambda t, small, wave: jnp.sum(jnp.stack([small * 0 + 1, small, -1 + small * 0]))),
    loses(lambda t, small, wave: 1.0 - jnp.cos(wave * t)),
    loses(lambda t, small, wave: jnp.sqrt(1.0 + (wave * t) ** 2) - 1.0),
]


def rhs(t, y, args):
    """One of `EQUATIONS`, so that one compilation serves all."""
    which, numbers = args
    return lax.switch(which, EQUATIONS, t, y, *numbers)


def problem_of(which, y0, ts, *numbers):
    return Problem(rhs, [y0], ts, (np.int64(which), tuple(map(float, numbers))))


def creeping(y0, ts, rate=0.0, slope=0.0, surge=0.0):
    return problem_of(0, y0, ts, rate, slope, surge, 0.0)


def crept(problem):
    """The exact solution, to 18 digits; surges come without a rate."""
    rate, slope, surge, _ = map(Exact, problem.args[1])
    t = problem.ts.astype(Exact) - problem.ts[0]
    spread = np.expm1(rate * t) / rate if rate else t
    return problem.y0[0] * np.exp(rate * t) + slope * spread - surge * np.expm1(-100 * t) / 100


@pytest.mark.parametrize("solver", [DOPRI8, pytest.param(RADAU9, marks=pytest.mark.slow)], ids=str)
def test_steps_too_short_to_move_the_state_are_not_lost(solver):
    """In 10 000 steps y grows by 9 units in the last place, and by 1/1000 in each."""
    problem = creeping(1.0, np.arange(6.0), rate=4e-16)
    run = solve(problem, solver, 1e-9, 1e-9, max_steps=20_000, longest_steps=np.full(5, 5e-4))
    assert run.steps >= 10_000
    np.testing.assert_allclose(run.states[:, 0] - 1.0, 4e-16 * problem.ts, rtol=0, atol=EPS / 2)


def creeping_variants(samples, start):
    """Each move, per sample, between 1/1000 and 1/2 of a unit in the last place."""
    draw = np.random.default_rng(13)
    ts = start + np.arange(samples) * 2.0 ** draw.integers(-3, 4)
    moves = EPS * 10.0 ** draw.uniform(-3, -0.3, size=3) / (ts[1] - ts[0])
    y0 = draw.choice([-1, 1], 3) * 10.0 ** draw.uniform(-5, 16, 3)
    return [
        creeping(y0[0], ts, rate=moves[0]),
        creeping(y0[1], ts, slope=moves[1] * y0[1]),
        creeping(0.0, ts - start, slope=moves[2] * 1e16, surge=1e18),
    ]


@pytest.mark.parametrize(
    ("samples", "start"), [(2, 1e9), pytest.param(2_000, 1e5, marks=pytest.mark.slow)]
)
def test_motion_below_the_last_place_is_kept(samples, start):
    for problem in creeping_variants(samples, start):
        exact = crept(problem)
        known = covered(problem, exact)
        assert known is not None
        assert known.trusted == len(problem.ts)
        # The rounding of the state itself, and of the evaluation where it grows at first.
        wrong = np.abs(known.states[:, 0] - exact) / np.spacing(np.abs(known.states[:, 0]))
        assert np.max(wrong) <= (3 if exact[0] == 0 else 0.51)


def losing_variants():
    draw = np.random.default_rng(14)
    sizes = 10.0 ** draw.uniform((4, -18, -10), (13, -15.5, -7), size=(4, 3))
    return [(3, 1e16, 0.0, 1e-8), *((which, *each) for which, each in enumerate(sizes, 1))]


@pytest.mark.parametrize(("which", "size", "small", "wave"), losing_variants())
def test_digits_lost_in_the_equation_are_not_trusted(which, size, small, wave):
    constant = size * small * (which in (1, 2))
    square = size * wave**2 / 2 * (which in (3, 4))
    ts = np.linspace(0.0, 7.0, 6)
    exact = constant + square * (ts**2 - 2 * ts + 2) + (1 - constant - 2 * square) * np.exp(-ts)
    for accuracy in (None, 1.0):
        known = covered(
            problem_of(which, 1.0, ts, size, small, wave, 1.0), exact, accuracy=accuracy
        )
    # A factor that hardly counts costs no reference.
    assert known is not None or size * EPS > 1e-7


beyond_float64 = pytest.mark.skipif(
    np.finfo(np.longdouble).nmant < 63 or importlib.util.find_spec("heyoka") is None,
    reason="heyoka is an extra, and the processor needs numbers of 64 bits",
)


def more_digits(known):
    return [each for each in known.certificate.witnesses if each.role == "more digits"]


@pytest.mark.slow
@beyond_float64
def test_a_run_with_more_digits_sees_what_is_hidden():
    """1 - cos x cancels nearly all digits, in all float64 runs alike: here it is 0 at first."""
    ts = np.linspace(0.0, 8.0, 6)
    known = reference(problem_of(3, 0.0, ts, 1e16, 0.0, 1e-8, 0.0), accuracy=10.0)
    (beyond,) = more_digits(known)
    assert str(beyond.solver) == "heyoka Taylor, 64 bits"
    assert known.certificate.versions["heyoka"]
    # t^3 / 6, as far as float64 can tell.
    error = np.abs(known.states[:, 0] - ts**3 / 6)
    assert error[-1] > 0.05
    assert np.all(error[: known.trusted] <= known.bound())
    # Eleven bits more than float64 leave three digits.
    np.testing.assert_allclose(beyond.differences["state"], error, rtol=2e-3)


@beyond_float64
def test_its_steps_are_short_and_end_on_the_samples():
    problem = creeping(1.0, [0.0, 0.5, 1.0, 1.5, 2.0, 4.0], rate=-0.5)
    _, (run,) = reference_and(problem, "more digits")
    assert run.failure is None
    assert run.steps >= 1000
    np.testing.assert_allclose(run.states[:, 0], np.exp(-0.5 * problem.ts), rtol=2e-16)


@pytest.mark.slow
@beyond_float64
def test_it_is_left_out_where_it_cannot_be_or_costs_much():
    """Of many operations, of one without a counterpart, and of a switch."""
    for problem in (
        Rope(num_nodes=64).problem(1),
        Problem(lambda t, y, a: lax.digamma(y), [3.0], [0, 1]),
        scalar("turns", 1.0, np.arange(6.0), 1.3),
    ):
        assert more_digits(reference(problem)) == []


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "pull"), [(2.0, 1e-17), (0.7, -8e-17), (5.0, 0.0)])
def test_an_unstable_balance_is_trusted_no_longer_than_it_lasts(rate, pull):
    """A node leaves it, pulled by a force of the last place."""
    ts = np.linspace(0.0, 60.0 / rate, 8)
    problem = Problem.second_order(
        lambda t, x, v, args: rate**2 * x + ((1.0 + args) - 1.0), [0.0], [0.0], ts, pull
    )
    leaves = np.stack([np.cosh(rate * ts) - 1, rate * np.sinh(rate * ts)], axis=1) / rate**2
    known = covered(problem, pull * leaves)
    assert known is None or known.horizon is not None
