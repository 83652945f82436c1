"""The members of an ensemble are what each of them is alone."""

from __future__ import annotations

import dataclasses
import functools
import os

import numpy as np
import pytest

from ropeode.errors import InputError
from ropeode.problems import PROBLEMS, ROPES, Ensemble, InextensibleRope, Rope
from ropeode.simulation import simulate, simulate_chunks
from ropeode.steppers import as_stepper
from tests.steppers.every_variant import REPRESENTATIVES, SINGLE_OPTIONS
from tests.steppers.ropes import in_space

SLOW = pytest.mark.slow


def ropes(kind):
    """Three ropes that differ in all that ropes of one family may differ in."""
    numbers = [
        {"pinned": (1, 2), "damping": 0.1, "node_mass": 1.0},
        {"pinned": (2,), "damping": 0.01, "end": (6, -2, 0)},
        {"pinned": (1,), "gravity": (0.3, -2, 0), "node_mass": 1.0},
    ]
    if kind is Rope:
        numbers = [{**numbers[i], "stiffness": (3, 5, (1, 2, 3, 4))[i]} for i in range(3)]
    return [in_space(kind, **each).problem(4) for each in numbers]


FACTS = (
    *("problem", "status", "diverged_at", "stepper", "steps_per_frame", "dt"),
    *("rhs_evaluations", "jacobian_evaluations"),
)


def side_by_side(problems, stepper, steps, ulps=0):
    """Run problems side by side; each moves as it does alone. Also, how far one was told it is.

    All is the same but for the seconds; states to rounding units of their largest value.
    """
    told, ropes = [], Ensemble.of(problems)
    found = simulate(ropes, stepper, steps, progress=lambda text, part: told.append(part))
    for each, problem in zip(found, problems, strict=True):
        alone = simulate(problem, stepper, steps)
        for name in FACTS:
            assert getattr(each, name) == getattr(alone, name)
        assert np.array_equal(each.times, alone.times)
        allowed = ulps * np.finfo(np.float64).eps * np.max(np.abs(alone.states))
        np.testing.assert_allclose(each.states, alone.states, rtol=0, atol=allowed)
    return found, told


# Sums of so many slopes are rounded in another order where several ropes stand in turn; and dense
# systems on a processor that takes eight numbers at once.
LONG_SUMS = ("dormand-prince5", "dormand-prince8")
OTHER_BITS = (*LONG_SUMS, "bdf2")
# How a stepper starts and damps is the same code on all ropes, side by side or not.
BARE = [
    *(each for each in SINGLE_OPTIONS if ":" not in each.label or each.family == "graphics"),
    *(as_stepper(label) for label in ("constraint-verlet:sweeps=3", *LONG_SUMS)),
]
# Its dense systems are solved side by side.
DENSE = ("implicit-euler", InextensibleRope)


# Implicit Euler iterates in the same loop, and Adams-Bashforth 2 carries as much.
ALIKE = ("implicit-midpoint", "trapezium", "bdf2", "adams-pece2")


def pair(stepper, kind):
    """Each stepper once is fast: on rigid links those that keep them, on springs the others."""
    telling = stepper.label in REPRESENTATIVES and stepper.label not in ALIKE
    fast = telling and stepper.keeps_lengths == (kind is InextensibleRope)
    name = f"{stepper.label}-{kind.__name__}"
    return pytest.param(stepper, kind, id=name, marks=[] if fast else [SLOW])


@pytest.mark.parametrize(
    ("stepper", "kind"), [pair(each, kind) for kind in (Rope, InextensibleRope) for each in BARE]
)
def test_every_stepper_on_every_kind_of_rope(stepper, kind):
    problems = ropes(kind)
    if refusal := stepper.refusal(problems[0]):
        with pytest.raises(InputError) as caught:
            simulate(Ensemble.of(problems), stepper, 16)
        assert caught.value.problems == (refusal,)
        return
    found, _ = side_by_side(problems, stepper, 16, 32 if stepper.label in OTHER_BITS else 0)
    # Steps so coarse have equations that Newton's method does not solve, of some ropes.
    statuses = [each.status for each in found]
    assert set(statuses) <= {"ok", "unsolved"}
    assert statuses.count("ok") >= (2 if stepper.family == "implicit" else 3)
    if (stepper.label, kind) == DENSE:
        assert statuses == ["ok", "ok", "unsolved"]
        assert len({each.jacobian_evaluations for each in found}) == 3
    assert len({each.states.tobytes() for each in found}) == 3


