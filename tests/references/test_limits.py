"""How long a reference may take, where it ends then, and problems that no time suffices for."""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import InputError, Problem, ReferenceRefused, reference
from ropeode.references import (
    DOPRI8,
    OWN_DOP853,
    RADAU9,
    SCIPY_BDF,
    SCIPY_RADAU,
    remarks,
    solve,
)
from ropeode.render import describe_reference
from tests.references.covered import assert_covered
from tests.references.scalar_problems import scalar

TS = np.linspace(0.0, 2.5, 6)
EPS64 = np.finfo(np.float64).eps


def said_by(problem, **options):
    """What is reported of the runs of a reference, and the reference, if there is one."""
    said = []
    try:
        known = reference(problem, progress=lambda text, fraction: said.append(text), **options)
    except ReferenceRefused as refusal:
        return said, refusal
    return said, known


def steps_of(known):
    """The steps of all its runs that arrived."""
    return known.certificate.steps + sum(each.steps for each in known.certificate.witnesses)


def test_a_tank_that_runs_empty_is_known_to_the_end():
    """A Taylor series goes on beyond the end of the root, where the level would rise again."""
    known = reference(scalar("tank", 1.0, TS, -1.1))
    assert known.horizon is None
    assert_covered(known, np.maximum(1.0 - 0.55 * TS, 0.0) ** 2)


def test_a_pole_ends_the_horizon_after_few_steps():
    pole = 1 / 1.1
    known = reference(scalar("square", 1.0, TS, 1.1))
    assert known.trusted == np.sum(pole > TS)
    assert known.horizon == TS[known.trusted]
    assert "step size has become too small" in known.certificate.horizon_reason
    assert f"t = {pole:g}" in known.certificate.horizon_reason
    assert steps_of(known) < 20_000
    assert_covered(known, 1 / (1 - 1.1 * TS))


def test_what_has_no_solution_is_refused_soon():
    """A solver that is stuck uses up its steps, and nobody tries all tolerances with it."""
    said, refusal = said_by(scalar("square", 4.0, TS))
    assert "for 'square': " in str(refusal)
    assert "t = 0.25: the step size has become too small" in str(refusal)
    assert len(said) == 1
    said, refusal = said_by(scalar("root", 0.0, TS))
    assert "no reference for 'root'" in str(refusal)
    assert len(said) <= 13


@pytest.mark.slow
def test_where_it_chatters_no_run_but_the_first_tries_to_go_on():
    """y' = -sign(y) comes to zero at 1.6, and jumps back and forth from then on."""
    said, known = said_by(Problem(lambda t, y, args: -jnp.sign(y), [1.6], TS))
    assert known.trusted == np.sum(TS < 1.6)
    # Twice the explicit solver, the implicit one, and then only up to the last sample.
    assert len(said) <= 16
    assert steps_of(known) < 200_000


def test_a_run_stops_when_its_time_is_up_and_else_the_limit_changes_nothing():
    problem = scalar("follows", 0.0, np.linspace(0.0, 1e8, 6), 0.0)
    said, refusal = said_by(problem, time_limit=0.3)
    # It is told before it is spent.
    assert len(said) <= 3
    assert "time limit is 0.3 s. Allow more time (time_limit)" in str(refusal)
    for solver in (DOPRI8, RADAU9, OWN_DOP853):
        run = solve(problem, solver, 1e-8, 1e-8, max_steps=10**8, seconds=0.05)
        assert run.ran_out
        assert run.failure.endswith("its time was up")
        assert run.seconds < 2.0
        assert run.reached < 1e8
    # In more than one call of a compiled program.
    short = scalar("follows", 0.0, np.linspace(0.0, 4e3, 6), 0.0)
    for solver in (DOPRI8, OWN_DOP853):
        free = solve(short, solver, 1e-8, 1e-8, max_steps=10**5)
        limited = solve(short, solver, 1e-8, 1e-8, max_steps=10**5, seconds=100.0)
        assert limited.steps == free.steps > 4096
        assert limited.states.tobytes() == free.states.tobytes()
        np.testing.assert_allclose(free.states[:, 0], np.sin(short.ts), atol=1e-4)


def test_samples_in_coarse_times_are_remarked():
    for ts, words in (
        (1e6 + np.linspace(0.0, 1e3, 6), []),
        ([0.0, 1e-9, 1.0, 1e4, 1e8, 1e11], []),
        (1e9 + 1e-3 * np.arange(6), ["let t start at 0"]),
        ([0.0, 1.0, 2.0, 3.0, 1e11, 1e11 + 1.0], ["samples that are further apart"]),
    ):
        said = remarks(reference(scalar("decay", 1.0, np.array(ts), min(1.0, 1.0 / np.ptp(ts)))))
        assert all(word in remark for word, remark in zip(words, said, strict=True))
    problem = scalar("follows", 0.0, 1e9 + np.linspace(0.0, 1e-3, 6), -1e5)
    with pytest.raises(ReferenceRefused, match="1.2e-07 apart.*let t start at 0") as refused:
        reference(problem, accuracy=1e-12)
    assert str(refused.value).count("apart") == 1


def decays(t, y, args):
    return -jnp.array([1.0, 0.01]) * y


