"""Programs in the cache folder: the same as those that are compiled, and never out of date."""

from __future__ import annotations

import contextlib
import csv
import io
import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import cache_folder, identity, kept_programs
from ropeode.analysis.roundoff import in_other_units
from ropeode.errors import InputError
from ropeode.kept_programs import Source
from ropeode.problems.library import PROBLEMS
from ropeode.problems.problem import Problem
from ropeode.problems.python_rhs import PythonRhs
from ropeode.problems.rope import Rope
from ropeode.simulation import program, simulate
from ropeode.steppers import RungeKutta4
from ropeode.steppers.registry import STEPPERS
from tests.time_limit import HANGS_AFTER_S

POINT = np.array([0.1, 0.7])


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.setattr(cache_folder, "_folder", tmp_path)
    return tmp_path / "programs"


class Sources:
    """A source, and how often it was asked for."""

    def __init__(self, function=lambda y: {"a": jnp.sin(y["x"]), "b": jnp.sum(y["x"])}):
        self.calls, self.function = 0, function

    def __call__(self):
        self.calls += 1
        inputs = ({"x": jax.ShapeDtypeStruct(POINT.shape, POINT.dtype)},)
        return Source(self.function, inputs, {"number": self.calls})


def results_of(description, sources):
    with jax.enable_x64(True):
        made, facts = kept_programs.program(description, sources)
        return [np.asarray(each).tobytes() for each in made({"x": POINT})], facts


def test_a_kept_program_is_the_one_that_was_compiled(folder):
    sources = Sources()
    first = results_of("one", sources)
    assert [len(each) for each in first[0]] == [16, 8]
    assert results_of("one", sources) == first
    assert sources.calls == 1
    plain, _ = results_of(None, sources)
    assert plain == first[0]
    assert len([*folder.iterdir()]) == 1


def test_what_differs_is_compiled(folder, monkeypatch):
    sources = Sources()
    monkeypatch.setattr(kept_programs, "software", lambda: "one")
    results_of("one", sources)
    results_of("two", sources)
    assert sources.calls == 2
    monkeypatch.setattr(kept_programs, "software", lambda: "two")
    results_of("one", sources)
    assert sources.calls == 3
    results_of("one", sources)
    assert sources.calls == 3


def test_what_was_changed_since_it_was_imported_is_not_kept(folder, monkeypatch):
    sources = Sources()
    monkeypatch.setattr(identity, "_IMPORTED", 0.0)
    # While it was compiled.
    results_of("one", sources)
    identity.software.cache_clear()
    results_of("one", sources)
    assert sources.calls == 2
    assert not folder.exists()
    identity.software.cache_clear()


def test_settings_of_jax_count(folder, same_jax_settings):
    sources = Sources()
    results_of("one", sources)
    jax.config.update("jax_default_matmul_precision", "float32")
    try:
        results_of("one", sources)
    finally:
        jax.config.update("jax_default_matmul_precision", None)
    assert sources.calls == 2


