"""The fitted parameters are those that were changed."""

import jax
import numpy as np
import pytest

from ropeode.checking.check_context import Examination
from ropeode.checking.diagnosis.diagnostic_ropes import uniform_rope
from ropeode.checking.diagnosis.fitted_numbers import numbers_of
from ropeode.checking.diagnosis.heterogeneous_parameters import diagnose_heterogeneity
from ropeode.checking.diagnosis.limits import observe_limit, runs_of
from ropeode.checking.diagnosis.parameter_fit import smallest_fits
from ropeode.checking.diagnosis.wrong_parameters import diagnose_parameters


@pytest.fixture(scope="module", autouse=True)
def _float64():
    with jax.enable_x64(True):
        yield


class WithOther(Examination):
    """A right stepper that is handed other numbers: it solves the rope that these make."""

    def __init__(self, stepper, change):
        super().__init__(stepper)
        self.change = change

    def run(self, problem, steps_per_frame):
        y0, args = self.change(problem.y0, problem.args)
        return super().run(problem.changed(y0=y0, args=args), steps_per_frame)


def args(**change):
    """A change of some of `args`, each a function of all of them."""
    return lambda y0, args: (
        y0,
        args._replace(**{name: new(args) for name, new in change.items()}),
    )


def mass(args):
    return float(args.mass[0])


CASES = {
    "gravity times the mass": (
        args(gravity=lambda a: a.gravity * mass(a)),
        {"gravity": [0.39, -1.04, 0.26]},
        ["gravity, an acceleration, is multiplied by the mass"],
    ),
    "no gravity": (
        args(gravity=lambda a: 0.0 * a.gravity),
        {"gravity": [0.0, 0.0, 0.0]},
        ["gravity is left out"],
    ),
    "gravity upside down": (
        args(gravity=lambda a: -a.gravity),
        {"gravity": [-0.3, 0.8, -0.2]},
        ["gravity has the wrong sign"],
    ),
    "gravity of its own": (
        args(gravity=lambda a: np.array([0.0, -9.81, 0.0])),
        {"gravity": [0.0, -9.81, 0.0]},
        ["gravity is the same on every rope, whatever the problem says"],
    ),
    "no damping": (
        args(damping=lambda a: 0.0 * a.damping),
        {"damping": 0.0},
        ["damping is left out"],
    ),
    "damping not divided by the mass": (
        args(damping=lambda a: a.damping * mass(a)),
        {"damping": 0.585},
        ["the damping force is not divided by the mass"],
    ),
    "springs twice": (
        args(stiffness=lambda a: 2.0 * a.stiffness),
        {"stiffness": 7.4},
        ["each spring is counted twice"],
    ),
    "springs that push": (
        args(stiffness=lambda a: -a.stiffness),
        {"stiffness": -3.7},
        ["the springs push where they should pull"],
    ),
    "a stiffness that nobody knows": (
        args(stiffness=lambda a: 1.0371 * a.stiffness),
        {"stiffness": 3.83727},
        [],
    ),
    "no mass": (
        args(mass=lambda a: np.ones_like(a.mass)),
        {"mass": 1.0},
        ["the mass is left out"],
    ),
    "whole rest lengths": (
        args(rest_length=lambda a: np.trunc(a.rest_length)),
        {"rest_length": 0.0},
        ["rest lengths are truncated to integers"],
    ),
    "no rest lengths": (
        args(rest_length=lambda a: 0.0 * a.rest_length),
        {"rest_length": 0.0},
        ["rest lengths are left out"],
    ),
    "no initial velocity": (
        lambda y0, args: (y0 * np.array([1.0, 0.0])[:, None, None], args),
        {"velocity": 0.0},
        ["the initial velocity is left out"],
    ),
    "two at once": (
        args(damping=lambda a: 0.0 * a.damping, gravity=lambda a: 0.7 * a.gravity),
        {"gravity": [0.21, -0.56, 0.14], "damping": 0.0},
        ["damping is left out"],
    ),
}


# One number, a component of several, a factor, and two numbers; the others are slow tests.
FAST = ("gravity of its own", "whole rest lengths", "no initial velocity", "two at once")


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[] if name in FAST else pytest.mark.slow) for name in CASES],
)
def test_the_rope_that_is_solved_is_named(name):
    change, expected, hints = CASES[name]
    found = diagnose_parameters(WithOther("semi-implicit-euler", change))
    assert not isinstance(found, bool), "no diagnosis"
    numbers = found.evidence["parameters"]
    assert {each: number["found"] for each, number in numbers.items()} == {
        each: pytest.approx(value, rel=1e-5, abs=1e-12) for each, value in expected.items()
    }
    assert found.evidence["hints"] == hints
    assert found.line.startswith("your stepper solves, to order 1, the rope with ")
    for order in found.evidence["orders"].values():
        assert order["verdict"] == "converges"


