"""Right-hand sides as expressions of heyoka."""

from __future__ import annotations

import sys
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.errors import InputError
from ropeode.problems import PROBLEMS, InextensibleRope, Problem, Rope
from ropeode.references.extended.taylor import solve
from ropeode.references.extended.translate import translate
from tests.sampled import sampled

heyoka = pytest.importorskip("heyoka", reason="the extra 'extended' is not installed")

BITS = 113


def both(problem, states, t=1.3, bits=53):
    """What the translation and the JAX right-hand side say, each ``(states, components)``.

    In float64, where the two may differ by the order of operations.
    """
    translation = translate(problem, bits)
    compiled = heyoka.cfunc(translation.derivatives, translation.variables, compact_mode=True)
    rhs = jax.jit(problem.rhs)
    with jax.enable_x64(True):
        # As building the problem calls it, which has compiled it.
        wanted = [np.asarray(rhs(np.float64(t), y, problem.args)).reshape(-1) for y in states]
    return np.array([compiled(y.reshape(-1), time=t) for y in states]), np.array(wanted)


def largest_difference(found, wanted):
    return np.max(np.max(np.abs(found - wanted), axis=1) / np.max(np.abs(wanted), axis=1))


# Each operation by itself is tested below.
FEW = ("kepler", "double-pendulum", "oregonator")
UNEVEN = {"num_nodes": 4, "start": (0, 0, 0), "end": (1, 2, 3), "pinned": [0, 1], "damping": 0.3}
OTHER_ROPES = {
    "uneven": Rope(
        **UNEVEN, node_mass=[1, 2, 3, 4], stiffness=[5, 6, 7], initial_velocity=[1, 2, 3]
    ),
    "with a link that is held": InextensibleRope(**UNEVEN),
    "of one node": InextensibleRope(num_nodes=1, pinned=[]),
}


@pytest.mark.parametrize("name", [*sampled(PROBLEMS, fast=FEW), *OTHER_ROPES])
def test_problems_are_what_jax_computes(name):
    problem = OTHER_ROPES[name].problem() if name in OTHER_ROPES else PROBLEMS[name]()
    draw = np.random.default_rng(3).normal(size=(5, *problem.y0.shape))
    found, wanted = both(problem, problem.y0 + 0.1 * problem.scale * draw)
    # Measured: 5.4e-16 at most; 3.4e-15 for the Oregonator, one of whose rates nearly cancels. An
    # inextensible rope's tensions come from a system whose condition counts.
    limit = {"oregonator": 7e-15, "with a link that is held": 1e-14}.get(name, 2e-15)
    assert largest_difference(found, wanted) < limit


INDEX = np.array([2, 0, 1])
MATRIX = np.array([[0.3, 0.1, 0.7], [0.2, -0.4, 0.9], [1.1, 0.6, -0.8]])


def bands(y):
    """A tridiagonal system of three equations, solved."""
    zero = jnp.zeros(1)
    lower, upper = jnp.concatenate([zero, y[:2]]), jnp.concatenate([y[1:], zero])
    return jax.lax.linalg.tridiagonal_solve(lower, 4.0 + y, upper, jnp.stack([y, y**2], 1)).sum(1)


@jax.custom_jvp
def own_rule(y):
    return y * y


own_rule.defjvp(lambda y, dy: (y[0] ** 2, 2 * y[0] * dy[0]))


def looped(y):
    """A loop of known length, with something carried, something read and something stacked."""

    def body(carry, row):
        return carry + row * y, carry * row

    carry, rows = jax.lax.scan(body, y, jnp.array([0.3, 0.5]), reverse=True)
    return carry + rows[0] - rows[1] + jax.lax.fori_loop(0, 3, lambda i, z: z * 0.7 + y[i], y)


POSITIVE = MATRIX @ MATRIX.T + 2 * np.eye(3)


def parts(z):
    return jnp.real(z) + 2 * jnp.imag(z) + 3 * jnp.abs(z)


def of_complex(z):
    """All that is done with two complex numbers, as three real ones."""
    entire = jnp.exp(z) + jnp.sin(z) * jnp.cos(z) + jnp.sinh(z) * jnp.cosh(z)
    rational = jnp.tan(z) + jnp.tanh(z) / (2 + 1j) + 1 / (1 + z) + z**3 + z**-2 + jnp.square(-z)
    rational += jax.jvp(jnp.tanh, [z], [z])[1]
    product = jnp.sum(z) * jnp.prod(z) * jnp.conj(z) + jnp.sign(z) * jnp.dot(z, z)
    return jnp.stack(
        [*parts(entire + rational + product), parts(jax.lax.complex(z.real, z.imag).sum())]
    )


