"""Right programs pass, wrong ones fail, and without enough evidence there is no verdict."""

from __future__ import annotations

import dataclasses
import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from trajectory_writing import csv_lines, node_values, write_csv

from ropeode import grade
from ropeode.checking import Layout, read_runs, samples_of, states_of
from ropeode.checking.written_precision import digits_of, last_digit, single_precision
from ropeode.errors import InputError
from ropeode.problems import PROBLEMS, InextensibleRope, Rope
from ropeode.simulation import simulate
from ropeode.theory import stability_limit

STEPS = (16, 24, 32, 48)


def verlet(x, v, dt, steps, number=np.float64, c=0.01):
    """Velocity Verlet for `small_rope`, in NumPy; shares nothing with the package."""
    k, length = number(100.0), number(400.0 / 3.0)

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

    a, dt, c = accelerations(x), number(dt), number(c)
    for _ in range(steps):
        v = v + number(0.5) * dt * (a - c * v)
        x = x + dt * v
        a = accelerations(x)
        v = (v + number(0.5) * dt * a) / (1 + number(0.5) * dt * c)
    return x, v


def frames_of(problem, dt, steps_in_frame, number=np.float64):
    """What a program prints that makes so many steps before each sample."""
    x, v = (number(node_values(problem, problem.y0[None])[0][:, i : i + 2]) for i in (0, 2))
    samples = [np.hstack([x, v])]
    for _ in range(problem.frames):
        x, v = verlet(x, v, dt, steps_in_frame, number, problem.args.damping[0])
        samples.append(np.hstack([x, v]))
    return np.array(samples)


def files(tmp_path, problem, values_of, steps=STEPS, times=None, **how):
    return [
        write_csv(
            tmp_path / f"{n}.csv",
            problem.ts if times is None else times(n),
            values_of(n),
            1 / n,
            **how,
        )
        for n in steps
    ]


def right(problem):
    return lambda n: frames_of(problem, 1 / n, n)


def finding(report, check):
    return next(each for each in report.findings if each.check == check)


def test_an_independent_verlet_is_right(tmp_path, small_rope, known):
    report = grade(files(tmp_path, small_rope, right(small_rope)), known, expected_order=2)
    assert report.passed
    assert report.notes == ()
    assert [each.status for each in report.findings] == ["pass", "pass", "pass", "skip"]
    for order in finding(report, "order").convergence.orders.values():
        assert order.observed == pytest.approx(2.0, abs=0.1)


def test_the_order_that_is_claimed_counts(tmp_path, small_rope, known):
    made = files(tmp_path, small_rope, right(small_rope))
    assert grade(made, known).passed
    report = grade(made, known, expected_order=3, diagnose=False)
    assert [each.check for each in report.failed] == ["order"]


ANY_RUNS = given(
    steps=st.lists(st.integers(14, 100), min_size=3, max_size=6, unique=True),
    part=st.sampled_from([0.0, 0.4, 0.75]),
    digits=st.sampled_from(["%.17g", "%.12g", "%.9g", "%.8f", "%.6g"]),
    velocities=st.booleans(),
)


@settings(max_examples=5, deadline=None)
@ANY_RUNS
def test_a_right_program_is_not_rejected(
    tmp_path_factory, small_rope, known, steps, part, digits, velocities
):
    """Whatever its step sizes and digits are: it passes, or they are too few for a verdict."""
    passes_or_is_undecided(tmp_path_factory, small_rope, known, steps, part, digits, velocities)


@pytest.mark.slow
@settings(max_examples=40, deadline=None)
@ANY_RUNS
def test_a_right_program_is_not_rejected_in_many_cases(
    tmp_path_factory, small_rope, known, steps, part, digits, velocities
):
    passes_or_is_undecided(tmp_path_factory, small_rope, known, steps, part, digits, velocities)


def passes_or_is_undecided(tmp_path_factory, small_rope, known, steps, part, digits, velocities):

    def values(n):
        return with_short_steps(small_rope, n)[1][:, :, : 4 if velocities else 2]

    made = files(
        tmp_path_factory.mktemp("right"),
        small_rope,
        values,
        [n + part for n in steps],
        times=lambda n: with_short_steps(small_rope, n)[0],
        digits=digits,
    )
    report = grade(made, known, expected_order=2)
    assert report.verdict != "wrong", report.failed[0].line
    assert report.passed or re.search(r"; (write|add|compute) ", finding(report, "order").line)


