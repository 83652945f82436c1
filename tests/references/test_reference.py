"""References and their certificates."""

from __future__ import annotations

import dataclasses
from typing import get_args

import numpy as np
import pytest

from ropeode import reference
from ropeode.errors import InputError, ReferenceRefused
from ropeode.norms import distance, norm_for
from ropeode.problems import PROBLEMS, InextensibleRope, Problem, Rope
from ropeode.references import (
    DOPRI8,
    KVAERNO5,
    SCIPY_DOP853,
    SCIPY_RADAU,
    Role,
    largest_norms,
    witness_runs,
)
from ropeode.references.extended.taylor import solve as solve_in_extended_precision
from tests.problems.exact import EXACT
from tests.references.scalar_problems import scalar
from tests.verification.extrapolation import EPS, inextensible_rope_solution

EPS64 = np.finfo(np.float64).eps


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=() if name in ("oscillator", "kepler") else pytest.mark.slow)
        for name in EXACT
    ],
)
@pytest.mark.parametrize("rtol", [None, 1e-6, 1e-9])
def test_bound_covers_the_true_error(name, rtol):
    problem = PROBLEMS[name](frames=4)
    known = reference(problem, rtol=rtol)
    exact = problem.exact(problem.ts)
    for quantity, norm in largest_norms(problem).items():
        true = distance(problem, norm, known.states, exact)[: known.trusted]
        bound = known.certificate.bounds[quantity][: known.trusted]
        assert np.all(true <= bound)
        assert np.all(np.diff(bound) >= 0)
        assert bound[-1] < 1e6 * (rtol or 1e-13) * problem.scale


@pytest.mark.parametrize(
    "rtol", [4.53575088727013e-08, pytest.param(6.480345532035862e-08, marks=pytest.mark.slow)]
)
def test_frames_of_very_unequal_length_hide_nothing(rtol):
    """The first frames are one step at each tolerance; only shorter steps show their error."""
    pytest.importorskip("heyoka")
    problem = PROBLEMS["robertson"](frames=5, duration=0.6282221521958087)
    known = reference(problem, rtol=rtol)
    truth = solve_in_extended_precision(problem, precision=80).rounded
    true = np.max(np.abs(known.states - truth), axis=1)
    assert np.all(true <= known.bound())
    tighter = next(w for w in known.certificate.witnesses if w.role == "tighter")
    assert tighter.differences["state"][1] < true[1] / 10


def test_everything_is_recorded(small_rope):
    said, parts = [], []

    def progress(text, fraction):
        said.append(text)
        parts.append(fraction)

    known = reference(small_rope, progress=progress)
    made = known.certificate
    assert made.level == "consensus"
    assert made.solver == DOPRI8
    assert (made.rtol, made.atol) == (1e-13, 1e-13 * 400)
    # A run with more digits is there where heyoka is.
    expected = set(get_args(Role)) - {"close look", "more digits", "fewer digits"}
    assert {w.role for w in made.witnesses} - {"more digits"} == expected
    assert [w.solver for w in made.witnesses if w.role == "independent"] == [SCIPY_DOP853]
    for w in made.witnesses:
        assert w.steps > 0
        assert set(w.differences) == {"position", "velocity"}
        assert w.difference == np.max(w.differences["position"])
    assert made.horizon is None
    assert made.horizon_reason is None
    assert made.trusted == 4
    assert made.versions["diffrax"]
    assert any("Dopri8" in text for text in said)
    assert any("SciPy" in text for text in said)
    assert "between the steps" in said[-1]
    assert parts[-1] == 1.0


def test_asked_tolerance_is_used(small_rope):
    known = reference(small_rope, rtol=1e-9)
    assert known.certificate.rtol == 1e-9
    tighter = sorted(w.tolerance for w in known.certificate.witnesses if w.role == "tighter")
    assert tighter == pytest.approx([1e-11, 1e-10])
    assert known.bound()[-1] > reference(known.problem).bound()[-1]


def ends_with_the_accuracy(known):
    assert "bound exceeds the accuracy" in known.certificate.horizon_reason
    assert len(known.bound()) == known.trusted
    looser = reference(known.problem, accuracy=1e-2)
    assert looser.horizon is None or looser.horizon > known.horizon


@pytest.mark.slow
def test_chaos_ends_the_horizon_of_the_default_rope():
    known = reference(Rope(damping=0.0).problem(frames=200))
    assert 80 < known.horizon < 180
    assert known.trusted == int(known.horizon)
    ends_with_the_accuracy(known)