def falling(damping, frames):
    """Explicit Euler multiplies velocities by 1 - damping dt: with 30 steps, by -5.7 and -2."""
    moving = {"start": (0, 0), "end": (3, 0), "num_nodes": 4, "initial_velocity": (0, 1)}
    return Rope(**moving, stiffness=1, damping=damping).problem(frames)


def test_one_rope_that_diverges_leaves_the_others_alone():
    problems = [falling(damping, 250) for damping in (0.5, 200, 0.6, 90)]
    found, told = side_by_side(problems, "explicit-euler", 30, ulps=2000)
    assert [each.status for each in found] == ["ok", "diverged", "ok", "diverged"]
    # From 1 to 1.8e308, by 5.7 or 2 in each of the 30 steps of a frame.
    for each, factor in ((found[1], 17 / 3), (found[3], 2)):
        frame = np.log(np.finfo(np.float64).max) / np.log(factor) / 30
        assert each.diverged_at == pytest.approx(frame, abs=1.5)
        assert np.all(np.isfinite(each.states))
    assert told == pytest.approx([128 / 250, 1.0])


def test_a_run_in_which_all_diverge_stops_early():
    """Within the part of the frames where the last one diverged."""
    problems = [falling(damping, 10_000) for damping in (200, 90)]
    found, told = side_by_side(problems, "explicit-euler", 30, ulps=2000)
    assert {each.status for each in found} == {"diverged"}
    assert len(told) == 1


def test_one_inextensible_rope_that_fails_leaves_the_others_alone():
    """Its step is too long for the lengths to be kept; that of the others is not."""
    problems = [in_space(InextensibleRope, gravity=(0, -g, 0)).problem(4) for g in (1, 1e5, 0.5)]
    found, _ = side_by_side(problems, "rattle", 16, ulps=2000)
    assert [each.status for each in found] == ["ok", "unsolved", "ok"]


def test_ropes_of_one_node():
    ropes = Rope(start=(0, 0), end=(1, 0), num_nodes=1, pinned=()).ensemble(2, damping=[0.0, 0.4])
    side_by_side(list(ropes), "semi-implicit-euler", 16, ulps=100)


def test_mixed_families_are_refused():
    rope = Rope(num_nodes=4).problem(frames=3)
    others = [
        each.problem(frames=3)
        for each in (InextensibleRope(num_nodes=4), Rope(num_nodes=5), in_space(Rope))
    ]
    for other in (*others, PROBLEMS["lorenz"](frames=3), rope.changed(ts=rope.ts + 0.5)):
        for problems in ([rope, other], [other, rope]):
            with pytest.raises(InputError, match="problems of one family.*Fix: run them one by"):
                Ensemble.of(problems)


SMOOTH = {name: make for name, make in PROBLEMS.items() if name not in ROPES}


# With parameters and without velocities; with many nodes in several dimensions.
FEW = ("lorenz", "pleiades")


@pytest.mark.parametrize(
    "name", [name if name in FEW else pytest.param(name, marks=SLOW) for name in SMOOTH]
)
def test_every_problem(name):
    """Different starts; where a sum is taken in another order, the last digits may differ."""
    problem = SMOOTH[name](frames=2)
    stepper = "rk4" if problem.mechanics is None else "velocity-verlet"
    if as_stepper(stepper).refusal(problem):
        stepper = "semi-implicit-euler"
    # A whole frame of a stiff one would take many steps.
    short = problem.ts[0] + 1e-4 * np.arange(3)
    first = dataclasses.replace(problem, ts=short, exact=None, jump_times=())
    problems = [dataclasses.replace(first, y0=first.y0 + 1e-6 * i) for i in range(11)]
    found, _ = side_by_side(problems, stepper, 8, ulps=64)
    assert {each.status for each in found} == {"ok"}
    assert len({each.states.tobytes() for each in found}) == 11


VARIED = Rope(start=(0, 0), end=(4, 0), num_nodes=5, pinned=(2,))