@pytest.mark.parametrize("off", [-1, 1])
def test_one_step_too_many_or_too_few(tmp_path, small_rope, known, off):
    made = files(tmp_path, small_rope, lambda n: frames_of(small_rope, 1 / n, n + off))
    report = grade(made, known, expected_order=2)
    assert [each.check for each in report.failed] == ["order"]
    words = f"the program makes one step too {'many' if off > 0 else 'few'} in each frame"
    assert [each.line.startswith(words) for each in report.diagnosis] == [True]
    assert grade(made, known, expected_order=2, diagnose=False).diagnosis == ()
    report = grade(made, known)
    assert report.passed
    assert report.notes[0].startswith(words)
    # The same where times are counted in steps.
    made = files(
        tmp_path,
        small_rope,
        lambda n: frames_of(small_rope, 1 / n, n + off),
        times=lambda n: np.arange(4) * (n + off) / n,
    )
    with pytest.raises(InputError, match="a sample at t = 1, which is missing") as caught:
        grade(made, known)
    (line,) = caught.value.problems
    assert line.endswith("So in 24.csv, 32.csv and 48.csv.")


UNEVEN = (16.4, 24.4, 32.4, 48.4)


def test_a_partial_step_that_is_skipped(tmp_path, small_rope, known):
    def skipping(n):
        return frames_of(small_rope, 1 / n, int(n))

    made = files(tmp_path, small_rope, skipping, UNEVEN)
    report = grade(made, known, expected_order=2)
    assert not report.passed
    assert [each.cause for each in report.diagnosis] == ["last-step"]
    assert "skips the last partial step" in report.diagnosis[0].line
    assert "dt = 0.0609756 does not divide the 1 between samples" in report.notes[0]
    made = files(tmp_path, small_rope, skipping, UNEVEN, times=lambda n: np.arange(4) * int(n) / n)
    with pytest.raises(InputError, match="t = 1 as|a sample at t = 1, which is missing"):
        grade(made, known)


@pytest.mark.parametrize(
    "words", ["from the step before it", "from the step after it", "beyond the end"]
)
def test_samples_that_are_not_at_their_time(tmp_path, small_rope, known, words):
    """Where dt does not divide a frame, programs stop too early or too late."""

    def values(n):
        x, v = np.split(node_values(small_rope, small_rope.y0[None])[0], 2, axis=1)
        samples, done = [np.hstack([x, v])], 0
        for frame in range(1, small_rope.frames + 1):
            wanted = {
                "from the step before it": math.floor(frame * n),
                "from the step after it": math.ceil(frame * n),
                "beyond the end": frame * math.ceil(n),
            }[words]
            x, v = verlet(x, v, 1 / n, wanted - done)
            samples.append(np.hstack([x, v]))
            done = wanted
        return np.array(samples)

    report = grade(files(tmp_path, small_rope, values, UNEVEN), known, expected_order=2)
    assert not report.passed
    assert [words in each.line for each in report.diagnosis] == [True]


@pytest.mark.parametrize("columns", [4, pytest.param(2, marks=pytest.mark.slow)])
def test_wrong_runs_are_diagnosed(tmp_path, small_rope, known, columns):
    """Of the numbers in the files: with velocities, and without."""
    undamped = Rope(num_nodes=4, damping=0.0).problem(frames=3)
    made = files(tmp_path, small_rope, lambda n: right(undamped)(n)[:, :, :columns])
    report = grade(made, known)
    assert [each.check for each in report.failed] == ["order"]
    (diagnosis,) = report.diagnosis
    assert diagnosis.cause == "parameters"
    assert "damping 0 instead of 0.01" in diagnosis.line
    # A right program is not looked at.
    assert grade(files(tmp_path, small_rope, right(small_rope)), known).diagnosis == ()


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
    made = files(
        tmp_path,
        small_rope,
        lambda n: node_values(small_rope, simulate(small_rope, stepper, n).states),
        (512, 1024, 2048),
    )
    report = grade(made, known, expected_order=2)
    assert not report.passed
    said = " ".join(each.line for each in report.diagnosis)
    assert re.search(rf"half a step (later, t \+|earlier, t -) dt/2, .*{words}", said)


def with_short_steps(problem, n):
    """Times and samples of every step, the last in a frame shorter."""
    x, v = np.split(node_values(problem, problem.y0[None])[0], 2, axis=1)
    times, samples = [0.0], [np.hstack([x, v])]
    for frame in range(problem.frames):
        whole = math.ceil(n) - 1
        for i in range(whole + 1):
            end = frame + 1.0 if i == whole else frame + (i + 1) / n
            x, v = verlet(x, v, end - times[-1], 1)
            times.append(end)
            samples.append(np.hstack([x, v]))
    return np.array(times), np.array(samples)


