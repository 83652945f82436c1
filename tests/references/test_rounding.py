"""What all float64 runs lose alike: motion too small for the state, and digits of the equation."""

from __future__ import annotations

from typing import get_args

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from ropeode import reference
from ropeode.precision import in_float64
from ropeode.problems import PROBLEMS, Problem
from ropeode.references import DOPRI8, KVAERNO5, Role, largest_norms, solve
from ropeode.references.solvers.rounding import change_by_rounding
from tests.references.covered import covered
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
    "squares": lambda one, small: jnp.sin(one) ** 2 + jnp.cos(one) ** 2 - 1,
    "a root": lambda one, small: jnp.sqrt(one + small) - one,
    "an exponential": lambda one, small: jnp.log(jnp.exp(small)),
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
    "a square of the same": lambda one, small: (one + small) ** 2 - one,
    "complex numbers": lambda one, small: jnp.real((one + 1j * one + small) - one),
    "linear equations": lambda one, small: jnp.linalg.solve(
        jnp.array([[1, 3.0], [1, 3.0 + 1e-12]]), jnp.stack([one, one])
    )[1],
}

# Nothing is rounded here, or not so that it could be seen.
EXACT = {
    "differences of close numbers": lambda x: (3.0 + 0 * x) - x,
    "powers of two": lambda x: 0.25 * (4.0 * x) - x / 8.0 + x / 8.0,
    "whole parts": lambda x: jnp.floor(3.3 * x),
    "a table": lambda x: jnp.array([5.0, 7.0, 9.0])[jnp.floor(x * 1.1).astype(int)],
    "comparisons": lambda x: jnp.where(x * 1.1 >= np.nextafter(2.2, 3), 1.0, 2.0),
    "from oneself": lambda x: jnp.trace(jnp.subtract.outer(*2 * [jnp.stack([x, x / 3])])),
}


@pytest.fixture(scope="module")
def changes():
    """For each loss and what is exact, the changes by many seeds."""

    @jax.jit
    def of_seed(seed, one, small):
        def all_of_them(y):
            losses = [loss(one, small) for loss in LOSSES.values()]
            return jnp.stack([*losses, *(exact(y) for exact in EXACT.values())])

        return change_by_rounding(all_of_them, 2 * one, seed)

    @in_float64
    def computed():
        return np.array([of_seed(seed, 1.0, 1e-17) for seed in range(1, 17)])

    return dict(zip([*LOSSES, *EXACT], computed().T, strict=True))


@pytest.mark.parametrize("name", LOSSES)
def test_what_is_lost_shows(name, changes):
    pairs = changes[name].reshape(-1, 2)
    seen = np.any(pairs != 0, axis=1)
    # A comparison may go the right way by chance, and moves may cancel.
    by_chance = (
        "a comparison of equal numbers",
        "linear equations",
        "a root",
        "a derivative of its own",
        "complex numbers",
    )
    assert np.mean(seen) >= 0.5 if name in by_chance else np.all(seen)
    sizes = {"whole turns": 1.0, "a comparison of equal numbers": 1.0, "linear equations": 1e-2}
    assert np.max(np.abs(pairs)) <= sizes.get(name, 200 * EPS)


@pytest.mark.parametrize("name", EXACT)
def test_what_is_exact_stays(name, changes):
    # The input is rounded itself.
    largest = (
        0 if "part" in name or name in ("a table", "comparisons", "from oneself") else 10 * EPS
    )
    assert np.max(np.abs(changes[name])) <= largest


@in_float64
def test_the_state_itself_is_moved():
    """By two units in the runs that turn directions."""
    for seed, units in ((1, 1), (2, 2)):
        change = change_by_rounding(lambda y: y, np.array([3.0, 0.0]), seed)
        assert np.abs(change).tolist() == [units * np.spacing(3.0), 0.0]


@in_float64
def test_a_loop_ends_where_it_ends():
    """Newton's method would never meet its tolerance if each round were moved."""

    def root(y):
        def closer(state):
            x, _ = state
            step = (x * x - y) / (2 * x)
            return x - step, step

        start = (1.5 * y, y)
        return lax.while_loop(lambda state: jnp.abs(state[1]) > 1e-15, closer, start)[0]

    for seed in (1, 2, 3, 4):
        assert np.abs(change_by_rounding(root, np.array(2.0), seed)) < 4 * EPS


@in_float64
def test_no_change_at_the_edge_of_a_domain():
    for seed in (1, 2, 3, 4):
        change = change_by_rounding(lambda y: jnp.sqrt(y - 1.0), np.array([1.0]), seed)
        assert np.isfinite(change[0])


@pytest.mark.parametrize("solver", [DOPRI8, KVAERNO5], ids=str)
def test_steps_too_short_to_move_the_state_are_not_lost(solver):
    """In 10 000 steps y grows by 9 units in the last place, and by 1/1000 in each."""
    problem = scalar("decay", 1.0, np.arange(6.0), -4e-16)
    run = solve(problem, solver, 1e-9, 1e-9, max_steps=20_000, longest_steps=np.full(5, 5e-4))
    assert run.steps >= 10_000
    np.testing.assert_allclose(run.states[:, 0] - 1.0, 4e-16 * problem.ts, rtol=0, atol=EPS / 2)