def test_instability_ends_the_horizon():
    """Errors grow by exp(4 t), from rounding to the accuracy within 4 or 5."""
    problem = scalar("follows", 0.0, np.arange(0.0, 12.0, 2.0), 4.0)
    known = reference(problem)
    assert known.horizon in (4.0, 6.0)
    true = np.abs(known.states[:, 0] - np.sin(problem.ts))[: known.trusted]
    assert np.all(true <= known.bound())
    ends_with_the_accuracy(known)
    bound = known.certificate.bounds["state"][2]
    for accuracy, trusted in ((0.9 * bound, 2), (1.1 * bound, 3)):
        assert reference(problem, accuracy=accuracy).trusted == trusted


@pytest.mark.slow
def test_chaos_ends_the_horizon():
    """Lorenz: errors grow by exp(0.9 t), from rounding to the accuracy within 20 or so."""
    known = reference(PROBLEMS["lorenz"](frames=5, duration=35))
    ends_with_the_accuracy(known)


def test_stiff_problems_get_implicit_solvers():
    problem = scalar("follows", 0.0, np.linspace(0.0, 3.0, 6), -1e6)
    known = reference(problem)
    assert known.certificate.stiff
    assert known.certificate.solver == KVAERNO5
    assert [w.solver for w in known.certificate.witnesses if w.role == "independent"] == [
        SCIPY_RADAU
    ]
    assert known.horizon is None
    assert np.all(np.abs(known.states[:, 0] - np.sin(problem.ts)) <= known.bound())
    assert known.bound()[-1] < 1e-9


@pytest.mark.slow
def test_a_stiff_reaction_gets_implicit_solvers():
    """Robertson's reactions, against LSODA with the equations written anew."""
    problem = PROBLEMS["robertson"](frames=5)
    known = reference(problem)
    assert known.certificate.stiff
    assert known.certificate.solver == KVAERNO5
    assert [w.solver for w in known.certificate.witnesses if w.role == "independent"] == [
        SCIPY_RADAU
    ]
    from scipy.integrate import solve_ivp

    def rhs(t, y):
        return [
            -0.04 * y[0] + 1e4 * y[1] * y[2],
            0.04 * y[0] - 1e4 * y[1] * y[2] - 3e7 * y[1] ** 2,
            3e7 * y[1] ** 2,
        ]

    span = problem.ts[[0, -1]]
    other = solve_ivp(
        rhs, span, [1.0, 0, 0], method="LSODA", t_eval=problem.ts, rtol=1e-11, atol=1e-14
    )
    np.testing.assert_allclose(known.states, other.y.T, atol=1e-8)


def test_a_stiff_spring_keeps_the_explicit_solver():
    known = reference(Rope(num_nodes=4, stiffness=1e6).problem(frames=3), rtol=1e-8)
    assert not known.certificate.stiff
    assert known.horizon is None


def test_a_pole_limits_the_horizon():
    problem = scalar("square", 1.0, [0.0, 0.4, 0.8, 1.2, 1.6, 2.0])
    known = reference(problem)
    assert known.horizon == 1.2
    true = np.abs(known.states[:3, 0] - 1 / (1 - problem.ts[:3]))
    assert np.all(true <= known.bound())


def test_jumps():
    problem = scalar("turns", 1.0, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0], 1.3, jump_times=[1.3])
    known = reference(problem)
    exact = np.exp(np.minimum(problem.ts, 2.6 - problem.ts))
    assert np.all(np.abs(known.states[:, 0] - exact) <= known.bound())
    assert known.bound()[-1] < 1e-13


def test_noise_in_the_right_hand_side_ends_the_trust():
    problem = scalar("24 bits", 1.0, np.linspace(0, 0.5, 6), 1.1)
    # How large the bound becomes depends on the machine: from 1.3e-8 to 1.5e-8 was seen at the end.
    try:
        trusted_until = reference(problem, accuracy=6e-9).horizon
    except ReferenceRefused:
        trusted_until = 0.0
    assert trusted_until <= 0.4
    # The noise is 6e-8 at most; where the accuracy allows more, the bound must cover it.
    known = reference(problem, rtol=1e-6, accuracy=1e-4)
    assert known.horizon is None
    assert np.all(np.abs(known.states[:, 0] - np.exp(-1.1 * problem.ts)) <= known.bound())
    assert known.bound()[-1] < 1e-6


def narrow_pulse(width):
    """A pulse at t = 3.3, between samples, that nothing announces; and the exact solution."""
    problem = scalar("pulse", 0.0, [0.0, 1.0, 2.0, 3.0, 4.0, 5.0], width)
    step = 0.5 * width * np.sqrt(np.pi) * np.exp(width**2 / 4)
    after = np.where(problem.ts > 3.3, step * np.exp(3.3 - problem.ts), 0.0)
    return problem, (1 - np.exp(-problem.ts) + after)[:, None]


