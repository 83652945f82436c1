"""What is brought: the ways in, and everything that can be wrong with it."""

from __future__ import annotations

import contextlib
import os
import random
import subprocess
import sys
import textwrap
import threading
import time

import jax.numpy as jnp
import numpy as np
import pytest

from ropeode.checking import (
    CHECKS,
    check_stepper,
    convergence_problems,
    reference_of,
)
from ropeode.errors import InputError, ReferenceRefused, UserCodeError
from ropeode.render import format_check
from ropeode.simulation import method_of, on_user_clock, simulate
from tests.checking import steps


def method(step, name="driven"):
    return method_of(step, convergence_problems()[name])


def in_jax(acceleration, t, x, v, dt, args):
    v = v + dt * acceleration(t, x, v, args)
    return x + dt * v, v


@pytest.mark.parametrize(
    ("step", "compiled"), [(in_jax, True), (steps.in_loops, False), (steps.rk4, True)]
)
def test_what_jax_can_trace_is_compiled(step, compiled):
    assert method(step).trial.compiled is compiled


@pytest.mark.parametrize("name", ["uneven", "driven"])
def test_both_drivers_make_the_same_states(name):
    """One stepper, written three times, in JAX and in Python."""
    problem = convergence_problems()[name]
    known = simulate(problem, "semi-implicit-euler", 12).states
    for step in (in_jax, steps.in_loops, "semi-implicit-euler"):
        states = simulate(problem, step, 12).states
        assert np.max(np.abs(states - known)) < 1e-13


def test_own_forces_are_found_out():
    assert not method(steps.own_forces).trial.asks_for_forces
    assert method(steps.in_loops).trial.asks_for_forces