def creeps(t, y, args):
    """``y' = rate y + slope + surge exp(-100 (t - start))``."""
    return args["rate"] * y + args["slope"] + args["surge"] * jnp.exp(-100 * (t - args["start"]))


def creeping(y0, ts, rate=0.0, slope=0.0, surge=0.0):
    args = {"rate": rate, "slope": slope, "surge": surge, "start": ts[0]}
    return Problem(creeps, [y0], ts, args)


def crept(problem):
    """The exact solution, to 18 digits; surges come without a rate."""
    args = {name: Exact(value) for name, value in problem.args.items()}
    t = problem.ts.astype(Exact) - args["start"]
    rate = args["rate"]
    spread = np.expm1(rate * t) / rate if rate else t
    surge = -args["surge"] * np.expm1(-100 * t) / 100
    return problem.y0[0] * np.exp(rate * t) + args["slope"] * spread + surge


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
        assert np.max(wrong) <= (3 if problem.args["surge"] else 0.51)


def noisy(t, y, args):
    """``y' = loss - y``, where `loss` is ``size (constant + square t^2)`` but for rounding."""
    which, size, small, wave = args
    losses = [
        lambda: (1.0 + small) - 1.0,
        lambda: jnp.sum(jnp.stack([small * 0 + 1, small, -1 + small * 0])),
        lambda: 1.0 - jnp.cos(wave * t),
        lambda: jnp.sqrt(1.0 + (wave * t) ** 2) - 1.0,
    ]
    return size * lax.switch(which, losses) - y


def noisy_variants():
    draw = np.random.default_rng(14)
    sizes = 10.0 ** draw.uniform((4, -18, -10), (13, -15.5, -7), size=(4, 3))
    return [(2, 1e16, 0.0, 1e-8), *((which, *each) for which, each in enumerate(sizes))]


@pytest.mark.parametrize(("which", "size", "small", "wave"), noisy_variants())
def test_digits_lost_in_the_equation_are_not_trusted(which, size, small, wave):
    constant = size * small * (1, 1, 0, 0)[which]
    square = size * wave**2 * (0, 0, 0.5, 0.5)[which]
    ts = np.linspace(0.0, 7.0, 6)
    exact = constant + square * (ts**2 - 2 * ts + 2) + (1 - constant - 2 * square) * np.exp(-ts)
    problem = Problem(noisy, [1.0], ts, (np.int64(which), size, small, wave))
    for accuracy in (None, 1.0):
        known = covered(problem, exact, accuracy=accuracy)
    # A factor that hardly counts costs no reference.
    assert known is not None or size * EPS > 1e-7


def column(t, x, v, args):
    """Nodes that leave an unstable balance, swing, and are pinned; forces of the last place."""
    rate, pull = args
    force = (1.0 + pull) - 1.0
    return jnp.stack([rate**2 * x[0] + force, -x[1], jnp.zeros_like(x[2])])


@pytest.mark.slow
@pytest.mark.parametrize(("rate", "pull"), [(2.0, 1e-17), (0.7, -8e-17), (5.0, 0.0)])
def test_an_unstable_balance_is_trusted_no_longer_than_it_lasts(rate, pull):
    ts = np.linspace(0.0, 60.0 / rate, 8)
    x0 = [[0.0, 0.0], [0.0, 1.0], [0.0, 3.0]]
    problem = Problem.second_order(column, x0, np.zeros((3, 2)), ts, (rate, pull))
    leaves = pull * (np.cosh(rate * ts) - 1) / rate**2
    leaves_at = pull * np.sinh(rate * ts) / rate
    exact = np.zeros((len(ts), *problem.y0.shape))
    position, velocity = (problem.quantity(name, exact) for name in problem.quantities)
    position[:, 0], velocity[:, 0] = leaves[:, None], leaves_at[:, None]
    position[:, 1, 1], velocity[:, 1, 1] = np.cos(ts), -np.sin(ts)
    position[:, 2, 1] = 3.0
    known = covered(problem, exact)
    assert known is None or known.horizon is not None


@pytest.mark.parametrize("name", ["oscillator", "kepler", "rope"])
def test_ordinary_problems_have_no_larger_bound(name, small_rope):
    known = reference(small_rope if name == "rope" else PROBLEMS[name](frames=4))
    assert known.horizon is None
    for quantity in largest_norms(known.problem):
        seen = {role: [0.0] for role in get_args(Role)}
        for witness in known.certificate.witnesses:
            seen[witness.role].append(np.max(witness.differences[quantity]))
        others = max(max(seen[role]) for role in seen if role not in ("rounding", "looser"))
        assert max(seen["rounding"]) <= 2 * max(others, 4 * EPS * np.max(np.abs(known.states)))
    assert sum(w.role == "rounding" for w in known.certificate.witnesses) == 2