@pytest.mark.slow
def test_components_of_different_size_are_named():
    for y0, atol, told in (
        ([1e3, 1e-6], None, True),
        ([1e3, 1.0], None, False),
        ([1e3, 1e-6], [1e-10, 1e-19], False),
        ([1e3, 0.0], None, False),
    ):
        _, refusal = said_by(Problem(decays, y0, [0.0, 1.0, 2.0]), accuracy=1e-30, atol=atol)
        assert ("from 1.0e-06 to 1.0e+03" in str(refusal)) == told
    # A component may be lost under the bound, too.
    (remark,) = remarks(reference(Problem(decays, [1.0, 1.0], [0.0, 20.0, 30.0])))
    assert "number 0 (" in remark
    assert "number 1 (" not in remark
    assert "atol" in remark


def test_each_component_may_have_its_tolerance():
    problem = scalar("decay", 1.0, np.linspace(0.0, 50.0, 6))
    default = reference(problem, rtol=1e-8)
    assert default.certificate.atol == 1e-8
    known = reference(problem, rtol=1e-8, atol=[1e-40])
    np.testing.assert_array_equal(known.certificate.atol, [1e-40])
    exact = np.exp(-problem.ts)
    np.testing.assert_allclose(known.states[:, 0], exact, rtol=1e-6)
    assert abs(default.states[-1, 0] - exact[-1]) > exact[-1]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"accuracy": 0}, "accuracy: 0 given; allowed: a finite number > 0"),
        ({"rtol": 1e-15}, "rtol: 1e-15 given; allowed: from 1e-13"),
        ({"atol": np.inf}, "atol: inf given; .* Fix: for example 1e-20"),
        ({"atol": {"x": 1.0}}, "atol: {'x': 1.0} given; .* one number for each component"),
        ({"atol": [1e-8, 0.0]}, "atol: .*finite numbers > 0"),
        ({"atol": [1e-8, 1e-9]}, "atol.*one number, or an array of the state's shape"),
        ({"atol": 1e300}, r"atol: 1e\+300 given; .* finite when divided by rtol"),
        ({"level": "exact"}, "level: 'exact' given"),
        ({"level": "extended", "rtol": 1e-9}, "rtol: .* none with level 'extended'"),
        ({"level": "extended", "atol": 1e-20}, "atol: .* none with level 'extended'"),
        ({"level": "extended", "digits": 301}, "digits: 301 given; .* whole number from 1 to 300"),
    ],
)
def test_what_cannot_be_used_is_refused(options, words):
    with pytest.raises(InputError, match=words):
        reference(scalar("decay", 1.0, TS), **options)


def test_a_bound_larger_than_the_motion_is_told():
    """A clock of 1.7e9 in the state, in frames of 2e-7."""
    problem = scalar("follows", 1.7e9, 2e-7 * np.arange(6), 0.0)
    known = reference(problem)
    assert known.bound()[-1] > 1.2e-6
    (remark,) = remarks(known)
    assert "the solution moves by" in remark
    assert remark in " ".join(describe_reference(known).split())
    with pytest.raises(ReferenceRefused, match="which is not resolved by a bound of"):
        reference(problem, accuracy=1e-8)
    # Nothing of longer frames, and of what rests.
    assert remarks(reference(scalar("follows", 1.7e9, TS, 0.0))) == ()
    assert remarks(reference(scalar("decay", 0.0, TS))) == ()


SMALLEST_LARGE = 301


def diffusion():
    def rhs(t, y, args):
        wide = jnp.pad(y, 1)
        return (wide[2:] - 2 * y + wide[:-2]) * (SMALLEST_LARGE + 1) ** 2

    x = np.linspace(0.0, 1.0, SMALLEST_LARGE + 2)[1:-1]
    return Problem(rhs, np.sin(np.pi * x), [0.0, 1.0])


@pytest.mark.slow
def test_a_sparse_jacobian():
    known = reference(diffusion())
    assert (known.certificate.solver, known.certificate.stiff) == (SCIPY_BDF, True)
    assert known.horizon is None
    # The first mode of the discrete equation decays, and keeps its shape.
    rate = (2 * (SMALLEST_LARGE + 1) * np.sin(np.pi / 2 / (SMALLEST_LARGE + 1))) ** 2
    exact = np.exp(-rate * known.problem.ts)[:, None] * known.problem.y0
    assert_covered(known, exact)
    # Steps that are not compensated lose a unit of rounding each.
    assert known.bound()[-1] >= 4 * known.certificate.steps * EPS64
    coupled = known.problem.changed(
        rhs=lambda t, y, args: known.problem.rhs(t, y, args) - jnp.mean(y)
    )
    with pytest.raises(ReferenceRefused, match="only where the right-hand side is in JAX"):
        reference(coupled, time_limit=1e-3)
    for each in known.certificate.witnesses:
        assert each.solver == (SCIPY_RADAU if each.role == "independent" else SCIPY_BDF)
    rounding = [w.difference for w in known.certificate.witnesses if w.role == "rounding"]
    assert 0.0 < rounding[0] < known.bound()[-1]


@pytest.mark.slow
def test_what_is_large_for_a_moment_only_needs_no_tolerance_of_its_own():
    """The velocity is, between the samples. The end is that of runs with another scale."""

    def van_der_pol(t, y, args):
        return jnp.stack([y[1], ((1.0 - y[0] ** 2) * y[1] - y[0]) / 1e-10])

    problem = Problem(van_der_pol, [2.0, 0.0], np.linspace(0.0, 2.0, 5))
    known, other = reference(problem), solve(problem, RADAU9, 1e-11, 1e-14)
    assert known.horizon is None
    assert np.max(np.abs(known.states[-1] - other.states[-1])) < known.bound()[-1]
    with pytest.raises(ReferenceRefused, match="atol="):
        reference(problem, accuracy=1e-15)