def drawn_by(t, draw=jax.random.normal):
    return draw(jax.random.fold_in(jax.random.key(0), jnp.floor(t).astype(int)), (3,))


# Of a state of three components, from 0.2 to 0.8.
ELEMENTWISE = [
    *(jnp.sin, jnp.cos, jnp.tan, jnp.arcsin, jnp.arccos, jnp.arctan, jnp.sinh, jnp.cosh, jnp.tanh),
    *(jnp.arcsinh, jnp.arctanh, jnp.exp, jnp.exp2, jnp.expm1, jnp.log, jnp.log1p, jnp.log2),
    *(jnp.sqrt, jnp.cbrt, jax.lax.rsqrt, jax.nn.sigmoid, jax.scipy.special.erf, jnp.square),
]
COMMON = {
    # Of what changes, and of constants.
    **{each.__name__: lambda t, y, a, f=each: f(y) + f(a) * y for each in ELEMENTWISE},
    "arithmetic": lambda t, y, a: -(y + 1.5) * y / (y - 3.0) + y**3 + y**-2,
    "powers": lambda t, y, a: (
        y**1.5 + 2.0**y + y**a + a**a + jax.lax.pow(y, jnp.array([2, 3, 1])) + jnp.polyval(a, y)
    ),
    "atan2": lambda t, y, a: jnp.arctan2(y, y[::-1]) + jnp.arctan2(y, 0.3) + jnp.arctan2(0.3, a),
    "other domains": lambda t, y, a: jnp.arccosh(1.0 + y) + jnp.cbrt(-y * 3.0) + jnp.cbrt(-a),
    "erfc": lambda t, y, a: jax.scipy.special.erfc(y),
    "choices": lambda t, y, a: jnp.abs(y) + jnp.abs(-y) + jax.lax.clamp(0.0, y, 1.0),
    "larger and smaller": lambda t, y, a: jnp.maximum(y, 0.1) * y + jnp.minimum(y, 0.1),
    "steps": lambda t, y, a: (
        jnp.sign(y) * y + jnp.floor(y + 2) * y + jnp.ceil(y) + jnp.round(y / 9) + (y > 0.1) * y
    ),
    "constant choices": lambda t, y, a: (
        jnp.abs(-a) * y + jnp.maximum(a, 0.5) + jnp.sign(a) + jnp.where(a > 0.5, a, y)
    ),
    "guard": lambda t, y, a: jnp.where(y > 0, 1 / jnp.where(y > 0, y, 1.0), 0.0),
    "slices": lambda t, y, a: jnp.concatenate([y[1:], y[:1]]) + y[::-1] + jnp.pad(y[:1], (1, 1)),
    "indices": lambda t, y, a: y[INDEX] + y[jnp.argmax(a)] + jnp.roll(y, 1) + jnp.take(y, INDEX),
    "dynamic": lambda t, y, a: jax.lax.dynamic_slice(y, (jnp.argmax(a) - 1,), (1,)) * y,
    "updates": lambda t, y, a: y.at[0].set(2.0 * y[1]) + y.at[INDEX].add(y**2),
    "dynamic update": lambda t, y, a: jax.lax.dynamic_update_slice(y, y[:1], (1,)),
    "repeated update": lambda t, y, a: y.at[jnp.array([1, 1, 2])].add(y),
    "shapes": lambda t, y, a: (
        (jnp.stack([y, 2 * y]).T.reshape(2, 3)[:, None] * y).squeeze(1).sum(0) + jnp.tile(y, 2)[1:4]
    ),
    "split": lambda t, y, a: sum(jnp.split(jnp.concatenate([y, y * y]), 2)) + jnp.copy(y),
    "sums": lambda t, y, a: (
        jnp.sum(y) + jnp.prod(y) + jnp.cumsum(y) + jnp.cumprod(y) + jax.lax.cumsum(y, reverse=True)
    ),
    "sums over nothing": lambda t, y, a: y + jnp.sum(y[3:]) + jnp.dot(y[3:], y[3:]),
    "products": lambda t, y, a: MATRIX @ y + jnp.einsum("ij,jk,k->i", MATRIX, MATRIX, y),
    "batched product": lambda t, y, a: jnp.einsum("bi,bi->b", MATRIX * y, MATRIX),
    "tridiagonal": lambda t, y, a: bands(y),
    "gradient": lambda t, y, a: -jax.grad(lambda y: jnp.sum(jnp.sqrt(y) * jnp.tanh(y[::-1])))(y),
    "calls": lambda t, y, a: jax.jit(own_rule)(y) + jax.checkpoint(jnp.sin)(y),
    "loops": lambda t, y, a: looped(y),
    "barrier": lambda t, y, a: jax.lax.optimization_barrier(y) + jax.lax.stop_gradient(y),
    "time": lambda t, y, a: jnp.cos(1.7 * t) * y + t,
    "whole numbers": lambda t, y, a: y * jnp.arange(3) + jax.lax.iota(float, 3),
}
# What few right-hand sides have, and what takes long to translate.
RARE = {
    "scalars in turn": lambda t, y, a: (
        jax.lax.map(lambda z: z * z * t, y)
        + jax.lax.scan(lambda c, z: (c + z, c * z), 0.0, y)[1]
        + jax.lax.scan(lambda c, z: (c, z), y, jnp.zeros((0, 3)))[1].sum()
    ),
    "remainders": lambda t, y, a: y % 0.27 + (-y) % 0.23 + jnp.fmod(y, 0.11) + y // 0.45,
    "extremes": lambda t, y, a: jnp.max(y) * y - jnp.min(MATRIX * y, axis=1),
    "extremes so far": lambda t, y, a: jax.lax.cummax(y) + jax.lax.cummin(y, reverse=True),
    "orders": lambda t, y, a: (
        jnp.sort(y) * y[jnp.argsort(y)] + jnp.median(y) + y[jax.lax.top_k(y, 2)[1]].sum()
    ),
    "logarithms of sums": lambda t, y, a: (
        jax.nn.logsumexp(y) * y + jnp.logaddexp(y, 0.3) + jax.lax.cumlogsumexp(y) + jnp.hypot(y, a)
    ),
    "signs in bits": lambda t, y, a: 2 * jnp.copysign(y, -1.0) + jnp.where(jnp.signbit(y), 0.0, y),
    "complex": lambda t, y, a: of_complex(y[0] + 1j * y[1:]),
    "complex branches": lambda t, y, a: parts(
        jnp.sqrt(1j + y) * jnp.log(y - 1j) + jax.lax.rsqrt(y + 2j) + (y + 1j) ** a
    ),
    "spectra": lambda t, y, a: (
        jnp.abs(jnp.fft.fft(jnp.resize(y, 12) * jnp.arange(12.0)))[:3]
        + jnp.real(jnp.fft.ifft(jnp.fft.fft(y) * jnp.array([0.0, 1j, -1j])))
        + jnp.fft.irfft(jnp.fft.rfft(jnp.tile(y, 2)) * jnp.arange(4) * 1j, 6)[:3]
        + jnp.fft.irfft2(jnp.fft.rfft2(jnp.outer(y, y)) * 1j, (3, 3))[1]
    ),
    "convolutions": lambda t, y, a: (
        jnp.convolve(y, jnp.array([1.0, -2.0, 1.0]), mode="same") + jnp.convolve(y, y, mode="same")
    ),
    "linear systems": lambda t, y, a: (
        jnp.linalg.solve(MATRIX + jnp.diag(y) / 9, y)
        + jnp.linalg.inv(MATRIX) @ y
        + jnp.linalg.solve(MATRIX + 1j * jnp.diag(y), y + 0j).real
    ),
    "positive systems": lambda t, y, a: (
        jax.scipy.linalg.cho_solve(jax.scipy.linalg.cho_factor(POSITIVE + jnp.diag(y)), y)
        + jax.scipy.linalg.solve_triangular(POSITIVE, y, trans=1, lower=True, unit_diagonal=True)
    ),
    "no counterpart but constant": lambda t, y, a: (
        jnp.linalg.eigh(POSITIVE)[1] @ y
        + jax.scipy.special.digamma(a) * y
        + jax.random.normal(jax.random.key(0), (3,)) * y
    ),
    "noise that changes with time": lambda t, y, a: drawn_by(t, jax.random.uniform) * y,
    "tables": lambda t, y, a: (
        a[jnp.floor(t).astype(int)] * y
        + jnp.interp(y, np.linspace(0, 1, 8), np.linspace(0, 1, 8) ** 2)
        + y.at[jnp.argmax(y)].add(1.0) * jax.lax.dynamic_index_in_dim(a, jnp.floor(t).astype(int))
    ),
    "outside": lambda t, y, a: y.at[np.array([0, 7, 1])].get(mode="fill", fill_value=0.25) + y,
    "factors": lambda t, y, a: y.at[INDEX[:2]].multiply(y[1:]) - y.at[np.array([1, 1])].add(-y[:2]),
}
# What these do depends on numbers, so that they are followed step by step.
STEERED = {
    "branches": lambda t, y, a: (
        jax.lax.cond(y[0] > 0, jnp.sin, jnp.cos, y)
        + jax.lax.switch(jnp.floor(y[0]).astype(int) + 1, [jnp.sin, jnp.cos, jnp.tan], y)
    ),
    "a loop with an end from args": lambda t, y, a: jax.lax.fori_loop(
        0, jnp.asarray(a[0] * 4).astype(int), lambda i, z: z * 0.5 + y, y
    ),
    "loops side by side": lambda t, y, a: jax.vmap(
        lambda n, z: jax.lax.while_loop(
            lambda c: c[0] < n, lambda c: (c[0] + 1.0, c[1] * z), (0.0, z)
        )[1]
    )(jnp.arange(3.0), y),
    "determinants": lambda t, y, a: jnp.linalg.slogdet(MATRIX + jnp.diag(y))[1] * y,
}