def test_a_damaged_file_is_written_again(folder):
    sources = Sources()
    first, _ = results_of("one", sources)
    (path,) = folder.iterdir()
    whole = path.read_bytes()
    name = f"programs/{path.name}"
    contents = cache_folder.read(name)
    assert contents is not None
    cut = contents[: len(contents) // 2]
    for count, damage in enumerate((b"", whole[:-1], whole.replace(b"\n", b"0\n", 1)), 2):
        path.write_bytes(damage)
        assert results_of("one", sources) == (first, {"number": count})
    # Whole, but no program: XLA or JSON refuse it.
    for count, no_program in enumerate((b"", b"{}\n", cut), 5):
        cache_folder.write(name, no_program)
        assert results_of("one", sources) == (first, {"number": count})
    assert results_of("one", sources) == (first, {"number": count})


def test_what_calls_python_is_not_kept(folder):
    rhs = PythonRhs(lambda t, y: -y)
    sources = Sources(lambda y: rhs(0.0, y["x"], ()))
    results_of("one", sources)
    results_of("one", sources)
    assert sources.calls == 2
    assert not folder.exists()


@pytest.mark.parametrize("call", [jnp.linalg.solve, lambda a, b: jnp.linalg.qr(a)[0] @ b])
def test_what_calls_lapack_is_not_kept(folder, call):
    """Nobody makes LAPACK ready in a process that does not lower the program."""
    sources = Sources(lambda y: call(jnp.diag(y["x"]), y["x"]))
    first = results_of("one", sources)
    assert results_of("one", sources) == (first[0], {"number": 2})
    assert not folder.exists()


@pytest.mark.slow
@pytest.mark.parametrize("problem", ["van-der-pol", "hires", "rope"])
def test_a_command_says_the_same_three_times_with_one_cache(problem, tmp_path):
    solved = PROBLEMS[problem]()
    names = [name for name, stepper in STEPPERS.items() if can_run(stepper(), solved)]
    assert problem != "rope" or names == [*STEPPERS]
    # Which errors are predicted is a matter of time.
    words = ["table", "--problem", problem, "--no-predict", "--steps", "8,16,32", "--format", "csv"]
    said = three_times([*words, "--steppers", ",".join(names)], tmp_path)
    assert len(set(map(without_times, said))) == 1


STIFF = """
import jax.numpy as jnp
from ropeode import Problem
def rhs(t, y, args):
    slow, back, fast = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] ** 2
    return jnp.stack([back - slow, slow - back - fast, fast])
problem = Problem(rhs, [1.0, 0.0, 0.0], [0.0, 1.0, 1e5])
"""


@pytest.mark.slow
def test_a_stiff_reference_is_the_same_three_times_with_one_cache(tmp_path):
    file = tmp_path / "stiff.py"
    file.write_text(STIFF)
    words = [
        "reference",
        "compute",
        "--problem",
        f"{file}:problem",
        "--out",
        f"{tmp_path}/truth.nc",
    ]
    assert len(set(three_times(words, tmp_path))) == 1


def three_times(words, cache):
    """What a command prints, in three processes with one cache folder."""
    said = [
        subprocess.run(
            [sys.executable, "-m", "ropeode", *words],
            capture_output=True,
            text=True,
            timeout=HANGS_AFTER_S,
            env={**os.environ, "XDG_CACHE_HOME": str(cache)},
        )
        for _ in range(3)
    ]
    assert [each.returncode for each in said] == [0, 0, 0], said[-1].stderr
    return [each.stdout for each in said]


def can_run(stepper, problem):
    with contextlib.suppress(InputError):
        stepper.require(problem)
        return True
    return False


def without_times(table):
    rows = [*csv.DictReader(io.StringIO(table))]
    return repr([{name: row[name] for name in row if "seconds" not in name} for row in rows])


class Derived(RungeKutta4):
    """A user's own, which computes nobody knows what."""


def decay(t, y, args):
    return -y


def test_which_runs_share_a_program(monkeypatch):
    """Those of the library alone, and no others than in one process."""
    found = []

    def recorded(description, source):
        found.append(description)
        raise NotImplementedError

    def description_of(problem, stepper="rk4"):
        program.slot.cache_clear()
        with pytest.raises(NotImplementedError):
            simulate(problem, stepper, 16)
        return found.pop()

    monkeypatch.setattr(program.kept_programs, "program", recorded)
    rope = Rope(num_nodes=4)
    problem = rope.problem(frames=3)
    one = description_of(problem)
    assert one == description_of(rope.problem(frames=5))
    assert one == description_of(Rope(num_nodes=4, damping=0.0, stiffness=7.0).problem(frames=3))
    others = [
        description_of(rope.problem(frames=40)),
        description_of(Rope(num_nodes=5).problem(frames=3)),
        description_of(in_other_units(problem)),
        description_of(problem, "stormer-verlet"),
        description_of(problem, "stormer-verlet:start=rest"),
        description_of(rope.ensemble(frames=3, damping=np.linspace(0.0, 0.1, 9))),
        description_of(rope.ensemble(frames=3, damping=np.linspace(0.0, 0.1, 200))),
    ]
    assert len({one, *others}) == 8
    assert description_of(problem, Derived()) is None
    assert description_of(Problem(decay, [1.0], [0.0, 1.0])) is None
    program.slot.cache_clear()


def test_without_a_folder_nothing_is_kept(monkeypatch):
    monkeypatch.setattr(cache_folder, "_folder", None)
    sources = Sources()
    results_of("one", sources)
    results_of("one", sources)
    assert sources.calls == 2


def test_a_kept_stepper_makes_the_same_run(small_rope, folder, monkeypatch):
    program.slot.cache_clear()
    compiled = simulate(small_rope, "explicit-euler", 16)
    program.slot.cache_clear()
    with monkeypatch.context() as patch:
        patch.setattr(program, "_source", None)
        read = simulate(small_rope, "explicit-euler", 16)
    program.slot.cache_clear()
    assert read.states.tobytes() == compiled.states.tobytes()
    assert read.rhs_evaluations == compiled.rhs_evaluations
    assert len([*folder.iterdir()]) == 1
    # Changed by a digit, its source would be that of another program.
    monkeypatch.setattr(identity, "source_digest", lambda package: "another")
    identity.software.cache_clear()
    monkeypatch.setattr(program, "_source", None)
    with pytest.raises(TypeError):
        simulate(small_rope, "explicit-euler", 16)
    identity.software.cache_clear()
    program.slot.cache_clear()
