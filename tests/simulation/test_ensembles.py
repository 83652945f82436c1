"""The members of an ensemble are what each of them is alone."""

from __future__ import annotations

import dataclasses
import os

import numpy as np
import pytest

from ropeode.errors import InputError
from ropeode.problems import PROBLEMS, ROPES, Ensemble, InextensibleRope, Rope
from ropeode.simulation import simulate, simulate_chunks
from ropeode.steppers import as_stepper
from tests.steppers.every_variant import EVERY_VARIANT, REPRESENTATIVES


def into(fractions):
    """A progress that keeps the fractions."""
    return lambda text, fraction: fractions.append(fraction)


def ropes(kind, frames=4, **given):
    """Three ropes that differ in all that ropes of one family may differ in."""
    numbers = {
        "num_nodes": 5,
        "start": (0, 0, 1),
        "end": (3, -1, 0.5),
        "initial_velocity": np.outer((0.5, 0, 0, 0.4, -0.2), (1, 3, 0)),
        **given,
    }
    more = [
        {"pinned": (1, 2), "damping": 0.1},
        {"pinned": (2,), "node_mass": (1, 2, 0.5, 1.5, 0.7), "end": (6, -2, 3)},
        {"pinned": (1,), "damping": (0.1, 0.2, 0.3, 0, 0.5), "gravity": (0.3, -2, 0)},
    ]
    if kind is Rope:
        more = [
            {**each, "stiffness": k} for each, k in zip(more, (3, 5, (1, 2, 3, 4)), strict=True)
        ]
    for each in more:
        v = np.array(numbers["initial_velocity"], dtype=float)
        if kind is InextensibleRope:
            # Across the rope, and still where it is pinned.
            along = np.subtract(each.get("end", numbers["end"]), numbers["start"])
            v = np.outer(v[:, 0], np.cross(along, (0.3, 0.2, 1)))
        v[list(each["pinned"])] = 0.0
        each["initial_velocity"] = v
    return [kind(**{**numbers, **each}).problem(frames) for each in more]


def assert_same(found, alone, ulps=0):
    """The same run but for the seconds; states within rounding units of their largest value."""
    assert found.problem is alone.problem
    assert (found.status, found.diverged_at) == (alone.status, alone.diverged_at)
    assert (found.stepper, found.steps_per_frame) == (alone.stepper, alone.steps_per_frame)
    assert found.dt == alone.dt
    assert found.rhs_evaluations == alone.rhs_evaluations
    assert np.array_equal(found.times, alone.times)
    assert found.states.shape == alone.states.shape
    allowed = ulps * np.finfo(np.float64).eps * np.max(np.abs(alone.states))
    assert np.max(np.abs(found.states - alone.states)) <= allowed


# How a stepper starts and damps is the same code on all ropes, side by side or not.
BARE = [
    each
    for each in EVERY_VARIANT
    if ":" not in each.label or "sweeps" in each.label or each.family == "graphics"
]
PAIRS = [(each, kind) for kind in (Rope, InextensibleRope) for each in BARE]


# Sums of so many slopes are rounded in another order where several ropes stand in turn.
LONG_SUMS = ("dormand-prince5", "dormand-prince8")


def also_slow(stepper, kind):
    """Each stepper once is fast: on rigid links those that keep them, on springs the others."""
    rigid = stepper.keeps_lengths
    return rigid != (kind is InextensibleRope) or stepper.label not in REPRESENTATIVES


