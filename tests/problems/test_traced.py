"""What a user's function reads besides its arguments is never out of date, and never float32."""

from __future__ import annotations

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import each_reference, error_series, hanging_equilibrium, reference, stability_limit
from ropeode.errors import InputError
from ropeode.problems import Ensemble, Problem, Rope
from ropeode.simulation import simulate

TS = [0.0, 1.0, 2.5]
RATES = (1.0, 2.0, 1.0)


@dataclasses.dataclass
class Decay:
    """A right-hand side that cannot be hashed, and a method that reads its object."""

    rate: float = 1.0

    def __call__(self, t, y, args):
        return -self.rate * y

    def slope(self, t, y, args):
        return -self.rate * y


def in_a_closure():
    read = Decay()
    return read, lambda t, y, args: -read.rate * y


def in_an_array():
    read, numbers = Decay(), np.ones(1)

    def rhs(t, y, args):
        numbers[:] = read.rate
        return -jnp.asarray(numbers) * y

    return read, rhs


def as_an_object():
    read = Decay()
    return read, read


def as_a_method():
    read = Decay()
    return read, read.slope


def inside_jit():
    read = Decay()
    return read, lambda t, y, args: jax.jit(lambda y: -read.rate * y)(y)


READERS = (
    in_a_closure,
    as_a_method,
    pytest.param(as_an_object, marks=pytest.mark.slow),
    # Programs of their own.
    pytest.param(in_an_array, marks=pytest.mark.slow),
    pytest.param(inside_jit, marks=pytest.mark.slow),
)


@pytest.mark.parametrize("make", READERS)
def test_what_changed_between_calls_is_seen(make):
    read, rhs = make()
    problem = Problem(rhs, [1.5], TS)
    members = Ensemble.varying(problem, y0=np.array([[1.5], [-3.0]]))
    for rate in RATES:
        read.rate = rate
        exact = 1.5 * np.exp(-rate * np.array(TS))
        for each in (problem, Problem(rhs, [1.5], TS)):
            certified = reference(each)
            assert np.all(np.abs(certified.states[:, 0] - exact) <= certified.bound())
            run = simulate(each, "rk4", 64)
            np.testing.assert_allclose(run.states[:, 0], exact, rtol=1e-6)
            assert error_series(run, certified).final == pytest.approx(
                abs(run.states[-1, 0] - exact[-1]), rel=1e-3
            )
        for one, own in zip(each_reference(members), (1.0, -2.0), strict=True):
            assert np.all(np.abs(one.states[:, 0] - own * exact) <= one.bound())
        runs = simulate(members, "rk4", 64)
        np.testing.assert_allclose(runs.states[:, 0], np.outer(exact, [1.0, -2.0]), rtol=1e-6)


def test_extended_precision_sees_it_too():
    pytest.importorskip("heyoka")
    read, rhs = in_a_closure()
    problem = Problem(rhs, [1.5], TS)
    for rate in RATES[:2]:
        read.rate = rate
        found = reference(problem, level="extended").states[-1, 0]
        assert found == pytest.approx(1.5 * np.exp(-2.5 * rate), rel=1e-15)


def test_a_reference_stays_with_its_equation():
    read, rhs = in_a_closure()
    problem = Problem(rhs, [1.5], TS)
    before = reference(problem)
    read.rate = 3.0
    with pytest.raises(InputError, match="another problem .* changed since"):
        error_series(simulate(problem, "rk4", 64), before)


def test_other_functions_are_read_anew():
    numbers = {"rate": 0.3, "stiffness": 2.0}
    problem = Problem.second_order(
        lambda t, x, v, args: -numbers["stiffness"] * x,
        [1.0],
        [0.0],
        TS,
        energy=lambda t, y, args: 0.5 * jnp.sum(y[1] ** 2 + numbers["stiffness"] * y[0] ** 2),
    )
    for stiffness in (2.0, 7.0):
        numbers["stiffness"] = stiffness
        run = simulate(problem, "velocity-verlet", 256)
        exact = np.cos(np.sqrt(stiffness) * np.array(TS))
        np.testing.assert_allclose(run.positions[:, 0, 0], exact, atol=1e-3)
        energies = run.problem.energies(run.states)
        np.testing.assert_allclose(energies, stiffness / 2, rtol=1e-3)


