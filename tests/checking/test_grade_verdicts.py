"""Right programs pass, wrong ones fail, and without enough evidence there is no verdict."""

from __future__ import annotations

import dataclasses
import functools
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from trajectory_writing import finding, node_values, write_csv, write_runs

from ropeode import grade
from ropeode.checking import Layout, read_runs, samples_of, states_of
from ropeode.problems import PROBLEMS, InextensibleRope, Rope
from ropeode.simulation import simulate
from ropeode.theory import stability_limit
from tests.sampled import sampled

STEPS, UNEVEN = (16, 24, 32, 48), (16.4, 24.4, 32.4, 48.4)


def program(problem, ends, number=np.float64):
    """Every state of velocity Verlet for `small_rope` in NumPy, with steps that end at these times.

    It shares nothing with the package.
    """
    k, length, c = number(100.0), number(400.0 / 3.0), number(problem.args.damping[0])

    def accelerations(x):
        d = np.diff(x, axis=0)
        size = np.sqrt(np.sum(d * d, axis=1, keepdims=True))
        pull = k * (size - length) / size * d
        a = np.zeros_like(x)
        a[:-1] += pull
        a[1:] -= pull
        a[:, 1] -= number(1.0)
        a[0] = 0
        return a

    x, v = np.split(number(node_values(problem, problem.y0[None])[0]), 2, axis=1)
    samples, a = [np.hstack([x, v])], accelerations(x)
    for dt in number(np.diff(ends)):
        v = v + number(0.5) * dt * (a - c * v)
        x = x + dt * v
        a = accelerations(x)
        v = (v + number(0.5) * dt * a) / (1 + number(0.5) * dt * c)
        samples.append(np.hstack([x, v]))
    return np.array(samples)


def after(problem, n, counts, number=np.float64):
    """What a program prints that has made so many steps of 1/n at the samples."""
    return program(problem, np.arange(counts[-1] + 1) / n, number)[[0, *counts]]


def frames_of(problem, n, number=np.float64):
    """A right program's samples."""
    return after(problem, n, n * np.arange(1, problem.frames + 1), number)


def files(folder, problem, values_of, steps=STEPS, **how):
    return [
        write_csv(folder / f"{n}.csv", problem.ts, values_of(problem, n), 1 / n, **how)
        for n in steps
    ]


def test_an_independent_verlet_is_right(tmp_path, small_rope, known):
    made = files(tmp_path, small_rope, frames_of)
    report = grade(made, known)
    assert (report.passed, report.notes, report.diagnosis) == (True, (), ())
    report = grade(made, known, expected_order=2)
    assert [each.status for each in report.findings] == ["pass", "pass", "pass", "skip"]
    for order in finding(report).convergence.orders.values():
        assert order.observed == pytest.approx(2.0, abs=0.1)
    # The order that is claimed counts.
    report = grade(made, known, expected_order=3, diagnose=False)
    assert [each.check for each in report.failed] == ["order"]


def every_step(problem, n):
    """Times and samples of every step, the last in a frame shorter."""
    frame = np.append(np.arange(1, math.ceil(n)) / n, 1.0)
    times = np.concatenate([[0.0], *(k + frame for k in range(problem.frames))])
    return times, program(problem, times)


@pytest.mark.parametrize("examples", [5, pytest.param(30, marks=pytest.mark.slow)])
def test_a_right_program_is_not_rejected(tmp_path, small_rope, known, examples):
    """Whatever its step sizes and digits are: it passes, or they are too few for a verdict."""
    run = functools.cache(functools.partial(every_step, small_rope))

    @settings(max_examples=examples, deadline=None)
    @given(
        steps=st.lists(st.integers(14, 60), min_size=3, max_size=6, unique=True),
        part=st.sampled_from([0.0, 0.4, 0.75]),
        digits=st.sampled_from(["%.17g", "%.12g", "%.9g", "%.8f", "%.6g"]),
        columns=st.sampled_from([4, 2]),
    )
    def passes_or_is_undecided(steps, part, digits, columns):
        made = []
        for n in (n + part for n in steps):
            times, values = run(n)
            path, written = tmp_path / f"{n}.csv", values[:, :, :columns]
            made.append(write_csv(path, times, written, 1 / n, digits=digits))
        report = grade(made, known, expected_order=2)
        assert report.verdict != "wrong", report.failed[0].line
        assert not any("does not divide" in note for note in report.notes)
        assert report.passed or re.search(r"; (write|add|compute) ", finding(report).line)

    passes_or_is_undecided()