@pytest.mark.parametrize(
    ("stepper", "kind"),
    [
        pytest.param(
            *pair,
            id=f"{pair[0].label}-{pair[1].__name__}",
            marks=[pytest.mark.slow] if also_slow(*pair) else [],
        )
        for pair in PAIRS
    ],
)
def test_every_stepper_on_every_kind_of_rope(stepper, kind):
    problems = ropes(kind)
    if refusal := stepper.refusal(problems[0]):
        with pytest.raises(InputError) as caught:
            simulate(Ensemble.of(problems), stepper, 16)
        assert caught.value.problems == (refusal,)
        return
    found = simulate(Ensemble.of(problems), stepper, 16)
    assert len(found) == 3
    for each, problem in zip(found, problems, strict=True):
        ulps = 32 if stepper.label in LONG_SUMS else 0
        assert_same(each, simulate(problem, stepper, 16), ulps)
    # Steps so coarse have equations that Newton's method does not solve, of some ropes.
    most = 1 if stepper.family == "implicit" else 0
    assert [each.status for each in found].count("ok") >= 3 - most
    assert {each.status for each in found} <= {"ok", "unsolved"}
    assert len({each.states.tobytes() for each in found}) == 3


SLOW = pytest.mark.slow


# Explicit Euler, as in what follows: one program for all.
@pytest.mark.parametrize(
    ("frames", "stepper"),
    [
        (200, "explicit-euler"),
        (131, "stormer-verlet"),
        pytest.param(131, "explicit-euler", marks=SLOW),
        pytest.param(200, "stormer-verlet", marks=SLOW),
    ],
)
def test_any_number_of_frames(frames, stepper):
    """Two-step methods carry their last positions over the frames where a run is looked at."""
    problems = [
        Rope(start=(0, 0), end=(3, 0), num_nodes=4, stiffness=k, damping=0.5).problem(frames)
        for k in (5, 10, 3)
    ]
    seen = []
    found = simulate(Ensemble.of(problems), stepper, 20, progress=into(seen))
    for each, problem in zip(found, problems, strict=True):
        assert_same(each, simulate(problem, stepper, 20))
        assert len(each.times) == frames + 1
    assert seen == pytest.approx([128 / frames, 1.0])


def test_one_rope_that_diverges_leaves_the_others_alone():
    """Explicit Euler multiplies velocities by 1 - damping dt, here -5.7 and -2."""
    problems = [
        Rope(
            start=(0, 0), end=(3, 0), num_nodes=4, stiffness=k, damping=d, initial_velocity=(0, 1)
        ).problem(frames=250)
        for k, d in ((1, 0.5), (3, 200), (2, 0.6), (1, 90))
    ]
    seen = []
    found = simulate(
        Ensemble.of(problems),
        "explicit-euler",
        30,
        progress=into(seen),
    )
    alone = [simulate(problem, "explicit-euler", 30) for problem in problems]
    assert [each.status for each in alone] == ["ok", "diverged", "ok", "diverged"]
    # From 1 to 1.8e308, by 5.7 or 2 in each of the 30 steps of a frame.
    for each, factor in ((alone[1], 17 / 3), (alone[3], 2)):
        frame = np.log(np.finfo(np.float64).max) / np.log(factor) / 30
        assert each.diverged_at == pytest.approx(frame, abs=1.5)
    for each, other in zip(found, alone, strict=True):
        assert (each.status, each.diverged_at) == (other.status, other.diverged_at)
        assert each.rhs_evaluations == other.rhs_evaluations
        assert np.all(np.isfinite(each.states))
        assert each.states.shape == other.states.shape
    for rope in (0, 2):
        assert_same(found[rope], alone[rope], ulps=2000)
    assert seen == pytest.approx([128 / 250, 1.0])


@pytest.mark.parametrize(
    "stepper",
    ["rattle", *(pytest.param(each, marks=SLOW) for each in ("constraint-verlet", "rk4"))],
)
def test_one_inextensible_rope_that_fails_leaves_the_others_alone(stepper):
    """Its step is too long for the lengths to be kept; that of the others is not."""
    problems = [
        InextensibleRope(
            start=(0, 0, 0), end=(3, 0, 0), num_nodes=5, gravity=(0, -g, 0), damping=0.5
        ).problem(frames=5)
        for g in (1.0, 1e5, 0.5)
    ]
    found = simulate(Ensemble.of(problems), stepper, 20)
    alone = [simulate(problem, stepper, 20) for problem in problems]
    assert [alone[0].status, alone[2].status] == ["ok", "ok"]
    assert stepper != "rattle" or alone[1].status == "unsolved"
    for each, other in zip(found, alone, strict=True):
        assert (each.status, each.diverged_at) == (other.status, other.diverged_at)
    for rope in (0, 2):
        assert_same(found[rope], alone[rope], ulps=2000)


