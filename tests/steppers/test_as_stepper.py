"""Whatever advances a state by dt is a stepper, and runs wherever steppers run."""

from __future__ import annotations

import functools

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate

from ropeode import Phase, Problem, Rope, Stepper, accuracy_table, as_stepper, load, simulate
from ropeode.errors import InputError, UserCodeError
from ropeode.problems import PROBLEMS
from ropeode.simulation import method_of
from ropeode.steppers import STEPPERS, TEMPLATES, ProblemClass, template
from tests.checking import steps


def semi_implicit(acceleration, t, x, v, dt, args):
    v = v + dt * acceleration(t, x, v, args)
    return x + dt * v, v


def semi_implicit_node_by_node(acceleration, t, x, v, dt, args):
    x, v, a = np.array(x), np.array(v), acceleration(t, x, v, args)
    for node in np.ndindex(x.shape[:1]):
        v[node] += dt * a[node]
        x[node] += dt * v[node]
    return x, v


def explicit(rhs, t, y, dt, args):
    slope = rhs(t, y, args)
    return jnp.stack([y[0] + dt * slope[0], y[1] + dt * slope[1]])


def explicit_in_numpy(rhs, t, y, dt, args):
    return np.add(y, np.multiply(dt, rhs(t, y, args)))


class SemiImplicit(Stepper):
    needs = "second order"

    def step(self, system, t, y, dt):
        v = y.v + dt * system.acceleration(t, y.x, y.v)
        return Phase(y.x + dt * v, v)


class Layoutless(SemiImplicit):
    """Takes positions as the problem stores them."""

    any_layout = True


ROPE = Rope(num_nodes=5, damping=0.1, node_mass=[1.0, 0.7, 1.3, 0.9, 1.1])
MOVING = ROPE.model_copy(update={"initial_velocity": (0.3, 0.2)})
PROBLEM = MOVING.problem(frames=3)
# With the evaluations in a step.
SAME = [
    ("semi-implicit-euler", semi_implicit, 1),
    ("semi-implicit-euler", semi_implicit_node_by_node, 1),
    ("semi-implicit-euler", SemiImplicit, 1),
    ("semi-implicit-euler", SemiImplicit(), 1),
    ("semi-implicit-euler", Layoutless, 1),
    ("explicit-euler", explicit, 1),
    ("explicit-euler", explicit_in_numpy, 1),
    ("explicit-euler", "diffrax:Euler", 1),
    ("rk4", steps.rk4, 4),
]


@pytest.mark.parametrize(("name", "what", "per_step"), SAME)
def test_the_same_formula_makes_the_same_states(name, what, per_step):
    """On a rope that is stored (dim, nodes), and is handed to users as (nodes, dim)."""
    expected, run = (simulate(PROBLEM, each, 96) for each in (name, what))
    assert np.max(np.abs(run.states - expected.states)) <= 1e-11 * PROBLEM.scale
    assert run.rhs_evaluations == 96 * PROBLEM.frames * per_step


def mixes_nodes(xp):
    """A step that treats nodes unlike each other: what acts on whole arrays must not be turned."""

    def step(acceleration, t, x, v, dt, args):
        a = acceleration(t, x, v, args)
        middle = xp.mean(x, axis=0)
        weights = xp.arange(1.0, len(x) + 1.0)[:, None]
        v = v + dt * a + 1e-3 * dt * xp.cumsum(v, axis=0)
        x = x + dt * v + 1e-4 * dt * (x[::-1] - middle) * weights
        first = xp.where(xp.arange(len(x))[:, None] == 1, x + 1e-5 * dt, x)
        return first @ xp.eye(x.shape[1]), v

    return step


def test_axes_are_those_that_the_user_sees():
    compiled, interpreted = (method_of(mixes_nodes(xp), PROBLEM) for xp in (jnp, np))
    assert (compiled.trial.compiled, interpreted.trial.compiled) == (True, False)
    fast, slow = (simulate(PROBLEM, each, 10).states for each in (compiled, interpreted))
    assert np.max(np.abs(fast - slow)) <= 1e-12 * PROBLEM.scale


@pytest.mark.parametrize("what", [semi_implicit, semi_implicit_node_by_node, "scipy:RK23"])
def test_members_of_an_ensemble_run_as_they_run_alone(what):
    ropes = ROPE.ensemble(frames=2, damping=np.array([0.0, 0.2, 0.05]))
    runs = simulate(ropes, what, 8)
    for member, run in zip(ropes, runs, strict=True):
        alone = simulate(member, what, 8)
        assert np.max(np.abs(run.states - alone.states)) <= 1e-12 * member.scale
        assert run.rhs_evaluations == alone.rhs_evaluations