def problem_of(rhs, y0=(0.3, 0.5, 0.7)):
    return Problem(rhs, y0, [0.0, 1.0], np.array([0.7, 0.9, 0.2]))


@pytest.mark.parametrize("cases", [COMMON, STEERED, pytest.param(RARE, marks=pytest.mark.slow)])
def test_each_primitive_is_what_jax_computes(cases):
    """All of them in one program, which compiles ten times as fast."""

    def rhs(t, y, a):
        parts = zip(cases.values(), jnp.unstack(y.reshape(-1, 3)), strict=True)
        return jnp.concatenate([case(t, part, a) for case, part in parts])

    problem = problem_of(rhs, (0.3, 0.5, 0.7) * len(cases))
    # So near that all choose the same branches.
    states = problem.y0 * np.random.default_rng(4).uniform(0.99, 1.01, size=(5, problem.y0.size))
    found, wanted = both(problem, states, t=0.3)
    for at, name in enumerate(cases):
        own = slice(3 * at, 3 * at + 3)
        # A few operations, of which the worst (a difference of near numbers) loses a digit.
        assert largest_difference(found[:, own], wanted[:, own]) < 1e-14, name


def test_constants_are_the_binary64_numbers():
    """A literal, what is closed over, an argument, an array; and what they make is not rounded."""

    def rhs(t, y, args):
        arrays = np.array([0.1]) * y[:1], args[:1] * y[:1], jnp.full(1, 0.1) * y[:1]
        return jnp.stack([0.1 * y[0], *jnp.concatenate(arrays), args[1] / args[2] * y[0]])

    problem = Problem(rhs, np.eye(5)[0], [0.0, 1.0], np.array([0.1, 1.0, 3.0]))
    found = translate(problem, 300)
    real = {"fp_type": heyoka.real, "prec": 300}
    compiled = heyoka.cfunc(found.derivatives, found.variables, **real)
    values = compiled(np.array([heyoka.real(each, 300) for each in problem.y0]))
    for value, exact in zip(values, [*4 * [Fraction(0.1)], Fraction(1, 3)], strict=True):
        assert abs(Fraction(str(value)) - exact) < Fraction(1, 2**300)