def test_a_shorter_step_where_dt_does_not_divide(tmp_path, small_rope, known):
    made = files(
        tmp_path,
        small_rope,
        lambda n: with_short_steps(small_rope, n)[1],
        UNEVEN,
        times=lambda n: with_short_steps(small_rope, n)[0],
    )
    report = grade(made, known, expected_order=2)
    assert report.passed
    assert report.notes == ()


def test_pins(tmp_path, small_rope, known):
    def moving(n):
        values = frames_of(small_rope, 1 / n, n)
        values[2, 0, 1] += 1e-6
        return values

    report = grade(files(tmp_path, small_rope, moving), known, diagnose=False)
    assert finding(report, "pins").status == "fail"
    assert "pinned node 0 is 1.0e-06 away from its place at t = 2" in finding(report, "pins").line


def test_runs_that_blew_up(tmp_path, small_rope, known):
    def huge(n):
        values = frames_of(small_rope, 1 / n, n)
        values[:, 1:] *= 1 + 1e200 * np.arange(4)[:, None, None]
        return values

    report = grade(files(tmp_path, small_rope, huge), known, diagnose=False)
    assert (report.verdict, report.exit_code) == ("undetermined", 2)
    line = finding(report, "order").line
    assert line.startswith("unstable at dt = 0.0625, 0.04167, 0.03125 and 0.02083")
    assert line.endswith(
        "add runs with 96, 192 and 384 steps per frame (dt <= 0.0104) to begin with"
    )


def test_a_right_method_that_is_unstable_is_not_wrong(tmp_path, small_rope, known):
    def euler(n):
        return node_values(small_rope, simulate(small_rope, "explicit-euler", n).states)

    made = files(tmp_path, small_rope, euler, (8, 16, 24))
    report = grade(made, known, method="explicit-euler")
    assert (report.verdict, report.exit_code) == ("undetermined", 2)
    line = finding(report, "order").line
    assert "; before that of order 1.07 [0.88, 1.27] in position over the first 2 frames" in line
    assert "; the positions agree with those of explicit-euler; add runs with" in line


@pytest.mark.slow
def test_an_unstable_method_that_is_not_known(tmp_path, small_rope, known):
    """With another damping it is no stepper of ropeode on this rope."""
    other = Rope(num_nodes=4, damping=0.5).problem(frames=3)

    def euler(n):
        return node_values(other, simulate(other, "explicit-euler", n).states)

    made = files(tmp_path, small_rope, euler, (8, 12, 16))
    line = finding(grade(made, known, method="explicit-euler"), "order").line
    limit = stability_limit(small_rope, "explicit-euler")
    assert f"; explicit-euler is stable here from {limit} steps per frame on; add runs" in line
    # An order that is claimed may be that of several methods.
    line = finding(grade(made, known, expected_order=2), "order").line
    assert "velocity-verlet is stable here from" in line
    assert "explicit-euler" not in line


def test_a_wrong_program_that_blows_up_is_wrong(tmp_path, small_rope, known):
    """Its runs agree with each other on another motion."""
    pulled = small_rope.changed(args=small_rope.args._replace(gravity=np.array([[0.0], [9e3]])))

    def values(n):
        return node_values(pulled, simulate(pulled, "velocity-verlet", n).states)

    report = grade(files(tmp_path, pulled, values, (64, 96, 128)), known, diagnose=False)
    assert report.verdict == "wrong"
    assert "wrong limit of positions" in finding(report, "order").line


def test_four_coarse_runs_of_order_4_do_not_decide(tmp_path, small_rope, known):
    def values(n):
        return node_values(small_rope, simulate(small_rope, "rk4", n).states)

    report = grade(files(tmp_path, small_rope, values, (8, 12, 16, 20)), known, expected_order=4)
    assert report.verdict == "undetermined"
    line = finding(report, "order").line
    assert "which holds the orders 2 to 5" in line
    assert re.search(
        r"agree with those of rk4; add a run with 40 steps per frame, with which", line
    )


def undecided(made, known, order):
    """The line of the order, where it decides nothing."""
    report = grade(made, known, expected_order=order)
    assert report.verdict == "undetermined"
    return finding(report, "order").line