def never_wrong(problem, exact, rtol):
    try:
        known = reference(problem, rtol=rtol, accuracy=1e-2)
    except ReferenceRefused:
        return True
    wrong = np.abs(known.states - exact)[: known.trusted, 0]
    return bool(np.all(wrong <= known.bound() + 1e-15))


@pytest.mark.parametrize("width", [3e-2, 1e-2, 3e-3, 1e-3])
@pytest.mark.parametrize(
    "rtol",
    [
        *(None, 1e-5),
        *(
            pytest.param(rtol, marks=pytest.mark.slow)
            for rtol in (1e-3, 1e-4, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10)
        ),
    ],
)
def test_what_most_runs_step_over_is_not_trusted(width, rtol):
    # Some rungs of the ladder see the pulse, others do not, and some none at all: then the
    # run with short steps does.
    assert never_wrong(*narrow_pulse(width), rtol)


@pytest.mark.usefixtures("looked_at_as_for_users")
def test_a_needle_is_not_stepped_over():
    assert never_wrong(*narrow_pulse(1e-6), 1e-8)


@pytest.mark.parametrize(
    ("equation", "y0"),
    [
        pytest.param("square", 1.0, id="a pole before the first sample"),
        pytest.param("sign", 0.3, id="a jump at zero", marks=pytest.mark.slow),
        pytest.param("root", 0.0, id="not unique"),
    ],
)
def test_what_has_no_solution_is_refused(equation, y0):
    problem, runs = scalar(equation, y0, np.arange(0.0, 12.0, 2.0)), []
    with pytest.raises(ReferenceRefused, match=f"no reference for '{equation}'"):
        reference(problem, progress=lambda text, fraction: runs.append(text))
    # A solver that is stuck uses up its steps, and nobody tries all tolerances with it.
    assert len(runs) <= 13


def neighbours_start(problem):
    """Where the run starts that must not be compared with a solution that is not unique."""
    ((_, run),) = witness_runs(reference(problem), roles=["neighbour"])
    return run.states[0]


def test_a_neighbour_differs_in_each_component():
    problem = Problem(lambda t, y, args: -y, [0.0, -3.0, 0.5], [0.0, 1.0])
    moved = np.abs(neighbours_start(problem) - problem.y0)
    np.testing.assert_array_equal(moved, [3 * EPS64, EPS64 * 2, EPS64 / 2])


def test_a_neighbour_moves_what_rests_but_nothing_that_is_held():
    """By a unit of rounding of the largest position or velocity on the way."""
    rope = Rope(num_nodes=3, initial_velocity=(1, 0)).problem(1)
    moved = neighbours_start(rope) - rope.y0
    held = np.zeros(rope.y0.shape, dtype=bool)
    held[:, :, 0] = True  # The first node is pinned.
    rests = (rope.y0 == 0) & ~held
    assert np.any(rests)
    np.testing.assert_array_equal(moved != 0, rests | (rope.y0 != 0))
    largest = np.max(np.abs(reference(rope).states), axis=(0, 2, 3))
    for half, moves, size in zip(moved, rests, largest, strict=True):
        np.testing.assert_allclose(half[moves], EPS64 * size, rtol=1e-3)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"accuracy": 0}, "accuracy: 0 given; allowed: a finite number > 0"),
        ({"accuracy": "fine"}, "accuracy: 'fine' given"),
        ({"rtol": -1e-9}, "rtol: "),
        ({"rtol": 1e-15}, "rtol: 1e-15 given; allowed: from 1e-13"),
        ({"rtol": 0.5}, "rtol: 0.5 given"),
        ({"rtol": np.nan}, "rtol: nan given"),
    ],
)
def test_bad_input(given, words, small_rope):
    with pytest.raises(InputError, match=words):
        reference(small_rope, **given)


def test_moving_the_origin_changes_nothing_but_rounding():
    here = Rope(num_nodes=4, start=(0, 0), end=(-40, 3))
    there = Rope(num_nodes=4, start=(1e3, 2e3), end=(960, 2003))
    a, b = (reference(rope.problem(frames=3)) for rope in (here, there))
    apart = np.linalg.norm(b.positions - a.positions - np.array([1e3, 2e3]), axis=2).max(axis=1)
    assert np.all(apart <= a.bound() + b.bound() + 1e-11)


def test_trajectory_shapes(small_rope):
    known = reference(small_rope)
    assert known.positions.shape == known.velocities.shape == (4, 4, 2)
    assert known.times.tolist() == [0, 1, 2, 3]
    assert known.bound(norm_for(small_rope, "velocity-rms")).shape == (4,)
    with pytest.raises(dataclasses.FrozenInstanceError):
        known.states = None


