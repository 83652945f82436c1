"""What is brought: the ways in, and everything that can be wrong with it."""

from __future__ import annotations

import contextlib
import io
import json
import os
import random
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

from ropeode.checking import CHECKS, check_stepper, reference_of
from ropeode.errors import InputError, UserCodeError
from ropeode.render import format_check
from ropeode.simulation import on_user_clock
from tests.checking import steps
from tests.checking.mutants.all import MUTANTS
from tests.checking.mutants.kept import in_own_arrays, last_acceleration
from tests.checking.no_time_limit import SECONDS
from tests.time_limit import HANGS_AFTER_S


def returning(result):
    """A step that does not do what a step does."""
    return lambda acceleration, t, x, v, dt, args: result(x, v)


def raises(acceleration, t, x, v, dt, args):
    return undefined_name  # noqa: F821  # pyright: ignore


def too_late(rhs, t, y, dt, args):
    if t > 0.5:
        raise ValueError("too late")
    return steps.euler(rhs, t, y, dt, args)


@pytest.mark.parametrize(
    ("step", "words"),
    [
        (raises, "NameError: name 'undefined_name' is not defined"),
        (returning(lambda x, v: sys.exit(3)), "SystemExit: 3"),
        (returning(lambda x, v: (x[:-1], v)), r"x of shape \(4, 3\); allowed: .*\(5, 3\)"),
        (returning(lambda x, v: x), r"ndarray of shape \(5, 3\)"),
        (returning(lambda x, v: (x, v, v)), "tuple of length 3"),
        (returning(lambda x, v: (np.float32(x), v)), "x of type float32; allowed: float64"),
        (returning(lambda x, v: (np.zeros(x.shape, int), v)), "x of type int64; allowed: float64"),
        (returning(lambda x, v: (np.nan * x, v)), "not finite"),
        (too_late, "ValueError: too late"),
    ],
)
def test_what_is_no_step_is_refused(step, words):
    with pytest.raises(UserCodeError, match=words) as raised:
        check_stepper(step, 1)
    assert "Fix:" in str(raised.value)


def hangs(rhs, t, y, dt, args):
    while t > 0.9:
        pass
    return steps.euler(rhs, t, y, dt, args)


def catches_all(rhs, t, y, dt, args):
    while True:
        with contextlib.suppress(BaseException):
            t = t + 1.0


@pytest.mark.parametrize("step", [hangs, catches_all])
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
        until = time.thread_time() + 0.3
        while time.thread_time() < until:
            pass
        return CHECKS["pins"](examination)

    monkeypatch.setitem(CHECKS, "zero-length", slow)
    assert check_stepper(steps.in_loops, 1, only=["zero-length"], time_limit=0.2).passed


def test_a_report_stands_whatever_becomes_of_the_diagnosis(monkeypatch):
    """Neither the step's runs in it need end, nor what it computes itself; and it may raise."""
    wrong, ended = MUTANTS["own_euler: mass of the first node"].make(), threading.Event()

    def raises_something(_):
        raise UserCodeError("another rope")

    monkeypatch.setattr("ropeode.checking.time_limit._WAITING", 1e6)
    for diagnose, limit, seconds, words in (
        (lambda _: on_user_clock(hangs, *5 * [1.0]), 0.3, 1e6, "within 0.3 s of processor time"),
        (lambda _: ended.wait(60.0), 1.0, 0.5, "within 0.5 s, of which 0 s were processor time"),
        (raises_something, 1e6, 1e6, "another rope"),
    ):
        monkeypatch.setattr("ropeode.checking.diagnosis.stepper.diagnose_stepper", diagnose)
        monkeypatch.setattr("ropeode.checking.check._DIAGNOSIS", seconds)
        report = check_stepper(wrong, 1, only=["node-order"], time_limit=limit)
        assert [finding.check for finding in report.failed] == ["node-order"]
        (diagnosis,) = report.diagnosis
        assert diagnosis.cause == "unfinished"
        assert words in diagnosis.line
        assert "Diagnosis (unfinished)" in format_check(report, "text")
    ended.set()


def test_a_check_that_is_left_off_ends_in_a_step_that_does_not():
    begun, ended = threading.Event(), threading.Event()

    def hangs(rhs, t, y, dt, args):
        begun.set()
        try:
            while True:
                pass
        finally:
            ended.set()

    def progress(*_):
        if begun.is_set():
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        check_stepper(hangs, only=["purity"], time_limit=HANGS_AFTER_S, progress=progress)
    assert ended.wait(HANGS_AFTER_S)


@pytest.mark.slow
def test_a_reference_that_fails_is_computed_by_whoever_asks_next(monkeypatch, small_rope):
    def fails(problem):
        raise MemoryError

    with monkeypatch.context() as patch:
        patch.setattr("ropeode.checking.check_context.reference_for", fails)
        with pytest.raises(MemoryError):
            reference_of(small_rope)
    assert reference_of(small_rope) is reference_of(small_rope)


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


def doing(something):
    """Euler's method, and something else in each step."""

    def step(rhs, t, y, dt, args):
        something()
        return y + dt * np.asarray(rhs(t, y, args))

    return step


