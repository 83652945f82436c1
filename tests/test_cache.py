"""The cache folder: what is found there is what would be made, and is never out of date."""

from __future__ import annotations

import copy
import csv
import dataclasses
import hashlib
import io
import os
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import cache, norms
from ropeode.analysis import in_other_units
from ropeode.cache import Source, described
from ropeode.problems import InextensibleRope, Problem, Rope
from ropeode.simulation import simulate
from ropeode.steppers import STEPPERS, RungeKutta4, StormerVerlet, as_stepper
from tests.time_limit import HANGS_AFTER_S

POINT, ARRAY = np.array([0.1, 0.7]), np.array([1.0, 2.0])
ROPE, INEXTENSIBLE = (kind(num_nodes=4).problem(frames=3) for kind in (Rope, InextensibleRope))


KEPT = b"kept"


class Making:
    """Makes numbers in turn, which are kept, unless they are 0."""

    def __init__(self, number=1):
        self.number = number - 1

    def __call__(self, description="one", kind="number"):
        return cache.kept(kind, description, self.make, self.dump, self.load)

    def make(self):
        self.number += 1
        return self.number

    def dump(self, number):
        return KEPT + str(number).encode() if number else None

    def load(self, contents):
        assert contents.startswith(KEPT)
        return int(contents.removeprefix(KEPT))


@pytest.fixture
def other_software(monkeypatch):
    """Changes what counts as the software, and forgets what it was; it is as before after it."""

    def change(name, value):
        monkeypatch.setattr(f"ropeode.cache.{name}", value)
        cache.software.cache_clear()

    yield change
    monkeypatch.undo()
    cache.software.cache_clear()


def test_what_is_kept_is_not_made_again_and_what_differs_is(cache_folder):
    made = Making()
    assert [made(), made(), Making(7)()] == [1, 1, 1]
    assert [made("two"), made("one", "figure"), made("two")] == [2, 3, 2]
    (path,) = cache_folder.rglob("*.figure")
    assert path.parent == cache_folder / "figures"


# What may be other software: the names of functions, here with a text in their place, of which a
# digit of a source makes another one; and the variables that JAX, XLA and Equinox read.
@pytest.mark.parametrize(
    "name",
    [
        *("_version", "source_digest", "_processor"),
        *("XLA_FLAGS", "JAX_DEFAULT_MATMUL_PRECISION", "EQX_ON_ERROR"),
    ],
)
def test_other_software_makes_it_again(name, cache_folder, other_software, monkeypatch):
    made = Making()
    made()
    if name.isupper():
        monkeypatch.setenv(name, "--another")
        cache.software.cache_clear()
    else:
        other_software(name, lambda *_: "another")
    assert [made(), made()] == [2, 2]


def test_nothing_is_kept_of_sources_that_changed(cache_folder, other_software):
    """Since they were imported, be it while it was made."""
    made = Making()
    made("ahead")
    other_software("_IMPORTED", 0.0)
    assert [made(), made(), made("ahead")] == [2, 3, 4]
    assert len([*cache_folder.rglob("*.number")]) == 1


@pytest.mark.parametrize("folder", ["a folder", "none", "no folder"])
def test_what_is_not_kept_is_made_each_time(folder, cache_folder, monkeypatch):
    """Without a description, where it is not to be kept, and where there is no folder."""
    made = Making(0)
    if folder == "a folder":
        assert [made(), made(), made(None), made(None)] == [0, 1, 2, 3]
        assert made() == 1
        return
    if folder == "none":
        monkeypatch.setattr("ropeode.cache._folder", None)
    cache_folder.write_text("no folder")
    assert [made("one"), made("two"), made("one")] == [0, 1, 2]
    assert cache_folder.read_text() == "no folder"


def test_a_damaged_file_is_written_again(cache_folder):
    made = Making()
    made()
    (path,) = cache_folder.rglob("*.number")
    whole = path.read_bytes()
    # The last one is whole, but cannot be read.
    made.dump = lambda number: KEPT[1:]
    other = Making()
    path.unlink()
    made()
    unreadable = path.read_bytes()
    damages = (b"", whole[:-1], whole.replace(b"\n", b"0\n", 1), whole[:-1] + b"9", unreadable)
    for count, damage in enumerate(damages, 1):
        path.write_bytes(damage)
        assert [other(), other()] == [count, count]


@pytest.fixture
def folder(cache_folder):
    return cache_folder / "programs"


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
        made, facts = cache.program(description, sources)
        return [np.asarray(each).tobytes() for each in made({"x": POINT})], facts


def test_a_kept_program_is_the_one_that_was_compiled(folder, same_jax_settings):
    """With these settings of JAX."""
    sources = Sources()
    first = results_of("one", sources)
    assert [len(each) for each in first[0]] == [16, 8]
    assert results_of("one", sources) == first
    assert sources.calls == 1
    assert results_of(None, sources)[0] == first[0]
    assert len([*folder.iterdir()]) == 1
    jax.config.update("jax_default_matmul_precision", "float32")
    try:
        results_of("one", sources)
    finally:
        jax.config.update("jax_default_matmul_precision", None)
    assert sources.calls == 3