def test_a_run_that_diverges_ends_in_both_drivers():
    def blows_up(xp):
        return lambda rhs, t, y, dt, args: xp.multiply(1e200, y) * 1e200 if t is None else y * 1e150

    for xp in (np, jnp):
        run = simulate(PROBLEM, blows_up(xp), 2)
        assert (run.status, run.diverged_at) == ("diverged", 2)
        assert len(run.states) == 2


def test_what_the_code_reads_may_change():
    """What was compiled for an earlier value is not used for the next one."""
    strength = 1.0

    def step(acceleration, t, x, v, dt, args):
        v = v + strength * dt * acceleration(t, x, v, args)
        return x + dt * v, v

    first = simulate(PROBLEM, step, 32).states
    strength = 1.0 + 1e-12
    near = simulate(PROBLEM, step, 32).states
    strength = 1.0
    again = simulate(PROBLEM, step, 32).states
    assert np.array_equal(first, again)
    assert 0.0 < np.max(np.abs(near - first)) < 1e-9


class Weighted(SemiImplicit):
    """Its objects differ in an array, and cannot be hashed where they are compared."""

    def __init__(self, weight):
        self.weight = np.array([weight])

    def __eq__(self, other):
        return np.array_equal(self.weight, other.weight)

    def step(self, system, t, y, dt):
        return super().step(system, t, y, self.weight[0] * dt)


def test_objects_of_a_class_are_what_they_hold():
    half, whole = Weighted(0.5), Weighted(1.0)
    expected = simulate(PROBLEM, "semi-implicit-euler", 32).states
    assert np.max(np.abs(simulate(PROBLEM, whole, 32).states - expected)) < 1e-9
    assert np.max(np.abs(simulate(PROBLEM, half, 32).states - expected)) > 1e-3
    half.weight[0] = 1.0
    assert np.max(np.abs(simulate(PROBLEM, half, 32).states - expected)) < 1e-9


def test_a_callback_is_told_from_another():
    """JAX sees of both no more than that they are called, and may call them in float32."""
    dtypes = set()

    def calling(factor):
        def host(a):
            dtypes.add(a.dtype.name)
            return factor * np.asarray(a)

        def step(acceleration, t, x, v, dt, args):
            a = acceleration(t, x, v, args)
            v = v + dt * jax.pure_callback(host, jax.ShapeDtypeStruct(a.shape, a.dtype), a)
            return x + dt * v, v

        return step

    half, *same = (simulate(PROBLEM, calling(factor), 8).states for factor in (0.5, *[1.0] * 3))
    expected = simulate(PROBLEM, "semi-implicit-euler", 8).states
    assert np.max(np.abs(half - expected)) > 1e-3
    for states in same:
        np.testing.assert_allclose(states, expected, rtol=1e-12)
    assert dtypes == {"float64"}


def test_hidden_state_is_refused_with_a_way_out():
    before = []

    def remembers(acceleration, t, x, v, dt, args):
        last = before[-1] if before else x - dt * v
        before.append(np.array(x))
        new = 2 * x - last + dt**2 * acceleration(t, x, v, args)
        return new, (new - x) / dt

    for what in (remembers, steps.counts):
        with pytest.raises(UserCodeError, match="keeps hidden state") as raised:
            simulate(PROBLEM, what, 8)
        assert template("two-step") in str(raised.value)


def test_files(tmp_path):
    file = tmp_path / "mine.py"
    code = "def step(rhs, t, y, dt, args):\n    return y + dt * rhs(t, y, args)\n"
    file.write_text(f"import numpy as np\n{code}\ndef helper(a, b):\n    return a\n")
    for text in (f"{file}:step", str(file)):
        assert as_stepper(text).label == f"{file}:step"
    mine = as_stepper("mine.py", 1, folder=tmp_path)
    assert (mine.label, mine.order(ProblemClass())) == ("mine.py:step", 1)
    file.write_text(code + code.replace("step", "other"))
    with pytest.raises(InputError, match=r"this one has .*mine.py:step, .*mine.py:other"):
        as_stepper(str(file))
    file.write_text("step = 3\n")
    with pytest.raises(InputError, match="this one has none"):
        as_stepper(str(file))
    for name, words in (("step", "a step function, a Stepper"), ("stp", "did you mean 'step'")):
        with pytest.raises(InputError, match=words):
            as_stepper(f"{file}:{name}")


def table_of(steppers, steps):
    rope = Rope(num_nodes=5, damping=0.0, stiffness=25.0, initial_velocity=(0.3, 0.2))
    return accuracy_table(rope.problem(frames=2), steppers, steps, predict=False)


