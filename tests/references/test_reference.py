"""References and their certificates."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from typing import get_args

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import each_reference, reference
from ropeode.errors import InputError, ReferenceRefused
from ropeode.norms import NORMS, distance
from ropeode.problems import PROBLEMS, Ensemble, InextensibleRope, Problem, Rope
from ropeode.references import (
    DOPRI8,
    RADAU9,
    SCIPY_DOP853,
    SCIPY_RADAU,
    Role,
    largest_norms,
    load_reference,
    save_reference,
)
from ropeode.references.extended.taylor import solve as solve_in_extended_precision
from tests.problems.exact import EXACT
from tests.references.covered import assert_covered, covered, reference_and
from tests.references.scalar_problems import scalar
from tests.sampled import sampled
from tests.verification.extrapolation import EPS, rope_solution

EPS64 = np.finfo(np.float64).eps
TS = np.linspace(0.0, 2.5, 6)


@pytest.mark.parametrize("name", sampled(EXACT, fast=("kepler",)))
@pytest.mark.parametrize("rtol", [None, 1e-6, pytest.param(1e-9, marks=pytest.mark.slow)])
def test_bound_covers_the_true_error(name, rtol):
    problem = PROBLEMS[name](frames=4)
    known = reference(problem, rtol=rtol)
    assert_covered(known, problem.exact(problem.ts))
    for bound in known.certificate.bounds.values():
        assert bound[-1] < 1e6 * (rtol or 1e-13) * problem.scale
    if rtol is None:
        assert_rounding_widens_nothing(known)


def assert_rounding_widens_nothing(known):
    """What runs with moved roundings differ by is little more than what others differ by."""
    assert known.horizon is None
    for quantity in largest_norms(known.problem):
        seen = {role: [0.0] for role in get_args(Role)}
        for witness in known.certificate.witnesses:
            seen[witness.role].append(np.max(witness.differences[quantity]))
        others = max(max(seen[role]) for role in seen if role not in ("rounding", "looser"))
        assert max(seen["rounding"]) <= 2 * max(others, 4 * EPS64 * np.max(np.abs(known.states)))
        assert len(seen["rounding"]) == 3


@pytest.mark.slow
def test_frames_of_very_unequal_length_hide_nothing():
    """The first frames are one step at each tolerance; only shorter steps show their error."""
    pytest.importorskip("heyoka")
    problem = PROBLEMS["robertson"](frames=5, duration=0.6282221521958087)
    known = reference(problem, rtol=4.53575088727013e-08)
    truth = solve_in_extended_precision(problem, precision=80).rounded
    assert_covered(known, truth)
    true = np.max(np.abs(known.states - truth), axis=1)
    tighter = next(w for w in known.certificate.witnesses if w.role == "tighter")
    assert tighter.differences["state"][1] < true[1] / 10


def test_everything_is_recorded(small_rope):
    said, parts = [], []

    def progress(text, fraction):
        said.append(text)
        parts.append(fraction)

    known = reference(small_rope, progress=progress)
    made = known.certificate
    assert (made.level, made.solver) == ("consensus", DOPRI8)
    assert (made.rtol, made.atol) == (1e-13, 1e-13 * 400)
    # A run with more digits is there where heyoka is.
    expected = set(get_args(Role)) - {"close look", "more digits", "fewer digits"}
    assert {w.role for w in made.witnesses} - {"more digits"} == expected
    assert independent(known) == [SCIPY_DOP853]
    assert all(w.difference == np.max(w.differences["position"]) for w in made.witnesses)
    assert (made.trusted, made.horizon, made.horizon_reason, made.drift) == (4, None, None, {})
    assert made.versions["diffrax"]
    assert "Dopri8" in said[0]
    assert "between the steps" in said[-1]
    assert parts[-1] == 1.0
    assert_rounding_widens_nothing(known)
    # A tolerance of one's own is held against tighter ones.
    known = reference(small_rope, rtol=1e-9)
    tighter = sorted(w.tolerance for w in known.certificate.witnesses if w.role == "tighter")
    assert tighter == pytest.approx([1e-11, 1e-10])


def test_instability_ends_the_horizon():
    """Errors grow by exp(4 t), from rounding to the accuracy within 4 or 5."""
    problem = scalar("follows", 0.0, np.arange(0.0, 12.0, 2.0), 4.0)
    known = reference(problem)
    assert known.horizon in (4.0, 6.0)
    assert_covered(known, np.sin(problem.ts))
    assert "bound exceeds the accuracy" in known.certificate.horizon_reason
    assert len(known.bound()) == known.trusted
    bound = known.certificate.bounds["state"][2]
    for accuracy, trusted in ((0.9 * bound, 2), (1.1 * bound, 3)):
        assert reference(problem, accuracy=accuracy).trusted == trusted


def independent(known):
    return [w.solver for w in known.certificate.witnesses if w.role == "independent"]


def test_stiff_problems_get_implicit_solvers():
    problem = scalar("follows", 0.0, np.linspace(0.0, 3.0, 6), -1e6)
    known = reference(problem)
    assert known.certificate.stiff
    assert (known.certificate.solver, independent(known)) == (RADAU9, [SCIPY_RADAU])
    assert_covered(known, np.sin(problem.ts))
    assert known.bound()[-1] < 1e-9
    # A stiff spring keeps the explicit solver.
    swings = reference(Rope(num_nodes=4, stiffness=1e5).problem(frames=1), rtol=1e-8)
    assert (swings.certificate.stiff, swings.horizon) == (False, None)


@pytest.mark.slow
def test_the_bound_covers_noise_in_the_right_hand_side():
    """Of 6e-8 at most."""
    problem = scalar("24 bits", 1.0, np.linspace(0, 0.5, 6), 1.1)
    known = reference(problem, rtol=1e-6, accuracy=1e-4)
    assert known.horizon is None
    assert_covered(known, np.exp(-1.1 * problem.ts))
    assert known.bound()[-1] < 1e-6


PULSES = itertools.product((3e-2, 1e-2, 3e-3, 1e-3), (None, 1e-3, 1e-5, 1e-7))
FAST = (3e-2, None), (1e-2, 1e-5), (3e-3, 1e-5), (1e-3, None)


@pytest.mark.parametrize("pulse", sampled(PULSES, fast=FAST))
def test_what_most_runs_step_over_is_not_trusted(pulse):
    """A pulse at t = 3.3, between samples, that nothing announces.

    Some rungs of the ladder see it, others do not, and some none at all: then the run with short
    steps does.
    """
    width, rtol = pulse
    problem = scalar("pulse", 0.0, np.arange(6.0), width)
    step = 0.5 * width * np.sqrt(np.pi) * np.exp(width**2 / 4)
    after = np.where(problem.ts > 3.3, step * np.exp(3.3 - problem.ts), 0.0)
    covered(problem, 1 - np.exp(-problem.ts) + after, rtol=rtol, accuracy=1e-2)


def test_a_neighbour_moves_what_rests_but_nothing_that_is_held():
    """By a unit of rounding of the largest position or velocity on the way."""
    rope = Rope(num_nodes=4, initial_velocity=(1, 0)).problem(3)
    known, (run,) = reference_and(rope, "neighbour")
    moved, rests = run.states[0] - rope.y0, rope.y0 == 0
    # The first node is pinned.
    rests[:, :, 0] = False
    assert np.any(rests)
    np.testing.assert_array_equal(moved != 0, rests | (rope.y0 != 0))
    largest = np.max(np.abs(known.states), axis=(0, 2, 3))
    for half, moves, size in zip(moved, rests, largest, strict=True):
        np.testing.assert_allclose(half[moves], EPS64 * size, rtol=1e-3)


def test_a_neighbour_moves_zeros_less_where_it_cannot_begin():
    """The gas sphere of Lane and Emden for n = 5: it divides by the time, but not at the start."""

    def rhs(t, y, args):
        return jnp.array([y[1], jnp.where(t > 0, -(y[0] ** 5) - 2 * y[1] / t, -1 / 3)])

    ts = np.linspace(0.0, 5.0, 11)
    sphere = reference(Problem(rhs, [1.0, 0.0], ts))
    assert sphere.trusted == len(ts)
    assert np.all(np.abs(sphere.states[:, 0] - (1 + ts**2 / 3) ** -0.5) <= sphere.bound())
    # One that leaves an unstable balance, and has too few steps for what follows, has begun.
    upright = Problem(lambda t, y, args: jnp.stack([y[1], 1e6 * jnp.sin(y[0])]), [0.0, 0.0], ts)
    with pytest.raises(ReferenceRefused, match="steps did not suffice"):
        reference(upright)


@pytest.mark.parametrize("rope", [{"pinned": (0, 1, 2, 3)}, {"gravity": (0, 0)}])
def test_what_stands_still_has_a_reference(rope):
    known = reference(Rope(num_nodes=4, **rope).problem(frames=3))
    assert known.horizon is None
    assert np.max(np.abs(known.states - known.states[0])) < 1e-9


MOVING = [(0.5, 1), (0.5, 0), (0.5, -0.5), (0.5, 2)]
INEXTENSIBLE = {
    "neighbours pinned in space": {"start": (0, 0, 1), "end": (3, -1, 0.5), "pinned": (1, 2)},
    "no pins, moving": {"start": (5, 5), "end": (9, 5), "pinned": (), "initial_velocity": MOVING},
}


@pytest.mark.parametrize("name", sampled(INEXTENSIBLE, fast=("no pins, moving",)))
def test_links_and_truth_are_off_by_less_than_the_bound(name):
    """Of an inextensible rope; its drift is how far its links are off."""
    rope = InextensibleRope(**INEXTENSIBLE[name], num_nodes=4, node_mass=(1, 2, 0.5, 1.5))
    problem = rope.problem(frames=3)
    known = reference(problem, rtol=1e-6)
    assert known.horizon is None
    if EPS < 2e-19:
        # Where np.longdouble is wider than float64.
        assert_covered(known, rope_solution(problem))
    drift = known.certificate.drift
    assert set(drift) == {"position", "velocity"}
    for quantity, found in drift.items():
        assert np.all(known.certificate.bounds[quantity] >= 3 * found)
    lengths = np.linalg.norm(np.diff(known.positions, axis=1), axis=-1)
    off = np.max(np.abs(lengths - lengths[0]), axis=1)
    np.testing.assert_allclose(drift["position"], off, rtol=1e-9, atol=8 * EPS64 * problem.scale)
    # At 1e-6 the lengths of what moves a lot are visibly lost, far above rounding.
    assert "moving" not in name or np.max(off) > 1e-10


def test_a_constraint_that_does_not_hold_makes_the_bound_large():
    """Solvers that agree on a wrong right-hand side are found out by its constraints."""
    free = Rope(num_nodes=4, pinned=(), damping=0.0).problem(3)

    def hangs(t, y, args):
        # Nothing in the right-hand side holds the first node.
        return {"position": y[0, 1, 0] - 200.0}

    fallen = free.ts**2 / 2
    known = reference(free)
    np.testing.assert_allclose(known.positions[:, 0, 1], 200.0 - fallen, rtol=1e-14)
    assert known.bound()[-1] < 1e-9
    held = dataclasses.replace(free, constraints=hangs)
    with pytest.raises(ReferenceRefused, match="no reference for 'rope': .* bound exceeds"):
        reference(held)
    lenient = reference(held, accuracy=100.0).certificate
    np.testing.assert_allclose(lenient.drift["position"], fallen, atol=1e-9)
    np.testing.assert_allclose(lenient.bounds["position"], 3 * fallen, atol=3e-9)
    # What is not constrained is no worse for it.
    assert lenient.bounds["velocity"][-1] < 1e-7


# Of many problems at a time: what each gets alone, whoever stands beside it.


def grows(rate, y0=1.0):
    """``y' = a sqrt(|y|)``, with ``y = (sqrt(y0) + a t / 2)^2``; from 0 it is not unique."""
    return scalar("root", y0, TS, rate)