@pytest.mark.parametrize(
    ("name", "rhs"),
    [
        ("digamma", lambda t, y, a: jax.scipy.special.digamma(y)),
        ("erf_inv", lambda t, y, a: drawn_by(t) * y),
        ("while", lambda t, y, a: jax.lax.while_loop(lambda z: z[0] < 1, lambda z: z + 1e-4, y)),
        ("scan", lambda t, y, a: jax.lax.fori_loop(0, 3000, lambda i, z: z * 0.5, y)),
        ("reduce_precision", lambda t, y, a: jax.lax.reduce_precision(y, 8, 7)),
    ],
)
def test_other_primitives_are_named(name, rhs):
    with pytest.raises(
        InputError, match=r"^rhs: uses the JAX primitive .*allowed: .*Fix: "
    ) as error:
        translate(problem_of(rhs), BITS)
    assert repr(name) in str(error.value)


@pytest.mark.parametrize(
    ("rhs", "other", "same"),
    [
        # The rows that are exchanged do not matter to the solution.
        (lambda y: jnp.linalg.solve(jnp.diag(y[::-1]) + MATRIX, y), [5.0, 0.5, 9.0], True),
        (lambda y: jnp.logaddexp(y, y[::-1]), [0.7, 0.5, 0.3], True),
        (lambda y: jnp.cos(3 * jnp.arctan2(y, y[::-1])), [-0.3, 0.5, -0.7], True),
        # The float64 number next to pi is not pi.
        (lambda y: jnp.sin(2 * jnp.pi * jnp.mod(y, 1.0)), [1.3, 2.5, -0.7], False),
        (lambda y: jnp.sort(y), [0.7, 0.5, 0.3], False),
        # Equal to the sixth digit is not the same.
        (lambda y: jnp.where(y > 0.1, jnp.sin(y), y * (1 + 1e-6)), [0.05, 0.5, 0.7], False),
    ],
)
def test_another_choice_may_make_the_same_function(rhs, other, same):
    translation = translate(problem_of(lambda t, y, a: rhs(y)), BITS)
    states = np.array([[0.3, 0.5, 0.7], other])
    # Something else is chosen in any case.
    assert [at for at, _ in translation.guards.breaks([0.0, 0.0], states)] == [1]
    assert (translation.first_break([0.0, 0.0], states) is None) == same