def test_what_is_measured_of_a_problem_is_read_anew():
    numbers = {"stiffness": 2.0}
    problem = Problem.second_order(
        lambda t, x, v, args: 1.0 - numbers["stiffness"] * x, [1.0], [0.0], TS
    )
    for stiffness in (2.0, 8.0):
        numbers["stiffness"] = stiffness
        rest = hanging_equilibrium(problem)
        assert rest[0, 0] == pytest.approx(1 / stiffness)
        limit = stability_limit(problem, "semi-implicit-euler")
        assert limit == np.ceil(1.5 * np.sqrt(stiffness) / 2)


def rhs_of(function):
    """The right-hand side as a problem has it, by which programs are found again."""
    return Problem(function, np.ones(2), [0.0, 1.0]).rhs


def test_equal_functions_are_equal():
    def of(rate):
        return rhs_of(lambda t, y, args: -rate * y)

    one, other, same = of(1.0), of(2.0), of(1.0)
    assert one == same
    assert hash(one) == hash(same)
    assert one != other
    assert Rope(num_nodes=3).problem(2).rhs == Rope(num_nodes=3).problem(2).rhs


def test_what_computes_something_else_is_not_equal():
    """In its operations, their order, their parameters, or what is inside of them."""
    functions = [
        lambda t, y, args: jnp.sin(y),
        lambda t, y, args: jnp.cos(y),
        lambda t, y, args: t - y,
        lambda t, y, args: y - t,
        lambda t, y, args: y**3,
        lambda t, y, args: y**5,
        lambda t, y, args: jax.lax.cond(t > 0, jnp.sin, jnp.tan, y),
        lambda t, y, args: jax.lax.cond(t > 0, jnp.tan, jnp.sin, y),
    ]
    assert len({*map(rhs_of, functions)}) == len(functions)


def test_an_array_that_is_written_to_makes_another_function():
    rates = np.array([1.0, 2.0])

    def now():
        return rhs_of(lambda t, y, args: -(rates * y))

    before = now()
    rates[:] = 3.0
    assert now() != before
    with jax.enable_x64(True):
        assert before(0.0, np.ones(2), None).tolist() == [-1.0, -2.0]


def test_a_derivative_of_its_own_belongs_to_a_function():
    def of(slope):
        @jax.custom_jvp
        def double(y):
            return 2.0 * y

        double.defjvp(lambda inputs, moved: (double(*inputs), slope * moved[0]))
        return rhs_of(lambda t, y, args: double(y))

    assert of(2.0) == of(2.0)
    assert of(2.0) != of(3.0)


def test_other_shapes_are_left_to_the_function():
    function = Problem(lambda t, y, args: y * args["k"], np.ones(2), [0.0, 1.0], {"k": 2.0}).rhs
    with jax.enable_x64(True):
        assert function(0, np.ones(3), {"k": 2}).shape == (3,)
        assert function(0, np.array([1, 2]), {"k": 2}).tolist() == [2.0, 4.0]
    assert function(0.0, np.ones(2), {"k": 3.0}).tolist() == [3.0, 3.0]


@jax.custom_vjp
def _reverse_only(y):
    return -jnp.sin(y)


_reverse_only.defvjp(lambda y: (_reverse_only(y), y), lambda y, by: (-by * jnp.cos(y),))


def test_functions_for_reverse_mode_only():
    """Dense output and implicit solvers need derivatives in forward mode."""

    def rhs(t, y, args):
        twice = jax.lax.scan(lambda c, _: (0.5 * _reverse_only(c), None), y, None, length=2)[0]
        return _reverse_only(y) + 0.0 * twice

    problem = Problem(rhs, [1.0], [0.0, 1.0])
    found = reference(problem, dense=True).at([0.5])[0, 0]
    assert found == pytest.approx(2 * np.arctan(np.tan(0.5) * np.exp(-0.5)), rel=1e-12)


def test_functions_with_derivatives_of_their_own_beside_other_primitives():
    """An index has named parameters, and a product in place no derivative."""

    def rhs(t, y, args):
        return _reverse_only(y[::-1][np.array([1, 0])]) + jax.nn.relu(y).at[0].multiply(2.0)

    problem = Problem(rhs, [1.0, 2.0], [0.0, 1.0])
    with jax.enable_x64(True):
        found = problem.rhs(0.0, problem.y0, None)
    np.testing.assert_allclose(found, [2.0 - np.sin(1.0), 2.0 - np.sin(2.0)], rtol=1e-15)


def test_keys_of_random_numbers_are_numbers():
    def of(seed):
        key = jax.random.key(seed)
        return rhs_of(lambda t, y, args: y * jax.random.normal(key))

    assert of(1) == of(1)
    assert of(1) != of(2)