def test_a_file_and_a_name(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text("def step(rhs, t, y, dt, args):\n    return y + dt * rhs(t, y, args)\n")
    report = check_stepper(f"{file}:step", 1, only=["order-driven"])
    assert report.passed
    assert report.label.endswith("mine.py:step")


def raises(acceleration, t, x, v, dt, args):
    return undefined_name  # noqa: F821


def leaves(acceleration, t, x, v, dt, args):
    raise SystemExit(3)


def too_few_nodes(acceleration, t, x, v, dt, args):
    return x[:-1], v


def positions_only(acceleration, t, x, v, dt, args):
    return x


def three_things(acceleration, t, x, v, dt, args):
    return x, v, v


def single_precision(acceleration, t, x, v, dt, args):
    return x.astype(np.float32), v


def whole_numbers(acceleration, t, x, v, dt, args):
    return np.zeros(x.shape, dtype=np.int64), v


def not_a_number(acceleration, t, x, v, dt, args):
    return np.nan * x, v


def too_late(acceleration, t, x, v, dt, args):
    if t > 0.5:
        raise ValueError("too late")
    v = v + dt * acceleration(t, x, v, args)
    return x + dt * v, v


@pytest.mark.parametrize(
    ("step", "words"),
    [
        (raises, "NameError: name 'undefined_name' is not defined"),
        (leaves, "SystemExit: 3"),
        (too_few_nodes, r"x of shape \(4, 3\); allowed: .*\(5, 3\)"),
        (positions_only, r"ndarray of shape \(5, 3\)"),
        (three_things, "tuple of length 3"),
        (single_precision, "x of type float32; allowed: float64"),
        (whole_numbers, "x of type int64; allowed: float64"),
        (not_a_number, "not finite"),
        (too_late, "ValueError: too late"),
    ],
)
def test_what_is_no_step_is_refused(step, words):
    with pytest.raises(UserCodeError, match=words) as raised:
        check_stepper(step, 1)
    assert "Fix:" in str(raised.value)


def hangs(acceleration, t, x, v, dt, args):
    while True:
        pass


def hangs_later(acceleration, t, x, v, dt, args):
    while t > 0.9:
        pass
    v = v + dt * acceleration(t, x, v, args)
    return x + dt * v, v


def catches_all(acceleration, t, x, v, dt, args):
    while True:
        with contextlib.suppress(BaseException):
            t = t + 1.0


@pytest.mark.parametrize(
    "step", [pytest.param(hangs, marks=pytest.mark.slow), hangs_later, catches_all]
)
def test_a_step_that_never_returns_is_given_up(step, monkeypatch):
    # On a busy machine, too, its processor time ends it, not the time on the clock.
    monkeypatch.setattr("ropeode.checking.time_limit._WAITING", 1e6)
    with pytest.raises(UserCodeError, match=r"did not finish within 0\.3 s of processor time"):
        check_stepper(step, 1, time_limit=0.3)


def test_a_step_that_waits_in_compiled_code_is_given_up_and_keeps_nobody_waiting():
    """Nothing in Python ends the wait for a lock."""
    lock = threading.Lock()

    def waits(acceleration, t, x, v, dt, args):
        with lock:
            return steps.in_loops(acceleration, t, x, v, dt, args)

    with lock:
        with pytest.raises(UserCodeError, match=r"did not finish within 0\.3 s: the step used"):
            check_stepper(waits, 1, time_limit=0.03)
        assert check_stepper(steps.in_loops, 1, only=["pins"]).passed
    # A check of its own goes on as soon as its lock is free.
    assert check_stepper(waits, 1, only=["pins"]).passed


def test_a_step_that_waits_is_not_taken_for_one_that_hangs():
    """As on a busy machine: what counts is what it computes."""

    def patient(acceleration, t, x, v, dt, args):
        time.sleep(0.001)
        return steps.in_loops(acceleration, t, x, v, dt, args)

    began = time.monotonic()
    assert check_stepper(patient, 1, only=["pins"], time_limit=0.2).passed
    assert time.monotonic() - began > 0.2


def test_what_ropeode_computes_does_not_count(monkeypatch):
    def slow(examination):
        until = time.thread_time() + 0.5
        while time.thread_time() < until:
            pass
        return CHECKS["pins"](examination)

    monkeypatch.setitem(CHECKS, "zero-length", slow)
    assert check_stepper(steps.in_loops, 1, only=["zero-length"], time_limit=0.3).passed


def wrong(acceleration, t, x, v, dt, args):
    v = v + 0.9 * dt * acceleration(t, x, v, args)
    return x + dt * v, v


def wrong_and_raises(acceleration, t, x, v, dt, args):
    # Those of the checks are known; the diagnosis has others.
    if tuple(args.mass) not in {tuple(each.args.mass) for each in convergence_problems().values()}:
        raise ValueError("another rope")
    return wrong(acceleration, t, x, v, dt, args)


def test_a_report_stands_if_the_diagnosis_does_not_finish(monkeypatch):
    """Neither the step's runs in it, nor what it computes itself."""
    ended, long_enough = threading.Event(), 60.0

    def hangs_in_the_step(examination):
        on_user_clock(hangs, *6 * [None])

    def hangs_by_itself(examination):
        ended.wait(long_enough)

    monkeypatch.setattr("ropeode.checking.time_limit._WAITING", 1e6)
    for diagnose, limit, words in (
        (hangs_in_the_step, 0.3, "within 0.3 s of processor time in the step; raise the"),
        (hangs_by_itself, 1.0, "within 0.5 s, of which 0 s were processor time in the step"),
    ):
        monkeypatch.setattr("ropeode.checking.diagnosis.stepper.diagnose_stepper", diagnose)
        seconds = 0.5 if diagnose is hangs_by_itself else 1e6
        monkeypatch.setattr("ropeode.checking.check._DIAGNOSIS", seconds)
        report = check_stepper(wrong, 1, only=["order-textbook"], time_limit=limit)
        assert [finding.check for finding in report.failed] == ["order-textbook"]
        (diagnosis,) = report.diagnosis
        assert diagnosis.cause == "unfinished"
        assert words in diagnosis.line
        assert "Diagnosis (unfinished)" in format_check(report, "text")
    ended.set()


def test_a_report_stands_if_the_step_raises_in_the_diagnosis():
    report = check_stepper(wrong_and_raises, 1, only=["order-driven"])
    assert not report.passed
    (diagnosis,) = report.diagnosis
    assert diagnosis.cause == "unfinished"
    assert "ValueError: another rope" in diagnosis.line


@pytest.mark.parametrize("error", [KeyboardInterrupt, RuntimeError, ReferenceRefused])
def test_only_a_reference_or_its_refusal_is_kept(monkeypatch, error):
    asked = []

    def refuses(problem):
        asked.append(problem)
        raise error("why")

    monkeypatch.setattr("ropeode.checking.check_context.reference_for", refuses)
    rope = convergence_problems()["textbook"].changed(name=f"never asked for: {error.__name__}")
    for _ in range(2):
        with pytest.raises(error, match="why"):
            reference_of(rope)
    assert len(asked) == (1 if error is ReferenceRefused else 2)
    monkeypatch.setattr(
        "ropeode.checking.check_context.reference_for", lambda problem: "a reference"
    )
    if error is not ReferenceRefused:
        assert reference_of(rope) == "a reference"


@pytest.mark.slow
def test_a_process_may_end_while_references_are_made_ahead():
    """It was aborted, where a thread was compiling one."""
    code = (
        "import time\n"
        "from ropeode import UserCodeError, check_stepper\n"
        "def step(rhs, t, y, dt, args): return 0 * y / 0\n"
        "try: check_stepper(step)\n"
        "except UserCodeError: time.sleep(1.5)\n"
    )
    without_cache = {k: v for k, v in os.environ.items() if k != "JAX_COMPILATION_CACHE_DIR"}
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120, env=without_cache)


