"""The cache folder: what is found there is what would be made, and is never out of date."""

from __future__ import annotations

import copy
import dataclasses
import hashlib

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import cache
from ropeode.cache import Source, described
from ropeode.problems import InextensibleRope, Problem, Rope, compiled
from ropeode.steppers import RungeKutta4, StormerVerlet, as_stepper

POINT, ARRAY = np.array([0.1, 0.7]), np.array([1.0, 2.0])
ROPE, INEXTENSIBLE = (kind(num_nodes=4).problem(frames=3) for kind in (Rope, InextensibleRope))


class Program:
    """A program, and when it was compiled: the first time, the second."""

    def __init__(self, function=lambda y: {"a": jnp.sin(y["x"]), "b": jnp.sum(y["x"])}):
        self.times, self.function = 0, function

    def source(self):
        self.times += 1
        inputs = ({"x": jax.ShapeDtypeStruct(POINT.shape, POINT.dtype)},)
        return Source(self.function, inputs, {"time": self.times})

    def run(self, description="one"):
        """The bytes of its results, and when what was run had been compiled."""
        with jax.enable_x64(True):
            made, facts = cache.program(description, self.source)
            return [np.asarray(each).tobytes() for each in made({"x": POINT})], facts["time"]

    def compiled(self, *descriptions):
        """When what each of these runs had been compiled."""
        return [self.run(each)[1] for each in descriptions]


@pytest.fixture
def folder(cache_folder):
    return cache_folder / "programs"


@pytest.fixture
def other_software(monkeypatch):
    """Changes what counts as the software, and forgets what it was; it is as before after it."""

    def change(name, value):
        monkeypatch.setattr(f"ropeode.cache.{name}", value)
        cache.software.cache_clear()

    yield change
    monkeypatch.undo()
    cache.software.cache_clear()


def test_what_is_kept_is_what_was_compiled_and_what_differs_is_not_shared(
    folder, same_jax_settings
):
    program = Program()
    first = program.run("one")
    assert [len(each) for each in first[0]] == [16, 8]
    assert program.run("one") == Program().run("one") == first
    assert program.compiled("two", "one", "two") == [2, 1, 2]
    assert len([*folder.iterdir()]) == 2
    # With other settings of JAX.
    jax.config.update("jax_default_matmul_precision", "float32")
    try:
        assert program.compiled("one") == [3]
    finally:
        jax.config.update("jax_default_matmul_precision", None)


def test_a_problem_computes_the_same_with_and_without_the_folder(cache_folder, monkeypatch):
    """Values by name, as they come out of a program that is made, found, or not kept."""

    def drift():
        compiled.cache_clear()
        found = INEXTENSIBLE.drift(0.9 * INEXTENSIBLE.y0[None])
        return {name: values.tobytes() for name, values in found.items()}

    made = drift()
    assert len(made) == 2
    assert drift() == made
    assert len([*(cache_folder / "programs").iterdir()]) == 1
    monkeypatch.setattr(cache, "_folder", None)
    assert drift() == made


# What may be other software: the names of functions, here with a text in their place, of which a
# digit of a source makes another one; and the variables that JAX, XLA and Equinox read.
@pytest.mark.parametrize(
    "name",
    [
        *("_version", "source_digest", "_processor"),
        *("XLA_FLAGS", "JAX_DEFAULT_MATMUL_PRECISION", "EQX_ON_ERROR"),
    ],
)
def test_other_software_compiles_it_again(name, folder, other_software, monkeypatch):
    program = Program()
    assert program.compiled("one") == [1]
    if name.isupper():
        monkeypatch.setenv(name, "--another")
        cache.software.cache_clear()
    else:
        other_software(name, lambda *_: "another")
    assert program.compiled("one", "one") == [2, 2]


def test_nothing_is_kept_of_sources_that_changed(folder, other_software):
    """Since they were imported, be it while it was compiled."""
    program = Program()
    assert program.compiled("ahead") == [1]
    other_software("_IMPORTED", 0.0)
    assert program.compiled("one", "one", "ahead") == [2, 3, 4]
    assert len([*folder.iterdir()]) == 1


@pytest.mark.parametrize("there", ["a folder", "none", "no folder"])
def test_what_is_not_kept_is_compiled_each_time(there, cache_folder, monkeypatch):
    """Without a description, where nothing is to be kept, and where there is no folder."""
    if there == "none":
        monkeypatch.setattr("ropeode.cache._folder", None)
    elif there == "no folder":
        cache_folder.write_text(there)
    description = None if there == "a folder" else "one"
    assert Program().compiled(description, description) == [1, 2]
    assert not cache_folder.exists() or cache_folder.read_text() == "no folder"


def test_a_damaged_program_is_compiled_again(folder):
    program = Program()
    results, _ = program.run()
    (path,) = folder.iterdir()
    whole = path.read_bytes()
    contents = whole.partition(b"\n")[2]
    damages = [b"", whole[:-1], whole.replace(b"\n", b"0\n", 1), whole[:-1] + b"9"]
    # Whole files, which JSON or XLA refuse.
    for no_program in (b"", b"{}\n", contents[: len(contents) // 2]):
        digest = hashlib.sha256(no_program).hexdigest().encode()
        damages.append(digest + b"\n" + no_program)
    for time, damage in enumerate(damages, 2):
        path.write_bytes(damage)
        assert program.run() == program.run() == (results, time)


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
    program = Program(lambda y: calls_out(y["x"]))
    results, _ = program.run()
    assert program.run() == (results, 2)
    assert not folder.exists()


class Derived(RungeKutta4):
    """A user's own, which computes nobody knows what."""


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
        # Every number of a problem counts.
        (ROPE, ROPE.changed(y0=np.nextafter(ROPE.y0, 1e9))),
        (ROPE, ROPE.changed(ts=ROPE.ts * 2.0)),
        (ROPE, ROPE.changed(args=ROPE.args._replace(gravity=ROPE.args.gravity * 2.0))),
        (ROPE, ROPE.changed(jump_times=(0.5,))),
        (ROPE, ROPE.changed(name="another")),
        (ROPE, ROPE.changed(mechanics=dataclasses.replace(ROPE.mechanics, in_turn=False))),
    ],
)
def test_one_description_for_one_value_and_another_for_another(one, other):
    assert described(one) == described(copy.deepcopy(one)) != described(other)


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
    assert described((1, value)) is None