@pytest.mark.slow
def test_tables_are_looked_up_by_time():
    def rhs(t, y, args):
        return args["rate"][jnp.floor(t).astype(int)] * y

    rates = np.array([1.0, -2.0, 0.5, 0.0])
    problem = Problem(rhs, [1.0], [0.0, 1.0, 2.0, 3.0], {"rate": rates}, jump_times=(1.0, 2.0))
    found = reference(problem)
    assert abs(found.states[-1, 0] - np.exp(-0.5)) <= found.bound()[-1]


COARSE = np.float32(0.1)
with jax.enable_x64(False):
    OUTSIDE, ONE = jnp.array([0.1]), jnp.array(0.1)


@pytest.mark.parametrize(
    "rhs",
    [
        lambda t, y, args: COARSE * y,
        lambda t, y, args: jnp.float32(0.1) * y,
        lambda t, y, args: jnp.asarray(0.1, "float32") * y,
        lambda t, y, args: np.array([COARSE]) * y,
        lambda t, y, args: OUTSIDE * y,
        lambda t, y, args: ONE * y,
        lambda t, y, args: (2 * y.astype(jnp.float32)).astype(float),
        lambda t, y, args: y.astype(jnp.bfloat16).astype(float),
        lambda t, y, args: jnp.where(y > 0, COARSE, 0.2) * y,
        lambda t, y, args: jax.lax.fori_loop(0, 3, lambda i, c: c * ONE, y),
        lambda t, y, args: jax.lax.cond(t > 1, lambda y: y * jnp.float32(0.3), jnp.sin, y),
        lambda t, y, args: jnp.real(y * jnp.array([1j], jnp.complex64)),
    ],
)
def test_float32_in_the_function_is_refused(rhs):
    with pytest.raises(InputError, match=r"rhs: .* allowed: numbers in float64\. Fix: .*"):
        Problem(rhs, [1.0], TS)


def test_calls_of_python_are_refused():
    def rhs(t, y, args):
        return jax.pure_callback(np.sin, jax.ShapeDtypeStruct(y.shape, y.dtype), y)

    with pytest.raises(InputError, match="rhs: 'pure_callback' in line .*Problem.from_scipy"):
        Problem(rhs, [1.0], TS)


@pytest.mark.parametrize("coarse", [np.float32([0.1]), np.float16([0.1]), OUTSIDE])
def test_float32_in_the_input_is_refused(coarse):
    def rhs(t, y, args):
        return -y

    fine = Problem(rhs, [1.0], TS)
    with pytest.raises(InputError, match="y0: .*float64"):
        Problem(rhs, coarse, TS)
    with pytest.raises(InputError, match=r"y0\[1\]: .*float64"):
        Problem(rhs, [1.0, coarse[0]], TS)
    with pytest.raises(InputError, match=r"ts\[1\]: .*float64"):
        Problem(rhs, [1.0], [0, *coarse, *coarse + 1])
    with pytest.raises(InputError, match=r"args\['deep'\]\[1\]: .*float64"):
        Problem(rhs, [1.0], TS, {"deep": [1.0, coarse]})
    with pytest.raises(InputError, match="v0: .*float64"):
        Problem.second_order(lambda t, x, v, args: -x, [1.0], coarse, TS)
    with pytest.raises(InputError, match="stiffness: .*float"):
        Rope(stiffness=coarse[0])
    with pytest.raises(InputError, match="gravity: .*float"):
        Rope(gravity=np.full(3, coarse[0]))
    with pytest.raises(InputError, match="y0: .*float64"):
        Ensemble.varying(fine, y0=np.asarray(coarse)[None])


def test_numbers_of_float64_are_not_taken_for_float32():
    def rhs(t, y, args):
        for value in (0.1, 1.0, 3.0, 0.375, 1e-3, 2.0**-20, 12345.0, 1e300, np.inf):
            y = jnp.minimum(y, value)
        return y

    assert Problem(rhs, [1.0], TS).frames == 2


@pytest.mark.parametrize("value", [0.1, 1e-3, -2.7, np.pi, 1e30])
def test_widened_numbers_of_float32_are_recognised(value):
    with pytest.raises(InputError, match="rhs: .* float64"):
        Problem(lambda t, y, args: jnp.minimum(y, float(np.float32(value))), [1.0], TS)


def test_functions_without_a_module():
    """As code has it that runs by `exec`."""
    names: dict = {}
    exec("def rhs(t, y, args):\n    return -y", names)
    assert names["rhs"].__module__ is None
    assert Problem(names["rhs"], [1.0], [0.0, 1.0]).rhs(0.0, np.ones(1), None) == -1.0