def test_a_run_in_which_all_diverge_stops_early():
    problems = [
        Rope(start=(0, 0), end=(3, 0), num_nodes=4, damping=d, initial_velocity=(0, 1)).problem(
            frames=10_000
        )
        for d in (200, 90)
    ]
    seen = []
    found = simulate(
        Ensemble.of(problems),
        "explicit-euler",
        30,
        progress=into(seen),
    )
    for each, problem in zip(found, problems, strict=True):
        alone = simulate(problem, "explicit-euler", 30)
        assert each.status == alone.status == "diverged"
        assert each.diverged_at == alone.diverged_at < 50
        assert each.rhs_evaluations == alone.rhs_evaluations
    # It stops within the part of the frames where the last one diverged.
    assert len(seen) == 1


@pytest.mark.parametrize(
    ("kind", "stepper", "nodes"),
    [
        (Rope, "semi-implicit-euler", 1),
        *(
            pytest.param(*rest, marks=SLOW)
            for rest in (
                (Rope, "rk4", 1),
                (InextensibleRope, "rk4", 1),
                (InextensibleRope, "constraint-verlet", 1),
                (InextensibleRope, "rattle", 1),
                (InextensibleRope, "rattle", 2),
                (Rope, "constraint-verlet", 1),
                (Rope, "constraint-verlet", 2),
                (InextensibleRope, "constraint-verlet", 2),
                (Rope, "rattle", 1),
                (Rope, "rattle", 2),
            )
        ),
    ],
)
def test_very_short_ropes(kind, stepper, nodes):
    problems = [
        kind(
            start=(0, 0), end=(1, 0), num_nodes=nodes, pinned=list(range(nodes - 1)), damping=d
        ).problem(frames=2)
        for d in (0.0, 0.4)
    ]
    found = simulate(Ensemble.of(problems), stepper, 16)
    for each, problem in zip(found, problems, strict=True):
        assert_same(each, simulate(problem, stepper, 16), ulps=100)


@pytest.mark.slow
def test_as_many_ropes_as_nodes():
    """No axis is taken for another where they are equally long."""
    problems = [
        Rope(num_nodes=3, start=(0, 0, 0), end=(1, 2, 3), stiffness=k, pinned=(pin,)).problem(2)
        for k, pin in ((3, 0), (4, 1), (5, 2))
    ]
    found = simulate(Ensemble.of(problems), "semi-implicit-euler", 8)
    for each, problem in zip(found, problems, strict=True):
        assert_same(each, simulate(problem, "semi-implicit-euler", 8), ulps=100)


@pytest.mark.parametrize(
    "other",
    [
        InextensibleRope(num_nodes=4).problem(frames=3),
        Rope(num_nodes=5).problem(frames=3),
        Rope(num_nodes=4).problem(frames=4),
        Rope(num_nodes=4, start=(0, 0, 0), end=(1, 2, 3)).problem(frames=3),
        *[make(frames=3) for name, make in PROBLEMS.items() if name not in ROPES],
    ],
    ids=lambda problem: f"{problem.name} {problem.y0.shape} {problem.frames}",
)
def test_mixed_families_are_refused(other):
    rope = Rope(num_nodes=4).problem(frames=3)
    for problems in ([rope, other], [other, rope]):
        with pytest.raises(InputError, match="problems: .* problems of one family") as caught:
            Ensemble.of(problems)
        (line,) = caught.value.problems
        assert other.name in line
        assert "Fix: run them one by one" in line