@pytest.mark.slow
def test_all_kinds_in_one_table(tmp_path):
    """Functions and classes from files, solvers of libraries, and a stepper of ropeode."""
    files = [tmp_path / f"{name}.py" for name in TEMPLATES]
    for name, file in zip(TEMPLATES, files, strict=True):
        file.write_text(template(name))
    libraries = [diffrax.Heun, integrate.RK23]
    orders = table_of([*map(str, files), *libraries, "rk4"], [64, 128, 256]).orders
    kinds = ["velocity_verlet", "heun", "PositionVerlet", "diffrax:Heun", "scipy:RK23", "rk4"]
    for kind, each in zip(kinds, orders, strict=True):
        assert kind in each.stepper
    assert [each.expected for each in orders] == [None, None, 2, 2, 3, 4]
    observed = [each.order.observed for each in orders]
    assert observed == pytest.approx([2, 2, 2, 2, 3, 4], abs=0.05)


def own_gravity(acceleration, t, x, v, dt, args):
    """A pendulum in units of its own: it asks nobody for forces."""
    del acceleration
    v = v - dt * np.sin(np.array(x))
    return x + dt * v, v


def test_round_off_is_not_guessed_where_other_units_are_not_understood():
    table = accuracy_table(load("pendulum"), [semi_implicit, own_gravity], [16], predict=False)
    understood, not_understood = (row.round_off for row in table.rows)
    assert 0.0 < understood < 1e-8
    assert not_understood is None


def test_labels():
    another = functools.partial(semi_implicit)
    assert as_stepper(semi_implicit).label == "semi_implicit"
    assert as_stepper(another).label == "partial"
    assert as_stepper(semi_implicit, 1, label="mine").label == "mine"
    assert as_stepper(as_stepper(semi_implicit, 1), label="mine").order(ProblemClass()) == 1
    assert as_stepper(SemiImplicit).label == "SemiImplicit"
    with pytest.raises(InputError, match=r"label=\.\.\."):
        table_of([explicit, as_stepper(semi_implicit, label="explicit")], [4])
    for text in STEPPERS:
        assert as_stepper(text).label == text


@pytest.mark.parametrize(
    ("what", "settings", "words"),
    [
        ("rk4", {"order": 4}, "none with 'rk4', which declares its own"),
        ("rk4", {"order": 3, "label": "mine"}, "order: 3 given"),
        ("diffrax:Heun", {"label": "mine"}, "none with 'diffrax:Heun'"),
        (explicit, {"order": 0}, "order: 0 given; allowed: a whole number >= 1"),
        (Problem, {}, "a step function, a Stepper"),
        (lambda x: x, {}, r"its parameters are \(x\)"),
    ],
)
def test_bad_arguments(what, settings, words):
    with pytest.raises(InputError, match=words):
        as_stepper(what, **settings)


class AsksForForces(Stepper):
    def step(self, system, t, y, dt):
        return y + dt * system.acceleration(t, y, y)


@pytest.mark.parametrize(
    ("stepper", "problem", "words"),
    [
        (semi_implicit, "lorenz", "needs a second-order problem"),
        (AsksForForces, "lorenz", 'needs = "second order"'),
        ("diffrax:SemiImplicitEuler", "rope", "depends on the velocities"),
    ],
)
def test_steppers_for_forces_need_a_mechanical_problem(stepper, problem, words):
    with pytest.raises(InputError, match=words):
        simulate(PROBLEMS[problem](frames=2), stepper, 8)


@pytest.mark.parametrize("number", [2.0, np.array(2.0), jnp.asarray(2.0)])
def test_arithmetic_of_phases_is_that_of_the_stacked_array(number):
    a, b = np.array([[1.0, 2.0], [3.0, 5.0]]), np.array([[0.5, 4.0], [-1.0, 2.0]])
    for calculation in (
        lambda a, b: number * (a - b) + b * number,
        lambda a, b: a / number - (1.0 / b),
        lambda a, b: number - (-a),
        lambda a, b: sum([a**2, b]),
    ):
        own = calculation(Phase(*a), Phase(*b))
        assert isinstance(own, Phase)
        np.testing.assert_allclose(np.stack([own.x, own.v]), calculation(a, b), rtol=1e-6)
    own = Phase(*a)
    assert own.shape == a.shape
    assert np.array_equal(own[1], a[1])
    # What an array has and a phase has not.
    for wrong in (
        lambda: own == Phase(*b),
        lambda: bool(own),
        lambda: own[0, 1],
        lambda: np.sin(own),
        lambda: own + np.ones((2, 2)),
    ):
        with pytest.raises(TypeError):
            wrong()