def exact(problem):
    return (np.sqrt(problem.y0[0]) + problem.args[1] * problem.ts / 2) ** 2


def series(known):
    return {
        (w.role, w.tolerance): w.differences["state"].tobytes() for w in known.certificate.witnesses
    }


def test_a_member_has_the_states_that_it_has_alone():
    many = Ensemble.of([grows(0.7), grows(-0.6), grows(0.5, y0=0.0)])
    *known, refused = reference(many)
    with pytest.raises(ReferenceRefused) as alone:
        reference(many[2])
    assert str(refused) == str(alone.value)
    # Whoever stands beside it, and however many threads there are.
    others = list(each_reference(Ensemble.of(list(many)[1::-1]), workers=2))[::-1]
    for problem, member, again in zip(many, known, others, strict=False):
        alone = reference(problem)
        assert member.problem is problem
        assert member.states.tobytes() == alone.states.tobytes() == again.states.tobytes()
        differing = set(series(member).items()) ^ set(series(alone).items())
        assert {role for (role, _), _ in differing} <= {"independent", "more digits"}
        assert series(member) == series(again)
        assert member.bound().tobytes() == again.bound().tobytes()
        assert_covered(member, exact(problem)[:, None])


def test_a_jump_is_left_to_the_solver_that_stops_there():
    jumps = [scalar("turns", y0, TS, 1.3, jump_times=[1.3]) for y0 in (1.0, 2.0)]
    for member in reference(Ensemble.of(jumps)):
        assert independent(member) == [SCIPY_DOP853]
        assert_covered(member, member.problem.y0[0] * np.exp(np.minimum(TS, 2.6 - TS)))