def test_a_program_that_xla_or_json_refuse_is_compiled_again(folder):
    sources = Sources()
    first, _ = results_of("one", sources)
    (path,) = folder.iterdir()
    _, contents = path.read_bytes().split(b"\n", 1)
    for count, no_program in enumerate((b"", b"{}\n", contents[: len(contents) // 2]), 2):
        digest = hashlib.sha256(no_program).hexdigest().encode()
        path.write_bytes(digest + b"\n" + no_program)
        assert results_of("one", sources) == (first, {"number": count})
    assert results_of("one", sources) == (first, {"number": count})


# `float` is what JAX cannot trace.
PYTHON = Problem.from_scipy(lambda t, y: [-float(y[0]), 0.0], (0.0, 1.0), POINT)


@pytest.mark.parametrize(
    "calls_out",
    [
        lambda x: PYTHON.rhs(0.0, x, PYTHON.args),
        lambda x: jnp.linalg.solve(jnp.diag(x), x),
        lambda x: jnp.linalg.qr(jnp.diag(x))[0] @ x,
    ],
)
def test_what_calls_python_or_lapack_is_not_kept(folder, calls_out):
    """Nobody makes LAPACK ready in a process that does not lower the program."""
    sources = Sources(lambda y: calls_out(y["x"]))
    first = results_of("one", sources)
    assert results_of("one", sources) == (first[0], {"number": 2})
    assert not folder.exists()


STIFF = """
import jax.numpy as jnp
from ropeode import Problem
def rhs(t, y, args):
    slow, back, fast = 0.04 * y[0], 1e4 * y[1] * y[2], 3e7 * y[1] ** 2
    return jnp.stack([back - slow, slow - back - fast, fast])
problem = Problem(rhs, [1.0, 0.0, 0.0], [0.0, 1.0, 1e5])
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "words",
    [
        # Which errors are predicted is a matter of time.
        f"table --no-predict --steps 8,16,32 --format csv --steppers {','.join(STEPPERS)}",
        "table --problem hires --no-predict --steps 8,16 --format csv --steppers rk4,gauss4,bdf2",
        "reference compute --problem stiff.py:problem --out a.nc",
    ],
)
def test_a_command_says_the_same_three_times_with_one_cache(words, tmp_path):
    """In three processes."""
    (tmp_path / "stiff.py").write_text(STIFF)
    said = set()
    for _ in range(3):
        done = subprocess.run(
            [sys.executable, "-m", "ropeode", *words.split()],
            capture_output=True,
            text=True,
            timeout=HANGS_AFTER_S,
            cwd=tmp_path,
            env={**os.environ, "XDG_CACHE_HOME": str(tmp_path)},
        )
        assert done.returncode == 0, done.stderr
        said.add(without_times(done.stdout) if "csv" in words else done.stdout)
    assert len(said) == 1


def without_times(table):
    rows = [*csv.DictReader(io.StringIO(table))]
    return repr([{name: row[name] for name in row if "seconds" not in name} for row in rows])


class Derived(RungeKutta4):
    """A user's own, which computes nobody knows what."""


def decay(t, y, args):
    return -y / 19.0


def test_which_runs_share_a_program(monkeypatch):
    """Those of the library alone, and no others than in one process."""
    found = []

    def recorded(description, source):
        found.append(description)
        raise NotImplementedError

    def description_of(problem, stepper="rk4"):
        with pytest.raises(NotImplementedError):
            simulate(problem, stepper, 16)
        return found.pop()

    monkeypatch.setattr("ropeode.cache.program", recorded)
    # Of a size, and a decay of a rate, that no other test has: this process has compiled no
    # program of either.
    small = Rope(num_nodes=19)
    problem = small.problem(frames=3)
    one = description_of(problem)
    same = Rope(num_nodes=19, damping=0.0, stiffness=7.0).problem(frames=5)
    assert description_of(same) == one
    others = [
        description_of(small.problem(frames=40)),
        description_of(Rope(num_nodes=20).problem(frames=3)),
        description_of(in_other_units(problem)),
        description_of(problem, "stormer-verlet"),
        description_of(problem, "stormer-verlet:start=rest"),
        description_of(small.ensemble(frames=3, damping=np.linspace(0.0, 0.1, 9))),
    ]
    assert len({one, *others}) == 7
    assert description_of(problem, Derived()) is None
    assert description_of(Problem(decay, [1.0], [0.0, 1.0])) is None


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (1, 1.0),
        (1, True),
        (0.0, -0.0),
        ((1, 2), (1, (2,))),
        (("a", "b"), ("a, b",)),
        ({"a": 1}, {"a": 2}),
        (ARRAY, np.nextafter(ARRAY, 3.0)),
        (ARRAY, ARRAY.astype(int)),
        (ARRAY, ARRAY[:, None]),
        (StormerVerlet(), StormerVerlet(start="rest")),
        (ROPE.rhs, INEXTENSIBLE.rhs),
    ],
)
def test_one_description_for_one_value_and_another_for_another(one, other):
    assert described(one) == described(copy.deepcopy(one)) != described(other)


def test_every_number_of_a_problem_counts(small_rope):
    changes = [
        {"y0": np.nextafter(small_rope.y0, 1e9)},
        {"ts": small_rope.ts * 2.0},
        {"args": small_rope.args._replace(gravity=small_rope.args.gravity * 2.0)},
        {"jump_times": (0.5,)},
        {"name": "another"},
        {"mechanics": dataclasses.replace(small_rope.mechanics, in_turn=False)},
    ]
    found = {described(small_rope.changed(**change)) for change in changes}
    assert len(found | {described(small_rope)}) == 7
    assert described(small_rope) == described(Rope(num_nodes=4).problem(frames=3))


@pytest.mark.parametrize(
    "value",
    [
        lambda t, y, args: -y,
        np.sin,
        Derived(),
        Derived,
        as_stepper(lambda rhs, t, y, dt, args: y),
        np.array([ARRAY, None], dtype=object),
        {1, 2},
    ],
)
def test_what_is_the_users_has_none(value):
    with pytest.raises(TypeError):
        described((1, value))


def test_a_function_in_place_of_one_of_ropeodes_has_none(monkeypatch):
    own = norms.distance
    assert described(own)
    monkeypatch.setattr(norms, "distance", lambda *given: own(*given))
    for function in (own, norms.distance):
        with pytest.raises(TypeError):
            described(function)