# Steps that are made until the end of a frame.
MISCOUNTED = {
    "the program makes one step too many in each frame": lambda frame, n: frame * (n + 1),
    "the program makes one step too few in each frame": lambda frame, n: frame * (n - 1),
    "skips the last partial step": lambda frame, n: frame * math.floor(n),
    "from the step before it": lambda frame, n: math.floor(frame * n),
    "from the step after it": lambda frame, n: math.ceil(frame * n),
    "beyond the end": lambda frame, n: frame * math.ceil(n),
}


def miscounted(words):
    return lambda problem, n: after(problem, n, [MISCOUNTED[words](k, n) for k in (1, 2, 3)])


@pytest.mark.parametrize(
    "words",
    sampled(MISCOUNTED, fast={*MISCOUNTED} - {"the program makes one step too few in each frame"}),
)
def test_samples_that_are_not_at_their_time(tmp_path, small_rope, known, words):
    """Also where dt does not divide a frame, and programs stop too early or too late."""
    made = files(tmp_path, small_rope, miscounted(words), STEPS if "one" in words else UNEVEN)
    report = grade(made, known, expected_order=2)
    assert [each.check for each in report.failed] == ["order"]
    (diagnosis,) = report.diagnosis
    assert words in diagnosis.line
    assert grade(made, known, expected_order=2, diagnose=False).diagnosis == ()
    if "one" in words:
        # Without a claim it is a program of order 1.
        report = grade(made, known)
        assert report.passed
        assert report.notes[0].startswith(words)
    elif "skips" in words:
        assert diagnosis.cause == "last-step"


@pytest.mark.parametrize(
    ("stepper", "words"),
    [
        pytest.param("explicit-euler", "as explicit Euler gives them", marks=pytest.mark.slow),
        ("semi-implicit-euler", "as semi-implicit Euler gives them"),
        ("stormer-verlet:start=rest", r"with x\(-dt\) = x\(0\)"),
    ],
)
def test_errors_that_are_half_a_step_of_time(tmp_path, small_rope, known, stepper, words):
    """The leading error of some steppers from rest is that; it is no wrong number of steps."""
    made = write_runs(tmp_path, small_rope, stepper, (128, 256, 512))
    report = grade(made, known, expected_order=2)
    assert not report.passed
    said = " ".join(each.line for each in report.diagnosis)
    assert re.search(rf"half a step (later, t \+|earlier, t -) dt/2, .*{words}", said)


@pytest.mark.parametrize("end", [1.0, np.nan])
def test_pins(tmp_path, small_rope, known, end):
    """They hold in a run that diverges, too, until it does."""

    def moving(problem, n):
        values = frames_of(problem, n)
        if n == STEPS[0]:
            values[2, 0, 1] += 1e-6
            values[3] *= end
        return values

    report = grade(files(tmp_path, small_rope, moving), known, diagnose=False)
    assert [each.check for each in report.failed] == ["pins"]
    assert "pinned node 0 is 1.0e-06 away from its place at t = 2" in report.failed[0].line


def single(problem, n):
    return frames_of(problem, n, np.float32)


def on_no_line(problem, n):
    off = {16: 1e-3, 20: 3e-3, 150: 1e-4}[n]
    motion = np.arange(4)[:, None, None] * problem.args.free[:, None]
    return frames_of(problem, 256) + off * motion


UNDECIDED = {
    "are in single precision; compute in double": (single, (48, 64, 96), "%.9g", 2),
    "add runs with 300, 600 and 1200 steps per frame": (on_no_line, (16, 20, 150), "%.17g", 1),
    "the step sizes show no order": (frames_of, (76, 77, 78), "%.8f", 2),
}