@pytest.mark.parametrize("seed", [4, *(pytest.param(s, marks=pytest.mark.slow) for s in range(4))])
def test_numbers_are_right_to_their_spread(seed):
    """Changes drawn at random, of one to three parameters."""
    draw = np.random.default_rng(seed)
    problem = uniform_rope()
    names = draw.choice(
        ["damping", "stiffness", "rest_length", "gravity"], draw.integers(1, 4), replace=False
    )
    factor = {name: float(draw.uniform(0.5, 1.6)) for name in names}
    change = args(
        **{name: lambda a, name=name, by=by: by * getattr(a, name) for name, by in factor.items()}
    )
    runs = runs_of(WithOther("rk4", change), problem)
    limit = observe_limit(problem, runs, problem.quantities)
    assert limit is not None
    # Damping and stiffness together have the same effect as a mass and one of them.
    fit = next(each for each in smallest_fits(limit) if {*each.names} == {*names})
    for number in numbers_of(problem, fit):
        off = np.abs(number.fitted - factor[number.name] * number.claimed)
        assert np.all(off <= number.spread)
        assert np.all(number.spread < 1e-6)


def test_ropes_that_move_the_same_are_named_together():
    """Masses of 1 and no damping: the same motion as with other stiffness and no damping."""
    change = args(mass=lambda a: np.ones_like(a.mass), damping=lambda a: 0.0 * a.damping)
    found = diagnose_parameters(WithOther("rk4", change))
    assert not isinstance(found, bool)
    both = [found.evidence["parameters"], *found.evidence["alternatives"]]
    assert [sorted(each) for each in both] == [["damping", "stiffness"], ["damping", "mass"]]
    assert both[0]["stiffness"]["found"] == pytest.approx(3.7 * 1.3)
    assert both[1]["mass"]["found"] == 1.0
    assert "which moves exactly the same" in found.line


@pytest.mark.parametrize(
    "stepper",
    [
        "rk4",
        pytest.param("semi-implicit-euler", marks=pytest.mark.slow),
        pytest.param("explicit-euler", marks=pytest.mark.slow),
    ],
)
def test_a_right_stepper_solves_the_right_rope(stepper):
    own = WithOther(stepper, lambda y0, args: (y0, args))
    assert diagnose_parameters(own) is True
    assert diagnose_heterogeneity(own) is None


def test_one_mass_for_all_shows_where_masses_differ():
    own = WithOther("rk4", args(mass=lambda a: np.full_like(a.mass, a.mass[0])))
    assert diagnose_parameters(own) is True
    found = diagnose_heterogeneity(own)
    assert found is not None
    right = {"mass": False, "damping": True, "stiffness": True, "rest_length": True}
    assert found.evidence["right"] == right


@pytest.mark.parametrize(
    "change",
    {
        # Springs along the rope that are none of the problem's.
        "one stiffness": args(stiffness=lambda a: a.stiffness * np.array([2.0, 1.0, 1.0, 1.0])),
        "one mass": args(mass=lambda a: a.mass * np.array([1.0, 1.0, 3.0, 1.0, 1.0])),
        "a node let go": args(free=lambda a: np.ones_like(a.free)),
        "a drive": args(
            drive=lambda a: np.array([0.5, 0.0, 0.0]), frequency=lambda a: np.asarray(2.0)
        ),
        "another start": lambda y0, args: (
            y0 + 0.01 * np.sin(np.arange(30.0)).reshape(2, 5, 3),
            args,
        ),
    }.values(),
)
def test_other_changes_are_not_taken_for_parameters(change):
    assert diagnose_parameters(WithOther("rk4", change)) is False


def test_a_rope_that_freezes_is_not_one_without_forces():
    class Frozen(WithOther):
        def run(self, problem, steps_per_frame):
            return np.broadcast_to(problem.y0, (len(problem.ts), *problem.y0.shape)).copy()

    assert diagnose_parameters(Frozen("rk4", lambda y0, args: (y0, args))) is False


def test_one_rope_is_not_enough():
    """Numbers fitted on one rope must give the limit on another."""
    change = args(damping=lambda a: 0.0 * a.damping)

    class Elsewhere(WithOther):
        """Forgets the damping on the first rope only."""

        def run(self, problem, steps_per_frame):
            if np.array_equal(problem.y0, uniform_rope().y0):
                return super().run(problem, steps_per_frame)
            return Examination.run(self, problem, steps_per_frame)

    assert diagnose_parameters(Elsewhere("rk4", change)) is False