def test_what_a_step_prints_is_kept_from_the_report(capsys):
    report = check_stepper(doing(lambda: sys.stdout.write("at last\n")), 1, only=["pins"])
    assert report.passed
    assert "its first line: 'at last'" in report.notes[0]
    assert capsys.readouterr().out == ""


def in_long_double(rhs, t, y, dt, args):
    return np.longdouble(y) + np.longdouble(dt) * np.asarray(rhs(t, y, args))


@np.errstate(all="raise")
def guards_errors(rhs, t, y, dt, args):
    return y + dt * np.asarray(rhs(t, y, args))


def closes_standard_output():
    print("closing")  # noqa: T201
    sys.stdout.close()


@pytest.mark.parametrize(
    ("step", "words"),
    [
        (in_own_arrays(1)(), "modifies x or v"),
        (in_own_arrays(2)(), "writes over results that it returned before"),
        (in_own_arrays(64)(), "writes over results that it returned before"),
        (last_acceleration(lambda last, x: last is x)(), "keeps arrays"),
        (last_acceleration(np.shares_memory)(), "keeps arrays"),
        (steps.writes_to_args, "modifies args"),
        (doing(lambda: os.chdir("/")), "changes the working directory"),
        (doing(lambda: np.random.seed(0)), "random numbers that all of NumPy shares"),  # noqa: NPY002
        (doing(lambda: random.shuffle([1, 2])), "random numbers that all of Python shares"),
        (doing(lambda: np.seterr(all="ignore")), "what NumPy does about floating-point errors"),
        (doing(lambda: setattr(sys, "stdout", None)), "replaces sys.stdout"),
        # As a check in another thread does, which keeps its output.
        (doing(lambda: setattr(sys, "stdout", io.StringIO())), ""),
        (last_acceleration(np.array_equal, np.copy)(), ""),
        (guards_errors, ""),
        (in_long_double, ""),
    ],
)
def test_what_a_step_does_besides_returning_a_result_is_found(step, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "stdout", sys.stdout)
    (finding,) = check_stepper(step, 1, only=["purity"]).findings
    assert finding.status == ("fail" if words else "pass")
    assert words in finding.line


def exits_at_short_steps(rhs, t, y, dt, args):
    return sys.exit(0) if dt < 1e-5 else y + dt * np.asarray(rhs(t, y, args))


@pytest.mark.parametrize(
    ("step", "check", "words"),
    [
        (exits_at_short_steps, "thresholds", "SystemExit"),
        # In a thread of its own: what pytest captures stays open.
        (doing(closes_standard_output), "purity", "closed file"),
    ],
)
def test_a_step_that_would_end_its_process_is_not_passed(step, check, words):
    with pytest.raises(UserCodeError, match=words):
        check_stepper(step, 1, only=[check])


@pytest.mark.parametrize(
    ("given", "settings", "words"),
    [
        (3, {}, "a step function, a Stepper"),
        (int, {}, "a step function, a Stepper"),
        (lambda a, b: a, {}, r"its parameters are \(a, b\)"),
        (lambda acceleration, x, v, t, dt, args: x, {}, "Fix: write one of these"),
        ("rk5", {}, "did you mean 'rk4'"),
        ("constraint-verlet", {}, "moves nodes link by link.*Fix: see its order with"),
        ("nowhere.py:step", {}, "No such file"),
        (raises, {"expected_order": 0}, "expected_order: 0"),
        (raises, {"expected_order": 2, "method": "rk4"}, "none beside a method"),
        (raises, {"method": "rk5"}, "did you mean 'rk4'"),
        (raises, {"only": ["pin"]}, "did you mean 'pins'"),
        (raises, {"skip": "nonsense"}, "check: 'nonsense'"),
        (raises, {"only": ["pins"], "skip": ["pins"]}, "at least one check"),
        (raises, {"time_limit": -1}, "time_limit: -1"),
    ],
)
def test_what_cannot_be_checked_is_refused_before_anything_runs(given, settings, words):
    with pytest.raises(InputError, match=words):
        check_stepper(given, **settings)


def test_the_command_its_exit_codes_and_the_file_that_it_writes(run, tmp_path):
    file, name = tmp_path / "mine.py", "mine.py:step"
    file.write_text("def step(rhs, t, y, dt, args):\n    return y + dt * rhs(t, y, args)\n")
    words = ("--only", "order-driven", "--time-limit", str(SECONDS))
    right = run("check", name, "--order", "1", *words)
    assert right.returncode == 0
    assert "Right: 1 of 1 check" in right.stdout
    wrong = run("check", name, "--order", "2", *words, "--quick", "--out", "report.json")
    assert (wrong.returncode, wrong.stdout) == (1, "")
    report = json.loads((tmp_path / "report.json").read_text())
    assert (report["label"], report["verdict"]) == (name, "wrong")
    bad = run("check", "mine.py:stp", "--order", "1", *words)
    assert bad.returncode == 2
    assert "did you mean 'step'" in bad.stderr
    # Of a file that raises it is said whose fault it is.
    file.write_text("import nonexistent_package\n")
    with pytest.raises(UserCodeError, match="nonexistent_package"):
        check_stepper(f"{file}:step")