@pytest.mark.parametrize("rope", [{"pinned": (0, 1, 2, 3)}, {"gravity": (0, 0)}])
def test_what_stands_still_has_a_reference(rope):
    known = reference(Rope(num_nodes=4, **rope).problem(frames=3))
    assert known.horizon is None
    assert np.max(np.abs(known.states - known.states[0])) < 1e-9


INEXTENSIBLE = {
    "plane, its own mass and damping for each node, moving": InextensibleRope(
        start=(0, 0),
        end=(3, 1),
        num_nodes=4,
        node_mass=(1, 2, 0.5, 1.5),
        damping=(0.1, 0.2, 0.3, 0),
        initial_velocity=np.outer((0, 0.4, -0.2, 0.3), (-1, 3)),
    ),
    "space, pinned inside, undamped": InextensibleRope(
        start=(0, 0, 1),
        end=(3, -1, 0.5),
        num_nodes=6,
        node_mass=(1, 2, 0.5, 1.5, 0.7, 1),
        pinned=(1,),
        gravity=(0.3, -1, 0.2),
        damping=0.0,
    ),
    "neighbours pinned": InextensibleRope(num_nodes=4, pinned=(1, 2), node_mass=np.arange(1, 5)),
    "no pins, moving": InextensibleRope(
        start=(5, 5),
        end=(9, 5),
        num_nodes=4,
        pinned=(),
        node_mass=(1, 2, 0.5, 1.5),
        damping=(0.1, 0.2, 0.3, 0),
        initial_velocity=[(0.5, 1), (0.5, 0), (0.5, -0.5), (0.5, 2)],
    ),
}


@pytest.mark.slow
@pytest.mark.skipif(EPS > 2e-19, reason="np.longdouble is no wider than float64 here")
@pytest.mark.parametrize("rtol", [None, 1e-8])
@pytest.mark.parametrize("name", INEXTENSIBLE)
def test_bound_covers_the_true_error_of_an_inextensible_rope(name, rtol):
    problem = INEXTENSIBLE[name].problem(frames=3)
    known = reference(problem, rtol=rtol)
    made = known.certificate
    assert known.horizon is None
    truth = inextensible_rope_solution(problem)
    for quantity, norm in largest_norms(problem).items():
        true = distance(problem, norm, known.states.astype(np.longdouble), truth)
        bound = made.bounds[quantity]
        assert np.all(true <= bound)
        assert np.all(np.diff(bound) >= 0)
        assert np.all(bound >= made.drift[quantity])
        # A link is off by what its two nodes are off, and a rounding unit of their positions.
        allowed = 2 * true + 8 * np.finfo(np.float64).eps * problem.scale
        if quantity == "velocity":
            # The rate is seen along the reference's own link, which is turned a little.
            turned = 2 * distance(problem, norm, known.states, 0 * known.states)
            length = np.min(problem.args.rest_length)
            allowed = allowed + turned * 2 * made.bounds["position"] / length
        assert np.all(made.drift[quantity] <= allowed)


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=pytest.mark.slow if name.startswith(("space", "plane")) else ())
        for name in INEXTENSIBLE
    ],
)
def test_drift_is_how_far_links_are_off(name):
    problem = INEXTENSIBLE[name].problem(frames=3)
    known = reference(problem, rtol=1e-6)
    x, v = known.positions.astype(np.longdouble), known.velocities.astype(np.longdouble)
    length = np.linalg.norm(np.diff(problem.positions(problem.y0[None])[0], axis=0), axis=1)
    expected = {quantity: np.zeros(4) for quantity in ("position", "velocity")}
    for sample in range(4):
        for i in range(len(length)):
            d, w = x[sample, i + 1] - x[sample, i], v[sample, i + 1] - v[sample, i]
            long = np.sqrt(d @ d)
            for quantity, off in (("position", long - length[i]), ("velocity", d @ w / long)):
                expected[quantity][sample] = max(expected[quantity][sample], abs(float(off)))
    assert set(known.certificate.drift) == set(expected)
    for quantity, found in known.certificate.drift.items():
        rounding = 8 * np.finfo(np.float64).eps * problem.scale
        np.testing.assert_allclose(found, expected[quantity], rtol=1e-9, atol=rounding)
        assert np.all(known.certificate.bounds[quantity] >= 3 * found)
    # At 1e-6 the lengths of what moves a lot are visibly lost, far above rounding.
    assert "moving" not in name or np.max(known.certificate.drift["position"]) > 1e-10


def test_what_has_no_constraints_does_not_drift(small_rope):
    assert reference(small_rope).certificate.drift == {}


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
    assert set(lenient.drift) == {"position"}
    assert lenient.bounds["velocity"][-1] < 1e-7
