"""The numbers that are found are those that were changed."""

import jax
import numpy as np
import pytest

from ropeode.checking.candidate import Candidate
from ropeode.checking.diagnosis.diagnostic_ropes import alike
from ropeode.checking.diagnosis.effective_problem import solved_instead
from ropeode.checking.diagnosis.fit import explanations, observed
from ropeode.checking.diagnosis.fitted_numbers import numbers_of
from ropeode.checking.diagnosis.heterogeneous_parameters import wrong_where_unlike
from ropeode.checking.diagnosis.runs import runs_of


@pytest.fixture(scope="module", autouse=True)
def _float64():
    with jax.enable_x64(True):
        yield


class WithOther(Candidate):
    """A right stepper that is handed other numbers: it solves the rope that these make."""

    def __init__(self, stepper, change):
        self.inner = STEPPERS.setdefault(stepper, Candidate.of(stepper))
        super().__init__(self.inner.method)
        self.change = change

    def run(self, problem, steps_per_frame):
        y0, args = self.change(problem.y0, problem.args)
        return self.inner.run(problem.changed(y0=y0, args=args), steps_per_frame)


STEPPERS: dict[str, Candidate] = {}


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
        ["gravity is the same whatever it should be"],
    ),
    "no damping": (
        args(damping=lambda a: 0.0 * a.damping),
        {"damping": 0.0},
        ["the damping is left out"],
    ),
    "damping not divided by the mass": (
        args(damping=lambda a: a.damping * mass(a)),
        {"damping": 0.585},
        ["the damping force is not divided by the mass"],
    ),
    "springs twice": (
        args(stiffness=lambda a: 2.0 * a.stiffness),
        {"stiffness": 7.4},
        ["each spring counts twice"],
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
        ["rest lengths are cut to whole numbers"],
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
        ["the damping is left out"],
    ),
}


@pytest.mark.parametrize("name", CASES)
def test_the_rope_that_is_solved_is_named(name):
    change, expected, hints = CASES[name]
    found = solved_instead(WithOther("semi-implicit-euler", change))
    assert not isinstance(found, bool), "nothing was found"
    numbers = found.evidence["parameters"]
    assert {each: number["found"] for each, number in numbers.items()} == {
        each: pytest.approx(value, rel=1e-5, abs=1e-12) for each, value in expected.items()
    }
    assert found.evidence["hints"] == hints
    assert found.line.startswith("your stepper solves, to order 1, the rope with ")
    for order in found.evidence["orders"].values():
        assert order["verdict"] == "converges"


def test_numbers_are_right_to_their_spread():
    """Changes drawn at random, of one to three parameters."""
    draw = np.random.default_rng(8)
    problem = alike()
    for _ in range(3):
        names = draw.choice(
            ["damping", "stiffness", "rest_length", "gravity"], draw.integers(1, 4), replace=False
        )
        factor = {name: float(draw.uniform(0.5, 1.6)) for name in names}
        change = args(
            **{
                name: lambda a, name=name, by=by: by * getattr(a, name)
                for name, by in factor.items()
            }
        )
        seen = observed(problem, runs_of(WithOther("rk4", change), problem), problem.quantities)
        assert seen is not None
        # Damping and stiffness together can be told as a mass and one of them.
        found = next(each for each in explanations(seen) if {*each.names} == {*names})
        for number in numbers_of(problem, found):
            off = np.abs(number.found - factor[number.name] * number.claimed)
            assert np.all(off <= number.spread)
            assert np.all(number.spread < 1e-6)


def test_what_cannot_be_told_apart_is_told_together():
    """Masses of 1 and no damping: the same motion as with other stiffness and no damping."""
    change = args(mass=lambda a: np.ones_like(a.mass), damping=lambda a: 0.0 * a.damping)
    found = solved_instead(WithOther("rk4", change))
    assert not isinstance(found, bool)
    both = [found.evidence["parameters"], *found.evidence["alternatives"]]
    assert [sorted(each) for each in both] == [["damping", "stiffness"], ["damping", "mass"]]
    assert both[0]["stiffness"]["found"] == pytest.approx(3.7 * 1.3)
    assert both[1]["mass"]["found"] == 1.0
    assert "which no run can tell apart" in found.line


@pytest.mark.parametrize("stepper", ["semi-implicit-euler", "rk4", "explicit-euler"])
def test_a_right_stepper_solves_what_it_was_given(stepper):
    own = WithOther(stepper, lambda y0, args: (y0, args))
    assert solved_instead(own) is True
    assert wrong_where_unlike(own) is None


def test_one_mass_for_all_shows_where_masses_differ():
    own = WithOther("rk4", args(mass=lambda a: np.full_like(a.mass, a.mass[0])))
    assert solved_instead(own) is True
    found = wrong_where_unlike(own)
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
def test_what_is_no_change_of_a_number_is_not_called_one(change):
    assert solved_instead(WithOther("rk4", change)) is False


def test_a_rope_that_freezes_is_not_one_without_forces():
    class Frozen(WithOther):
        def run(self, problem, steps_per_frame):
            return np.broadcast_to(problem.y0, (len(problem.ts), *problem.y0.shape)).copy()

    assert solved_instead(Frozen("rk4", lambda y0, args: (y0, args))) is False


def test_one_rope_is_not_enough():
    """Numbers fitted on one rope must give the limit on another."""
    change = args(damping=lambda a: 0.0 * a.damping)

    class Elsewhere(WithOther):
        """Forgets the damping on the first rope only."""

        def run(self, problem, steps_per_frame):
            if np.array_equal(problem.y0, alike().y0):
                return super().run(problem, steps_per_frame)
            return self.inner.run(problem, steps_per_frame)

    assert solved_instead(Elsewhere("rk4", change)) is False