def test_few_digits_are_no_fault_of_the_stepper(tmp_path, small_rope, known):
    made = files(tmp_path, small_rope, right(small_rope), digits="%.5g")
    assert undecided(made, known, 2).endswith(
        "the numbers have 5 digits; write 17 digits, with std::setprecision(17) or %.17g"
    )
    made = files(tmp_path, small_rope, right(small_rope), digits="%.9f")
    assert grade(made, known, expected_order=2).passed


def test_nor_is_single_precision(tmp_path, small_rope, known):
    made = files(
        tmp_path,
        small_rope,
        lambda n: frames_of(small_rope, 1 / n, n, np.float32),
        (256, 512, 1024),
        digits="%.9g",
    )
    assert "the numbers are in single precision; compute in double" in undecided(made, known, 2)


def test_nor_are_step_sizes_that_show_nothing(tmp_path, small_rope, known):
    def values(n):
        off = {16: 1e-3, 20: 3e-3, 150: 1e-4}[n]
        return (
            frames_of(small_rope, 1 / 256, 256)
            + off * small_rope.args.free[:, None] * (np.arange(4)[:, None, None])
        )

    made = files(tmp_path, small_rope, values, (16, 20, 150))
    assert undecided(made, known, 1).endswith(
        "add runs with 300, 600 and 1200 steps per frame to begin with"
    )


def test_nor_are_step_sizes_that_are_too_close(tmp_path, small_rope, known):
    made = files(tmp_path, small_rope, right(small_rope), (76, 77, 78), digits="%.8f")
    assert "the step sizes show no order" in undecided(made, known, 2)


def test_nor_is_round_off(tmp_path, small_rope, known):
    """The position form of Störmer and Verlet, at steps so fine that its error grows again."""

    def values(n):
        return node_values(small_rope, simulate(small_rope, "stormer-verlet", n).states)

    fine, coarse = (4096, 8192, 16384), (32, 64, 128)
    line = undecided(files(tmp_path, small_rope, values, fine), known, 2)
    assert "errors are so small that round-off" in line
    assert re.search("add runs with 16, 32 and 64 steps per frame, with which they show", line)
    report = grade(files(tmp_path, small_rope, values, (*coarse, *fine)), known, expected_order=2)
    assert report.passed


@pytest.mark.parametrize(("digits", "unit"), [("%.6g", 5e-4), ("%.8f", 5e-9), ("%.4e", 5e-3)])
def test_how_many_digits_there_are(digits, unit):
    values = np.array([float(digits % x) for x in np.random.default_rng(1).normal(size=999) * 100])
    assert unit <= last_digit(values) <= 1.01 * unit
    assert not single_precision(values)


def test_digits_and_decimals_of_numbers_with_an_exponent():
    assert digits_of(np.array([1.25e-7, 3e20])) == (3, 9)


def test_full_and_single_precision_are_distinguished():
    values = np.random.default_rng(2).normal(size=999)
    assert digits_of(values)[0] >= 16
    assert last_digit(values) == 0.0
    assert not single_precision(values)
    single = values.astype(np.float32)
    assert single_precision(single.astype(np.float64))
    assert single_precision(np.array([float(f"{x:.9g}") for x in single]))
    assert not single_precision(np.arange(5.0))


STARTS = {
    "reverse order": lambda v: v[:, ::-1],
    "x before y": lambda v: v[:, :, [1, 0, 3, 2]],
    r"positions are shifted by \(1, 2\)": lambda v: v + np.array([1.0, 2.0, 0.0, 0.0]),
    "y points the other way": lambda v: v * np.array([1.0, -1.0, 1.0, -1.0]),
    "start from the initial state": lambda v: v + np.arange(4.0)[:, None],
}


@pytest.mark.parametrize("words", STARTS)
def test_another_initial_state(tmp_path, small_rope, known, words):
    made = files(tmp_path, small_rope, lambda n: STARTS[words](right(small_rope)(n)))
    with pytest.raises(InputError, match=rf"16.csv, initial state, node \d \(v?[xy]\): .*{words}"):
        grade(made, known)


def test_an_initial_state_in_single_precision(tmp_path, small_rope, known):
    """All else is computed in double precision."""

    def values(n):
        samples = right(small_rope)(n)
        samples[0] = samples[0].astype(np.float32)
        return samples

    with pytest.raises(InputError, match="it is right in single precision. Fix: compute it in d"):
        grade(files(tmp_path, small_rope, values), known)