@pytest.mark.parametrize("name", ["rtol", "workers"])
def test_wrong_arguments_are_refused_before_anything_is_solved(name):
    with pytest.raises(InputError, match=name):
        each_reference(Ensemble.of([grows(0.7)]), **{name: 0})


# Between the samples.

SWING = PROBLEMS["oscillator"](frames=4)


def turned(ts):
    return np.where(ts < 1.3, np.exp(ts), np.exp(2.6 - ts))[:, None]


@functools.cache
def between(name):
    """Of y' = y, and -y from t = 1.3 on, which has a corner there; and of an oscillator."""
    if name == "a corner":
        corner = Problem(lambda t, y, args: jnp.where(t < 1.3, y, -y), [1.0], TS, jump_times=[1.3])
        return reference(corner.changed(exact=turned))
    if name == "more digits":
        pytest.importorskip("heyoka", reason="heyoka is an extra")
        return reference(SWING, level="extended", time_limit=1e9)
    return reference(SWING)


@pytest.mark.parametrize(
    "name", sampled(("an oscillator", "more digits", "a corner"), ("more digits", "a corner"))
)
def test_bound_covers_the_true_error_between_the_samples(name, tmp_path):
    """Where all times are samples, it is their states to the last bit; so in a file."""
    known = between(name)
    at = [*known.times, np.nextafter(1.3, 0), 1.3, np.nextafter(1.3, 2)]
    times = np.append(at, np.random.default_rng(7).uniform(0.0, known.times[-1], 40))
    problem, states = known.problem.changed(ts=times), known.at(times)
    for quantity, norm in largest_norms(problem).items():
        true = distance(problem, norm, states, problem.exact(times))
        bounds, at_samples = known.bound_at(times, norm), known.certificate.bounds[quantity]
        assert np.all(true <= bounds)
        assert np.max(bounds) <= 3.0 * at_samples[-1]
    np.testing.assert_array_equal(known.at(known.times[[2, 0, 3, 1]]), known.states[[2, 0, 3, 1]])
    np.testing.assert_array_equal(known.bound_at(known.times), known.bound())
    found = load_reference(save_reference(known, tmp_path / "x.nc"), known.problem)
    np.testing.assert_array_equal(found.at(times), states)
    assert known.at(0.7).shape == known.problem.y0.shape


@pytest.mark.parametrize(
    ("times", "words"),
    [
        (2.6, "times: 2.6 given; allowed: a number, or a list of numbers, from 0 to 2.5"),
        ([0.1, np.nan], "times: "),
        ([[0.1]], r"times: \(1, 1\) given"),
    ],
)
def test_times_that_are_not_covered(times, words):
    for ask in (between("a corner").at, between("a corner").bound_at):
        with pytest.raises(InputError, match=words):
            ask(times)


def test_states_between_the_samples_end_with_the_horizon():
    problem = PROBLEMS["oscillator"](frames=4, damping=0.0)
    accuracy = float(reference(problem, rtol=1e-9, accuracy=1.0).bound()[2]) * 1.2
    known = reference(problem, rtol=1e-9, accuracy=accuracy)
    assert known.bound_at(known.horizon - 1.5, NORMS["position-max"]) <= accuracy
    with pytest.raises(InputError, match="the reference is trusted"):
        known.at(known.horizon)