def test_other_sample_times_are_refused():
    rope = Rope(num_nodes=4).problem(frames=3)
    later = dataclasses.replace(rope, ts=rope.ts + 0.5)
    with pytest.raises(InputError, match="differ in their sample times"):
        Ensemble.of([rope, later])


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
    moved = 1e-6 * np.arange(11).reshape(-1, *[1] * first.y0.ndim)
    ensemble = Ensemble.varying(first, y0=first.y0 + moved)
    found = simulate(ensemble, stepper, 8)
    assert len(found) == 11
    for each, problem in zip(found, ensemble, strict=True):
        alone = simulate(problem, stepper, 8)
        assert each.status == alone.status == "ok"
        assert each.rhs_evaluations == alone.rhs_evaluations
        scale = np.max(np.abs(alone.states))
        assert np.max(np.abs(each.states - alone.states)) <= 64 * np.finfo(float).eps * scale
    assert len({each.states.tobytes() for each in found}) == 11


def many(count, **more):
    """Ropes that differ in all that an ensemble may vary."""
    draw = np.random.default_rng(5)
    arrays = {
        "stiffness": draw.uniform(1, 9, (count, 4)),
        "damping": draw.uniform(0, 1, count),
        "node_mass": draw.uniform(0.5, 2, count),
        "gravity": draw.normal(size=(count, 2)),
        "initial_velocity": draw.normal(size=(count, 2)),
        **more,
    }
    rope = Rope(start=(0, 0), end=(4, 0), num_nodes=5, pinned=(2,))
    return rope, arrays, rope.ensemble(3, **arrays)


def test_seconds_are_shared():
    _, _, ensemble = many(7)
    simulate(ensemble, "velocity-verlet", 10)
    found = simulate(ensemble, "velocity-verlet", 10)
    assert len({each.seconds for each in found}) == 1
    assert found[0].seconds > 0
    assert [each.compile_seconds for each in found] == [0.0] * 7