def prints(acceleration, t, x, v, dt, args):
    print("at", t)  # noqa: T201
    v = v + dt * acceleration(t, x, v, args)
    return x + dt * v, v


def test_what_a_step_prints_is_kept_from_the_report(capsys):
    report = check_stepper(prints, 1, only=["pins"])
    assert report.passed
    assert "its first line: 'at 0.4'" in report.notes[0]
    assert capsys.readouterr().out == ""


def test_writing_to_args_is_found():
    report = check_stepper(steps.writes_to_args, 1, only=["purity"])
    assert "the step modifies args" in report.findings[0].line


def own_arrays(count, returned=lambda array: array):
    """A step that computes in so many arrays in turn, which are its own."""
    arrays, calls = np.empty((count, 2, 5, 3)), [0]

    def step(acceleration, t, x, v, dt, args):
        calls[0] += 1
        own = arrays[calls[0] % count]
        new_v = v + dt * acceleration(t, x, v, args)
        own[:] = x + dt * new_v, new_v
        return tuple(map(returned, own))

    return step


def recognises(known):
    """A step that takes what it knows of a state from its last call."""
    last = {}

    def step(acceleration, t, x, v, dt, args):
        if not (last and known(last, x)):
            last["a"] = np.array(acceleration(t, x, v, args))
        new_v = v + dt * last["a"]
        new_x = x + dt * new_v
        last.update(x=new_x, is_x=new_x.copy(), a=np.array(acceleration(t + dt, new_x, 0, args)))
        return new_x, new_v

    return step


def leaves_the_folder(rhs, t, y, dt, args):
    os.chdir("/")
    return y + dt * np.asarray(rhs(t, y, args))


def seeds(rhs, t, y, dt, args):
    np.random.seed(0)  # noqa: NPY002
    return y + dt * np.asarray(rhs(t, y, args))


def shuffles(rhs, t, y, dt, args):
    random.shuffle([1, 2])
    return y + dt * np.asarray(rhs(t, y, args))


def hides_errors(rhs, t, y, dt, args):
    np.seterr(all="ignore")
    return y + dt * np.asarray(rhs(t, y, args))


def guards_errors(rhs, t, y, dt, args):
    with np.errstate(all="raise"):
        return y + dt * np.asarray(rhs(t, y, args))


def replaces_standard_output(rhs, t, y, dt, args):
    sys.stdout = None  # type: ignore[assignment]
    return y + dt * np.asarray(rhs(t, y, args))


def closes_standard_output(rhs, t, y, dt, args):
    print("closing")  # noqa: T201
    sys.stdout.close()
    return y + dt * np.asarray(rhs(t, y, args))


