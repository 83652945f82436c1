"""Fixtures that several rooms share."""

from __future__ import annotations

import contextlib
import gc
import importlib
import os
import resource
import shutil
import signal
import subprocess
import tempfile

# As for a command: with Equinox's checks at run time no program of diffrax can be kept, and each
# process compiles its own. tests/verification/test_runtime_checks.py holds runs with them against
# runs without. Equinox reads this when it is imported.
os.environ.setdefault("EQX_ON_ERROR", "off")

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import settings

from ropeode.cli import run_command
from ropeode.problems import LinearDamping, Problem, Rope

# The gate draws the same examples each time; `pytest --hypothesis-profile=random` searches on.
# Without a deadline: how fast the machine is decides no test.
settings.register_profile("repeatable", derandomize=True, deadline=None)
settings.register_profile("random", derandomize=False, deadline=None)
settings.load_profile("repeatable")


# What `set_up_jax` changes; a process that is the command's own keeps it.
JAX_SETTINGS = (
    "jax_enable_x64",
    "jax_platforms",
    "jax_compilation_cache_dir",
    "jax_persistent_cache_min_compile_time_secs",
    "jax_persistent_cache_min_entry_size_bytes",
)

_FOLDER = pytest.StashKey[str]()
# XLA ends the process at a flag that it does not know; it is not asked for in other versions.
_FLAGS = "--xla_cpu_use_fusion_emitters=false --xla_cpu_parallel_codegen_split_count=1"
_HAVE_FLAGS = ((0, 10),)


def pytest_configure(config):
    if config.getoption("markexpr") == "not slow":
        compile_quickly()
        look_less_closely()
    share_compiled_programs(config)


def pytest_collection_finish():
    """What is there now stays: the garbage collector need not look through it again and again."""
    gc.freeze()
    gc.set_threshold(100_000)


def compile_quickly():
    """Leave out what XLA does to make programs run fast: compiling takes most of the time of tests.

    Only where the slow tests are left out: all tests together compile as a user's process does.
    """
    # So compiled by JAX 0.11, a run in an ensemble differs in its last bits from the run alone.
    if jax.__version_info__[:2] != (0, 11):
        set_up("jax_disable_most_optimizations", True)
    if jax.__version_info__[:2] in _HAVE_FLAGS:
        os.environ.setdefault("XLA_FLAGS", _FLAGS)


# How many times a reference is looked at between the steps of its solvers. No face has them: what
# takes half the time of a reference is made cheap for tests here, and nowhere else.
residuals = importlib.import_module("ropeode.references.residuals")
_SAMPLING = ("_NUMBERS", "_MOST_NUMBERS", "_FEWEST_TIMES", "_MOST_TIMES")
AS_FOR_USERS = {name: getattr(residuals, name) for name in _SAMPLING}


def look_less_closely():
    """Evaluate right-hand sides between steps at a sixteenth of the times.

    In programs that are compiled quickly it takes half the time of a reference to look at all of
    them. Tests of what is found there ask for `looked_at_as_for_users`.
    """
    for name, many in AS_FOR_USERS.items():
        setattr(residuals, name, many // 16)


@pytest.fixture
def looked_at_as_for_users(monkeypatch):
    """A reference is looked at between steps as closely as a user's is."""
    for name, many in AS_FOR_USERS.items():
        monkeypatch.setattr(residuals, name, many)


def share_compiled_programs(config):
    """What one process has compiled is there for the others, as long as the tests run."""
    if "JAX_COMPILATION_CACHE_DIR" not in os.environ:
        config.stash[_FOLDER] = tempfile.mkdtemp(prefix="ropeode-tests-")
        set_up("jax_compilation_cache_dir", config.stash[_FOLDER])
        set_up("jax_persistent_cache_min_compile_time_secs", 0.0)
        set_up("jax_persistent_cache_min_entry_size_bytes", -1)


def set_up(name, value):
    """Configure JAX in this process, and in those that it starts."""
    os.environ[name.upper()] = str(value)
    jax.config.update(name, value)


def pytest_unconfigure(config):
    if _FOLDER in config.stash:
        shutil.rmtree(config.stash[_FOLDER], ignore_errors=True)


@pytest.fixture(scope="session")
def small_rope() -> Problem:
    """A rope that computes in no time."""
    return Rope(num_nodes=4).problem(frames=3)


def pendulum_acceleration(t, x, v, args):
    """A pendulum driven by a force that depends on time, with damping."""
    return -jnp.sin(x) + 0.3 * jnp.cos(1.3 * t) - args["rate"] * v


def pendulum_damping(args):
    return LinearDamping(args["rate"], args["rate"])


@pytest.fixture(scope="session")
def driven_pendulum() -> Problem:
    """Non-autonomous, nonlinear, damped, moving at the start; frames of length 0.7."""
    return Problem.second_order(
        pendulum_acceleration,
        [[0.4]],
        [[1.1]],
        2.0 + 0.7 * np.arange(8),
        {"rate": 0.2},
        damping=pendulum_damping,
        name="driven pendulum",
    )


@pytest.fixture
def room_for():
    """A block in which no file can be longer than so many bytes, as on a disk that gets full."""

    @contextlib.contextmanager
    def limited(size):
        before = resource.getrlimit(resource.RLIMIT_FSIZE)
        ignored = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
        try:
            yield
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)
            signal.signal(signal.SIGXFSZ, ignored)

    return limited


@pytest.fixture(scope="session")
def cache(tmp_path_factory):
    """A folder of the tests' own for what a command keeps in the user's cache folder."""
    return str(tmp_path_factory.mktemp("cache"))


@contextlib.contextmanager
def jax_settings_kept():
    settings = {name: getattr(jax.config, name) for name in JAX_SETTINGS}
    try:
        yield
    finally:
        for name, value in settings.items():
            jax.config.update(name, value)


@pytest.fixture
def same_jax_settings():
    """What code changes in JAX is restored after it."""
    with jax_settings_kept():
        yield


@contextlib.contextmanager
def commands_may_run(cache, folder):
    """A block in this folder; what a command changes in its process is restored after it."""
    handler = signal.getsignal(signal.SIGINT)
    with jax_settings_kept(), pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        patch.setenv("XDG_CACHE_HOME", cache)
        patch.setattr("ropeode.cache._folder", None)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, handler)


@pytest.fixture
def command_surroundings(cache, tmp_path):
    """An empty folder; and what a command changes in its process is restored after it."""
    with commands_may_run(cache, tmp_path):
        yield


@pytest.fixture
def cache_folder(tmp_path, monkeypatch):
    """A new folder in which this process keeps programs and references, as a command does."""
    folder = tmp_path / "cache"
    monkeypatch.setattr("ropeode.cache._folder", folder)
    return folder


@pytest.fixture
def run(command_surroundings, capsys):
    """Run ropeode in an empty folder, in this process."""

    def call(*arguments):
        capsys.readouterr()
        code = run_command(list(arguments))
        out, err = capsys.readouterr()
        return subprocess.CompletedProcess(arguments, code, out, err)

    return call