@pytest.mark.parametrize("count", [1, 7, 100])
def test_arrays_of_parameters_are_those_ropes(count):
    rope, arrays, ensemble = many(count)
    found = simulate(ensemble, "velocity-verlet", 10)
    assert found.states.shape == (4, 2, 2, 5, count)
    for index in {0, count // 2, count - 1}:
        own = {name: array[index].tolist() for name, array in arrays.items()}
        alone = Rope(**{**rope.model_dump(), **own}).problem(3)
        member = ensemble[index]
        assert member.parameters == alone.parameters
        assert np.array_equal(member.y0, alone.y0)
        assert all(map(np.array_equal, member.args, alone.args))
        run = simulate(alone, "velocity-verlet", 10)
        assert np.array_equal(found[index].states, run.states)


@pytest.mark.parametrize(
    "stepper",
    ["velocity-verlet", *(pytest.param(e, marks=SLOW) for e in ("rk4", "constraint-verlet"))],
)
def test_results_do_not_depend_on_who_else_is_there(stepper):
    rope, arrays, ensemble = many(100)
    found = simulate(ensemble, stepper, 10)
    for members in ([3], [99, 0, 3, 17], list(range(99, -1, -1))):
        some = rope.ensemble(3, **{name: array[members] for name, array in arrays.items()})
        assert np.array_equal(simulate(some, stepper, 10).states, found.states[..., members])


def test_chunks_are_the_whole_in_pieces():
    _, _, ensemble = many(3000)
    whole = simulate(ensemble, "velocity-verlet", 10)
    chunks = list(simulate_chunks(ensemble, "velocity-verlet", 10))
    assert len(chunks) > 4
    assert [each.start for each in chunks] == np.cumsum([0, *map(len, chunks)])[:-1].tolist()
    assert np.array_equal(np.concatenate([each.states for each in chunks], axis=-1), whole.states)
    last = chunks[-1]
    assert np.array_equal(last[-1].states, whole[2999].states)
    assert last[-1].problem.parameters == whole[2999].problem.parameters


def test_chunks_are_made_as_they_are_taken():
    """However many members there are, no more than a few chunks exist."""
    _, _, ropes = many(20_000)
    asked = []

    def numbers(start, stop):
        asked.append(stop)
        return ropes.numbers(start, stop)

    ensemble = Ensemble(ropes.first, len(ropes), numbers, ropes.__getitem__)
    chunks = simulate_chunks(ensemble, "velocity-verlet", 1)
    taken = sum(len(next(chunks)) for _ in range(3))
    assert max(asked) - taken <= (os.cpu_count() + 2) * taken / 3
    chunks.close()


def test_what_does_not_fit_into_memory_is_refused_before_it_runs():
    problem = Rope(num_nodes=16).problem(frames=2000)
    size = 2**26
    y0 = np.broadcast_to(problem.y0, (size, *problem.y0.shape))
    ensemble = Ensemble(problem, size, lambda a, b: y0[a:b], lambda index: problem)
    with pytest.raises(InputError, match="ensemble: .*fit into memory, .*simulate_chunks"):
        simulate(ensemble, "rk4", 10)


@pytest.mark.parametrize(
    ("kind", "arrays", "match"),
    [
        (Rope, {}, "ensemble: {} given; allowed: arrays"),
        (Rope, {"damping": [0.1, 0.2], "stiffness": [1.0]}, "ensemble: .*as many members"),
        (Rope, {"damping": [0.1, -0.2]}, "damping: -0.2 given; .*below zero"),
        (Rope, {"damping": [0.1, np.nan]}, "damping: .*finite numbers"),
        (Rope, {"damping": 0.1}, "damping: 0.1 given; .*one entry along its first axis"),
        (Rope, {"node_mass": [[1, 2, 3], [1, 0, 3]]}, "node_mass: .*0.0 is not above zero"),
        (Rope, {"gravity": [[1, 2, 3]]}, "gravity: .*start has 2"),
        (Rope, {"num_nodes": [3, 4]}, "field: 'num_nodes' given, which does not exist"),
        (InextensibleRope, {"stiffness": [3, 4]}, "field: 'stiffness' given"),
        (
            InextensibleRope,
            {"initial_velocity": [[[0, 1]] * 3, [[0, 0], [1, 0], [0, 0]]]},
            "initial_velocity: .*stretch",
        ),
    ],
)
def test_arrays_that_cannot_be_used(kind, arrays, match):
    rope = kind(start=(0, 0), end=(1, 0), num_nodes=3, pinned=())
    with pytest.raises(InputError, match=match):
        rope.ensemble(2, **arrays)


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"y0": np.ones((3, 2))}, "y0: .*shape"),
        ({"y0": np.full((3, 3), np.nan)}, "y0: .*mend member 0"),
        ({"y0": np.ones((0, 3))}, "y0: .*at least one"),
        ({"args": {"sigma": [1.0]}}, "args: "),
        ({}, "y0: .*at least one"),
    ],
)
def test_numbers_that_cannot_be_used(given, match):
    with pytest.raises(InputError, match=match):
        Ensemble.varying(PROBLEMS["lorenz"](frames=2), **given)


def test_bad_input():
    rope = Rope(num_nodes=4).problem(frames=3)
    with pytest.raises(InputError, match="problems: .* at least one problem"):
        simulate(Ensemble.of([]), "rk4", 16)
    with pytest.raises(InputError, match="stepper: 'rk5' given"):
        simulate(Ensemble.of([rope]), "rk5", 16)
    with pytest.raises(InputError, match="steps_per_frame: 0 given"):
        simulate(Ensemble.of([rope]), "rk4", 0)
    inextensible = InextensibleRope(num_nodes=4).problem(frames=3)
    with pytest.raises(InputError, match="depends on the velocity") as caught:
        simulate(Ensemble.of([inextensible] * 3), "stormer-verlet", 16)
    assert len(caught.value.problems) == 1
