"""Whatever advances a state by dt is a stepper, and runs wherever steppers run."""

from __future__ import annotations

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import integrate

from ropeode import Phase, Problem, Rope, Stepper, accuracy_table, as_stepper, simulate
from ropeode.errors import InputError, UserCodeError
from ropeode.problems import PROBLEMS
from ropeode.simulation import method_of
from ropeode.steppers import TEMPLATES, ProblemClass, template
from tests.checking import steps
from tests.theory.steps import euler_in_numpy


def semi_implicit(acceleration, t, x, v, dt, args):
    v = v + dt * acceleration(t, x, v, args)
    return x + dt * v, v


def explicit(rhs, t, y, dt, args):
    slope = rhs(t, y, args)
    return jnp.stack([y[0] + dt * slope[0], y[1] + dt * slope[1]])


class SemiImplicit(Stepper):
    needs = "second order"

    def step(self, system, t, y, dt):
        v = y.v + dt * system.acceleration(t, y.x, y.v)
        return Phase(y.x + dt * v, v)


class Layoutless(SemiImplicit):
    """It takes positions as the problem stores them."""

    any_layout = True


class Holds(SemiImplicit):
    """Its objects differ in an array, and cannot be hashed where they are compared."""

    def __init__(self, weight):
        self.weight = weight

    def __eq__(self, other):
        return np.array_equal(self.weight, other.weight)

    def step(self, system, t, y, dt):
        return super().step(system, t, y, self.weight[0] * dt)


def reads(weight):
    def step(acceleration, t, x, v, dt, args):
        return semi_implicit(acceleration, t, x, v, weight[0] * dt, args)

    return step


def calls(weight):
    """JAX sees of a callback no more than that it is called, and may call it in float32."""
    value = float(weight[0])

    def host(dt):
        assert dt.dtype == np.float64
        return value * np.asarray(dt)

    def step(acceleration, t, x, v, dt, args):
        dt = jax.pure_callback(host, jax.ShapeDtypeStruct((), np.float64), dt)
        return semi_implicit(acceleration, t, x, v, dt, args)

    return step


ROPE = Rope(num_nodes=5, damping=0.1, node_mass=[1.0, 0.7, 1.3, 0.9, 1.1])
MOVING = ROPE.model_copy(update={"initial_velocity": (0.3, 0.2)})
PROBLEM = MOVING.problem(frames=3)
# With the evaluations in a step, where they are known.
SAME = [
    ("semi-implicit-euler", semi_implicit, "semi_implicit", 1),
    ("semi-implicit-euler", steps.in_loops, "in_loops", 1),
    ("semi-implicit-euler", SemiImplicit, "SemiImplicit", 1),
    ("semi-implicit-euler", Layoutless(), "Layoutless", 1),
    ("explicit-euler", explicit, "explicit", 1),
    ("explicit-euler", euler_in_numpy, "euler_in_numpy", 1),
    ("explicit-euler", "diffrax:Euler", "diffrax:Euler", 1),
    ("rk4", steps.rk4, "rk4", 4),
    ("heun", diffrax.Heun, "diffrax:Heun", None),
    ("dormand-prince5", integrate.RK45, "scipy:RK45", 7),
]


@pytest.mark.parametrize(("name", "what", "label", "per_step"), SAME)
def test_the_same_formula_makes_the_same_states(name, what, label, per_step):
    """On a rope that is stored (dim, nodes), and is handed to users as (nodes, dim)."""
    expected, run = (simulate(PROBLEM, each, 96) for each in (name, what))
    assert np.max(np.abs(run.states - expected.states)) <= 1e-11 * PROBLEM.scale
    assert run.rhs_evaluations == (per_step and 96 * PROBLEM.frames * per_step)
    assert run.stepper.label == label


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


@pytest.mark.parametrize("what", [semi_implicit, steps.in_loops, "scipy:RK23"])
def test_members_of_an_ensemble_run_as_they_run_alone(what):
    ropes = ROPE.ensemble(frames=2, damping=np.array([0.0, 0.2, 0.05]))
    runs = simulate(ropes, what, 8)
    for member, run in zip(ropes, runs, strict=True):
        alone = simulate(member, what, 8)
        assert np.max(np.abs(run.states - alone.states)) <= 1e-12 * member.scale
        assert run.rhs_evaluations == alone.rhs_evaluations


def test_a_run_that_diverges_ends_in_both_drivers():
    for xp in (np, jnp):
        run = simulate(PROBLEM, lambda rhs, t, y, dt, args, xp=xp: xp.multiply(1e150, y), 2)
        assert (run.status, run.diverged_at, len(run.states)) == ("diverged", 2, 2)


@pytest.mark.parametrize("kind", [reads, Holds, calls])
def test_what_the_code_depends_on_may_change(kind):
    """What was compiled for an earlier value is not used for the next one."""
    weight = np.ones(1)
    stepper, found = kind(weight), []
    for weight[0] in (0.5, 1.0 + 1e-12, 1.0, 1.0):
        stepper = kind(weight) if kind is calls else stepper
        found.append(simulate(PROBLEM, stepper, 32).states)
    half, near, whole, again = found
    expected = simulate(PROBLEM, "semi-implicit-euler", 32).states
    assert np.max(np.abs(half - expected)) > 1e-3
    assert 0.0 < np.max(np.abs(near - whole)) < 1e-9
    assert np.max(np.abs(whole - expected)) < 1e-9
    assert np.array_equal(again, whole)


def test_hidden_state_is_refused_with_a_way_out():
    for what in (steps.remembers, steps.counts):
        with pytest.raises(UserCodeError, match="keeps hidden state") as raised:
            simulate(PROBLEM, what, 8)
        assert template("two-step") in str(raised.value)