def test_the_state_after_the_first_step(tmp_path, small_rope, known):
    def late(n):
        values = frames_of(small_rope, 1 / n, n)
        values[0] = np.hstack(verlet(*np.split(values[0], 2, axis=1), 1 / n, 1))
        return values

    with pytest.raises(InputError, match="the first row is the state after the first step"):
        grade(files(tmp_path, small_rope, late), known)
    made = files(tmp_path, small_rope, right(small_rope), times=lambda n: np.arange(4) + 1 / n)
    with pytest.raises(InputError, match="the initial state is written at t = dt, and each row as"):
        grade(made, known)


def test_one_of_another_problem(tmp_path, small_rope, known):
    made = files(tmp_path, small_rope, right(small_rope))
    other = Rope(num_nodes=4, end=(-300.0, 200.0)).problem(frames=3)
    made[2] = files(tmp_path, other, lambda n: frames_of(other, 1 / n, n), (64,))[0]
    with pytest.raises(InputError) as caught:
        grade(made, known)
    assert len(caught.value.problems) == 1
    assert "64.csv, initial state, node 1 (x): -100.0 given" in caught.value.problems[0]


def test_step_sizes(tmp_path, small_rope, known):
    made = files(tmp_path, small_rope, right(small_rope))
    for dts, words in (
        ([0.5] * 3, "dt: 3 given; allowed: one for each of the 4 files"),
        ([0.5] * 4, "0.5 given; allowed: 0.0625, the dt in the file"),
        (
            [0.0625, "abc", -1, float("nan")],
            "'abc' is not a number.*\n.*above zero.*\n.*not finite",
        ),
    ):
        with pytest.raises(InputError, match=words):
            grade(made, known, dts)
    with pytest.raises(InputError, match="another has|has this one too"):
        grade([*made, made[0]], known)
    values, text = frames_of(small_rope, 1 / 16, 16), []
    for name, dt in (("without", None), ("too-long", 1.5)):
        text.append(tmp_path / f"{name}.csv")
        text[-1].write_text("\n".join([*csv_lines(small_rope.ts, values, dt), ""]))
    with pytest.raises(InputError, match="without.csv, dt: 'none' given.* '# dt = 0.01'"):
        grade([*made, text[0]], known)
    with pytest.raises(InputError, match="dt: 1.5 given; allowed: at most 1, the time between"):
        grade([*made, text[1]], known)


def test_velocities_in_some_files_only(tmp_path, small_rope, known):
    made = files(tmp_path, small_rope, right(small_rope))
    made[1] = files(tmp_path, small_rope, lambda n: right(small_rope)(n)[:, :, :2], (20,))[0]
    with pytest.raises(InputError, match="velocities in all files, or in none"):
        grade(made, known)


def test_energy_is_noted_where_it_is_conserved(tmp_path, known):
    problem = Rope(num_nodes=4, damping=0.0).problem(frames=64)
    # The first samples show that it is conserved; these are right to 14 digits.
    solved = dataclasses.replace(
        known, problem=problem, states=simulate(problem, "rk4", 1024).states
    )

    made = files(tmp_path, problem, right(problem), (12, 16, 24))
    found = finding(grade(made, solved, diagnose=False), "energy")
    assert found.status == "note"
    assert [each["verdict"] for each in found.evidence.values()] == ["bounded", "bounded"]
    assert found.line.startswith("dt 0.0833333: energy stays within")
    damped = finding(grade(files(tmp_path, known.problem, right(known.problem)), known), "energy")
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
    problem = dataclasses.replace(small_rope, ts=np.array([0.0, 0.5, 1.5, 1.75]))

    def every_step(n):
        x, v = np.split(node_values(problem, problem.y0[None])[0], 2, axis=1)
        samples = [np.hstack([x, v])]
        for _ in range(round(1.75 * n)):
            x, v = verlet(x, v, 1 / n, 1)
            samples.append(np.hstack([x, v]))
        return np.array(samples)

    def times(n):
        return np.arange(round(1.75 * n) + 1) / n

    def wanted(run):
        n = round(1 / run.dt)
        return every_step(n)[np.isin(times(n), problem.ts)]

    made = files(tmp_path, problem, every_step, times=times)
    assert all(np.array_equal(run.values, wanted(run)) for run in read_runs(made, problem))
    # The samples alone, at unequal distances.
    few = files(
        tmp_path,
        problem,
        lambda n: every_step(n)[np.isin(times(n), problem.ts)],
        times=lambda n: problem.ts,
    )
    assert all(np.array_equal(run.values, wanted(run)) for run in read_runs(few, problem))