def test_arrays_of_parameters_are_those_ropes():
    """Each to the bit, whoever else is there."""
    draw = np.random.default_rng(5)
    # All that an ensemble may vary.
    arrays = {
        "stiffness": draw.uniform(1, 9, (100, 4)),
        "damping": draw.uniform(0, 1, 100),
        "node_mass": draw.uniform(0.5, 2, 100),
        "gravity": draw.normal(size=(100, 2)),
        "initial_velocity": draw.normal(size=(100, 2)),
    }
    ensemble = VARIED.ensemble(3, **arrays)
    found = simulate(ensemble, "velocity-verlet", 10)
    assert found.states.shape == (4, 2, 2, 5, 100)
    for index in (0, 50, 99):
        own = {name: array[index].tolist() for name, array in arrays.items()}
        alone = Rope(**{**VARIED.model_dump(), **own}).problem(3)
        member = ensemble[index]
        assert member.parameters == alone.parameters
        assert np.array_equal(member.y0, alone.y0)
        assert all(map(np.array_equal, member.args, alone.args))
        run = simulate(alone, "velocity-verlet", 10)
        assert np.array_equal(found[index].states, run.states)
    for members in ([3], [99, 0, 3, 17], list(range(99, -1, -1))):
        some = VARIED.ensemble(3, **{name: array[members] for name, array in arrays.items()})
        states = simulate(some, "velocity-verlet", 10).states
        assert np.array_equal(states, found.states[..., members])


def test_chunks_are_the_whole_in_pieces_and_made_as_they_are_taken():
    """However many members there are, no more than a few chunks exist."""
    ropes = VARIED.ensemble(3, damping=np.linspace(0.0, 1.0, 20_000))
    whole = simulate(ropes, "velocity-verlet", 1)
    asked = []

    def numbers(start, stop):
        asked.append(stop)
        return ropes.numbers(start, stop)

    ensemble = Ensemble(ropes.first, len(ropes), numbers, ropes.__getitem__)
    rest = simulate_chunks(ensemble, "velocity-verlet", 1)
    chunks = [next(rest) for _ in range(3)]
    taken = sum(map(len, chunks))
    assert max(asked) - taken <= (os.cpu_count() + 2) * taken / 3
    chunks += rest
    assert [each.start for each in chunks] == np.cumsum([0, *map(len, chunks)])[:-1].tolist()
    assert np.array_equal(np.concatenate([each.states for each in chunks], axis=-1), whole.states)
    assert chunks[-1][-1].problem.parameters == whole[19_999].problem.parameters


def test_what_does_not_fit_into_memory_is_refused_before_it_runs():
    problem = Rope(num_nodes=16).problem(frames=2000)
    y0 = np.broadcast_to(problem.y0, (2**26, *problem.y0.shape))
    ensemble = Ensemble(problem, 2**26, lambda a, b: y0[a:b], lambda index: problem)
    with pytest.raises(InputError, match="ensemble: .*fit into memory, .*simulate_chunks"):
        simulate(ensemble, "rk4", 10)


def of_ropes(kind=Rope, **arrays):
    kind(start=(0, 0), end=(1, 0), num_nodes=3, pinned=()).ensemble(2, **arrays)


def of_lorenz(**numbers):
    Ensemble.varying(PROBLEMS["lorenz"](frames=2), **numbers)


STRETCHING = [[[0, 1]] * 3, [[0, 0], [1, 0], [0, 0]]]
RIGID = functools.partial(of_ropes, InextensibleRope)


@pytest.mark.parametrize(
    ("make", "numbers", "match"),
    [
        (of_ropes, {}, "ensemble: {} given; allowed: arrays"),
        (of_ropes, {"damping": [0.1, 0.2], "stiffness": [1.0]}, "ensemble: .*as many members"),
        (of_ropes, {"damping": [0.1, -0.2]}, "damping: -0.2 given; .*below zero"),
        (of_ropes, {"node_mass": [[1, 2, 3], [1, 0, 3]]}, "node_mass: .*0.0 is not above zero"),
        (of_ropes, {"gravity": [[1, 2, 3]]}, "gravity: .*start has 2"),
        (of_ropes, {"num_nodes": [3, 4]}, "field: 'num_nodes' given, which does not exist"),
        (RIGID, {"initial_velocity": STRETCHING}, "initial_velocity: .*stretch"),
        (of_lorenz, {"y0": np.full((3, 3), np.nan)}, "y0: .*mend member 0"),
        (of_lorenz, {"y0": np.ones((0, 3))}, "y0: .*at least one"),
        (of_lorenz, {"args": {"sigma": [1.0]}}, "args: "),
        (Ensemble.of, {"problems": []}, "problems: .* at least one problem"),
    ],
)
def test_numbers_that_cannot_be_used(make, numbers, match):
    with pytest.raises(InputError, match=match):
        make(**numbers)