def first_of(**how):
    """A step that takes one thing from its first call, or a copy of each by what it is."""
    kept = {}

    def step(acceleration, t, x, v, dt, args):
        if how["what"] == "dt":
            h = kept.setdefault(dt if how["each"] else None, dt)
            v = v + h * acceleration(t, x, v, args)
        else:
            key = tuple(np.asarray(args.mass)) if how["each"] else None
            mass = kept.setdefault(key, np.array(args.mass))
            v = v + dt * acceleration(t, x, v, args._replace(mass=mass))
        return x + dt * v, v

    return step


@pytest.mark.parametrize("what", ["dt", "mass"])
def test_what_is_kept_from_the_first_call_is_found(what):
    """A memo that tells calls apart is none of it."""
    with pytest.raises(UserCodeError, match=r"from its first call \(closure variable `kept"):
        simulate(PROBLEM, first_of(what=what, each=False), 8)
    right = simulate(PROBLEM, first_of(what=what, each=True), 8).states
    assert np.allclose(right, simulate(PROBLEM, "semi-implicit-euler", 8).states, atol=1e-9)


def test_files(tmp_path):
    file = tmp_path / "mine.py"
    code = "def step(rhs, t, y, dt, args):\n    return y + dt * rhs(t, y, args)\n"
    file.write_text(f"import numpy as np\n{code}\ndef helper(a, b):\n    return a\n")
    for text in (f"{file}:step", str(file)):
        assert as_stepper(text).label == f"{file}:step"
    mine = as_stepper("mine.py", 1, folder=tmp_path)
    assert (mine.label, mine.order(ProblemClass())) == ("mine.py:step", 1)
    for now, name, words in (
        (code + code.replace("step", "other"), "", r"this one has .*mine.py:step, .*mine.py:other"),
        ("step = 3\n", "", "this one has none"),
        ("step = 3\n", ":step", "a step function, a Stepper"),
        ("step = 3\n", ":stp", "did you mean 'step'"),
    ):
        file.write_text(now)
        with pytest.raises(InputError, match=words):
            as_stepper(f"{file}{name}")


def test_templates_are_the_methods_that_they_name(tmp_path):
    """Without damping, which they treat in another way."""
    problem = MOVING.model_copy(update={"damping": 0.0}).problem(frames=3)
    methods = ("velocity-verlet", "heun", "stormer-verlet")
    for name, same in zip(TEMPLATES, methods, strict=True):
        file = tmp_path / f"{name}.py"
        file.write_text(template(name))
        run, expected = (simulate(problem, each, 32) for each in (str(file), same))
        assert np.max(np.abs(run.states - expected.states)) <= 1e-11 * problem.scale


class AsksForForces(Stepper):
    def step(self, system, t, y, dt):
        return y + dt * system.acceleration(t, y, y)


def run_on(problem, stepper):
    simulate(PROBLEMS[problem](frames=2), stepper, 8)


def compare(*steppers):
    accuracy_table(PROBLEM, steppers, [4], predict=False)


MINE = as_stepper(as_stepper(semi_implicit, 1), label="explicit")


@pytest.mark.parametrize(
    "case",
    [
        (as_stepper, "rk4", {"order": 4}, "none with 'rk4', which declares its own"),
        (as_stepper, "rk4", {"order": 3, "label": "mine"}, "order: 3 given"),
        (as_stepper, "diffrax:Heun", {"label": "mine"}, "none with 'diffrax:Heun'"),
        (as_stepper, explicit, {"order": 0}, "order: 0 given; allowed: a whole number >= 1"),
        (as_stepper, "explicit-eulr", {}, "did you mean 'explicit-euler'"),
        (as_stepper, "", {}, "allowed: explicit-euler"),
        (as_stepper, "rk4:start=rest", {}, "no options"),
        (as_stepper, "stormer-verlet:strat=rest", {}, "did you mean 'start'"),
        (as_stepper, "stormer-verlet:start=rset", {}, "did you mean 'rest'"),
        (as_stepper, "stormer-verlet:start", {}, "allowed: taylor, rest"),
        (as_stepper, "stormer-verlet:start=rest,start=taylor", {}, "each option once"),
        (as_stepper, "xpbd:substeps=1e12", {}, "1000000000000 given; allowed: at most"),
        (as_stepper, "runge-kutta", {}, "allowed: runge-kutta:FILE.toml"),
        (as_stepper, "runge-kutta:own.py", {}, "allowed: runge-kutta:FILE.toml"),
        (as_stepper, Problem, {}, "a step function, a Stepper, or the name of one"),
        (as_stepper, lambda x: x, {}, r"its parameters are \(x\)"),
        (compare, explicit, MINE, {}, r"label=\.\.\."),
        (run_on, "lorenz", semi_implicit, {}, "needs a second-order problem"),
        (run_on, "lorenz", AsksForForces, {}, 'needs = "second order"'),
        (run_on, "rope", "diffrax:SemiImplicitEuler", {}, "depends on the velocities"),
        (run_on, "double-pendulum", "leapfrog", {}, "in a way that is not declared"),
    ],
)
def test_bad_arguments(case):
    call, *given, settings, words = case
    with pytest.raises(InputError, match=words):
        call(*given, **settings)


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
        np.testing.assert_allclose(np.stack([own.x, own.v]), calculation(a, b), rtol=1e-6)
    # What an array has and a phase has not.
    for wrong in (lambda y: y == y, bool, lambda y: y[0, 1], np.sin, lambda y: y + np.ones((2, 2))):
        with pytest.raises(TypeError):
            wrong(Phase(*a))