@pytest.mark.parametrize(
    "words",
    sampled(UNDECIDED, fast={*UNDECIDED} - {"add runs with 300, 600 and 1200 steps per frame"}),
)
def test_what_shows_no_order_is_no_fault_of_the_stepper(tmp_path, small_rope, known, words):
    values, steps, digits, order = UNDECIDED[words]
    made = files(tmp_path, small_rope, values, steps, digits=digits)
    report = grade(made, known, expected_order=order)
    assert (report.verdict, report.exit_code) == ("undetermined", 2)
    assert words in finding(report).line


@pytest.mark.slow
def test_an_unstable_method_that_is_not_known(tmp_path, small_rope, known):
    """With another damping and gravity it is no stepper of ropeode on this rope."""
    other = Rope(num_nodes=4, damping=0.5, gravity=(0.5, -1.5)).problem(frames=3)
    made = write_runs(tmp_path, other, "explicit-euler", (8, 12, 16))
    line = finding(grade(made, known, method="explicit-euler")).line
    limit = stability_limit(small_rope, "explicit-euler")
    assert f"; explicit-euler is stable here from {limit} steps per frame on; add runs" in line


def test_a_wrong_program_that_blows_up_is_wrong(tmp_path, small_rope, known):
    """Its runs agree with each other on another motion."""
    pulled = small_rope.changed(args=small_rope.args._replace(gravity=np.array([[0.0], [9e3]])))
    made = write_runs(tmp_path, pulled, "velocity-verlet", (64, 96, 128))
    report = grade(made, known, diagnose=False)
    assert report.verdict == "wrong"
    assert "wrong limit of positions" in finding(report).line


def test_energy_is_noted_where_it_is_conserved(tmp_path, known):
    problem = Rope(num_nodes=4, damping=0.0).problem(frames=64)
    # The first samples show that it is conserved; these are right to ten digits.
    states = simulate(problem, "rk4", 256).states
    solved = dataclasses.replace(known, problem=problem, states=states)
    made = files(tmp_path, problem, frames_of, (12, 16, 24))
    found = finding(grade(made, solved, diagnose=False), "energy")
    assert found.status == "note"
    assert [each["verdict"] for each in found.evidence.values()] == ["bounded", "bounded"]
    assert found.line.startswith("dt 0.0833333: energy stays within")
    damped = finding(grade(files(tmp_path, known.problem, frames_of), known), "energy")
    assert (damped.status, damped.line) == ("skip", "the problem does not conserve its energy")


def test_problems_of_every_kind(tmp_path, driven_pendulum):
    """What is written of a state is read as that state."""
    rope = InextensibleRope(num_nodes=3, start=(0, 0, 0), end=(-2, 0, 1)).problem(frames=2)
    uneven = dataclasses.replace(driven_pendulum, ts=np.array([2.0, 2.5, 3.5, 3.75]))
    for problem in (rope, uneven, *(PROBLEMS[name]() for name in ("lorenz", "kepler", "pleiades"))):
        states = np.random.default_rng(3).normal(size=(2, *problem.y0.shape))
        assert np.array_equal(states_of(problem, samples_of(problem, states)), states)
        assert samples_of(problem, states).shape[1] == Layout.of(problem).nodes


def test_frames_of_unequal_length(tmp_path, small_rope):
    """The samples are picked out of every step, or are all that is written."""
    problem = dataclasses.replace(small_rope, ts=np.array([0.0, 0.5, 1.5, 1.75]))

    def every(n):
        return np.arange(round(1.75 * n) + 1) / n

    def samples(n):
        return after(problem, n, np.round(n * problem.ts[1:]).astype(int))

    for times, values in (
        (every, lambda n: program(problem, every(n))),
        (lambda n: problem.ts, samples),
    ):
        made = [write_csv(tmp_path / f"{n}.csv", times(n), values(n), 1 / n) for n in STEPS]
        for run in read_runs(made, problem):
            assert np.array_equal(run.values, samples(round(1 / run.dt)))