@pytest.mark.parametrize(
    ("step", "words"),
    [
        (own_arrays(1), "modifies x or v"),
        (own_arrays(2), "writes over results that it returned before"),
        (own_arrays(3), "writes over results that it returned before"),
        (own_arrays(64), "writes over results that it returned before"),
        (own_arrays(1, np.copy), None),
        (recognises(lambda last, x: last["x"] is x), "keeps arrays"),
        (recognises(lambda last, x: np.shares_memory(last["x"], x)), "keeps arrays"),
        (recognises(lambda last, x: np.array_equal(last["is_x"], x)), None),
        (steps.writes_to_args, "modifies args"),
        (leaves_the_folder, "changes the working directory"),
        (seeds, "draws or seeds the random numbers that all of NumPy shares"),
        (shuffles, "draws or seeds the random numbers that all of Python shares"),
        (hides_errors, "changes what NumPy does about floating-point errors"),
        (guards_errors, None),
        (replaces_standard_output, "replaces sys.stdout"),
        (steps.in_loops, None),
    ],
)
def test_what_a_step_does_besides_returning_a_result_is_found(step, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdout", sys.stdout)
    found = method(step).trial.side_effects
    if words is None:
        assert found == ()
    else:
        assert found[0].startswith(words)


def exits_at_short_steps(rhs, t, y, dt, args):
    if dt < 1e-5:
        sys.exit(0)
    return y + dt * np.asarray(rhs(t, y, args))


def test_a_step_that_would_end_its_process_far_from_usual_is_not_passed():
    with pytest.raises(UserCodeError, match="SystemExit"):
        check_stepper(exits_at_short_steps, 1, only=["scales"])


def test_a_step_that_obeys_a_threshold_now_and_then_has_hidden_state():
    calls = [0]

    def step(rhs, t, y, dt, args):
        calls[0] += 1
        return y + dt * np.asarray(rhs(t, y, args)) * (1.01 if calls[0] % 701 == 700 else 1.0)

    (finding,) = check_stepper(step, 1, only=["determinism"]).findings
    assert finding.status == "fail"
    assert finding.line.startswith("not deterministic")


def test_a_result_in_extended_precision_is_a_state():
    def step(rhs, t, y, dt, args):
        return np.longdouble(y) + np.longdouble(dt) * np.asarray(rhs(t, y, args))

    assert check_stepper(step, 1, only=["first-sample"]).passed


def test_a_step_that_closes_standard_output_has_failed_a_check():
    """In a thread of its own: what pytest captures stays open."""
    with pytest.raises(UserCodeError, match="closed file"):
        check_stepper(closes_standard_output, 1, only=["purity"])


@pytest.mark.parametrize(
    ("given", "words"),
    [
        (3, "a step function, a Stepper"),
        (int, "a step function, a Stepper"),
        (lambda a, b: a, r"its parameters are \(a, b\)"),
        (lambda acceleration, x, v, t, dt, args: x, "Fix: write one of these"),
        ("rk5", "did you mean 'rk4'"),
        (
            "constraint-verlet",
            "this one moves nodes link by link.*Fix: see its order with: ropeode table",
        ),
        ("nowhere.py:step", "No such file"),
        ("x.py", "No such file"),
    ],
)
def test_what_cannot_be_a_stepper_is_refused(given, words):
    with pytest.raises(InputError, match=words):
        check_stepper(given)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"expected_order": 0}, "expected_order: 0"),
        ({"expected_order": "two"}, "expected_order: 'two'"),
        ({"expected_order": 2, "method": "rk4"}, "none beside a method"),
        ({"method": "rk5"}, "did you mean 'rk4'"),
        ({"only": ["pin"]}, "did you mean 'pins'"),
        ({"skip": "nonsense"}, "check: 'nonsense'"),
        ({"only": ["pins"], "skip": ["pins"]}, "at least one check"),
        ({"time_limit": -1}, "time_limit: -1"),
    ],
)
def test_wrong_arguments_are_refused_before_anything_runs(settings, words):
    with pytest.raises(InputError, match=words):
        check_stepper(raises, **settings)


def test_a_file_that_raises_shows_whose_fault_it_is(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(textwrap.dedent("import nonexistent_package\n"))
    with pytest.raises(UserCodeError, match="nonexistent_package"):
        check_stepper(f"{file}:step")


def test_jax_arrays_are_float64_inside():
    seen = []

    def step(rhs, t, y, dt, args):
        seen.append(jnp.asarray(y).dtype)
        return y + dt * rhs(t, y, args)

    check_stepper(step, 1, only=["pins"])
    assert set(map(str, seen)) == {"float64"}