def test_powers_have_a_series_at_zero():
    """As Duffing's oscillator passes through its middle."""
    problem = problem_of(lambda t, y, a: jnp.stack([y[1], -y[0] - y[0] ** 3, y[2] ** 5]), [0, 1, 0])
    run = solve(problem)
    assert run.failure is None
    assert run.states[-1][2] == 0


def test_angles_end_where_they_jump():
    problem = Problem(
        lambda t, y, a: jnp.stack([-y[1], y[0], jnp.arctan2(y[1], y[0])]),
        [1.0, 0.0, 0.0],
        [0.0, 3.0, 4.0],
    )
    run = solve(problem)
    assert run.reached == 2
    assert "'atan2'" in run.failure
    assert abs(float(run.states[1][2]) - 4.5) < 1e-15


def newton(y):
    """The root of a number by Newton's iteration, which ends when it is accurate."""
    return jax.lax.while_loop(
        lambda z: jnp.abs(z * z - y[0]) > 1e-12, lambda z: (z + y[0] / z) / 2, jnp.ones(())
    )[None]


@pytest.mark.parametrize(
    ("rhs", "states", "first"),
    [
        # Inside the two ends at the start; then at an end's other side.
        (lambda y: jax.lax.clamp(-1.0, y, 1.0), [0.5, 0.9, 1.1], (2, "clamp")),
        (lambda y: jax.lax.clamp(-1.0, y, 1.0), [0.5, -0.9, -1.1], (2, "clamp")),
        (lambda y: jax.lax.clamp(-1.0, y, 1.0), [0.5, -0.9, 0.9], None),
        # Above both ends, and then inside.
        (lambda y: jax.lax.clamp(-1.0, y, 0.0), [0.5, 0.1, -0.5], (2, "clamp")),
        (jnp.abs, [0.5, 0.1, -0.1], (2, "abs")),
        # Another number of rounds.
        (newton, [0.9, 0.91, 30.0], (2, "abs")),
        # More states than are looked at together.
        (jnp.abs, [*np.ones(777), *-np.ones(223)], (777, "abs")),
    ],
)
def test_the_first_state_with_another_choice(rhs, states, first):
    ts = np.arange(float(len(states)))
    translation = translate(Problem(lambda t, y, args: rhs(y), states[:1], ts), BITS)
    assert translation.first_break(ts, np.array(states)[:, None]) == first


def test_missing_heyoka_says_how_to_get_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "heyoka", None)
    with pytest.raises(InputError, match=r"heyoka: .*pip install '\.\[extended\]'$"):
        translate(problem_of(lambda t, y, a: y), BITS)
