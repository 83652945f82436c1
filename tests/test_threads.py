"""Which processors are used, and how many."""

from __future__ import annotations

import dataclasses
import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import reference
from ropeode.cli import run_command
from ropeode.threads import cores, use_cores
from tests.time_limit import HANGS_AFTER_S


def test_a_small_system_is_not_computed_on_a_gpu(small_rope, same_jax_settings, monkeypatch):
    """Each operation of a step would wait longer for a GPU than it takes a processor."""
    devices = []
    compiled = jax.stages.Lowered.compile

    def watched(*args, **named):
        devices.append(jax.config.jax_default_device)  # pyright: ignore
        return compiled(*args, **named)

    def solve(factor):
        # Another right-hand side each time, which is compiled anew.
        def rhs(t, y, args):
            return factor * small_rope.rhs(t, y, args)

        del devices[:]
        reference(dataclasses.replace(small_rope, rhs=rhs, mechanics=None))

    jax.config.update("jax_platforms", None)
    monkeypatch.setattr(jax.stages.Lowered, "compile", watched)
    monkeypatch.setattr(jax, "default_backend", lambda: "gpu")
    solve(0.9)
    assert {device.platform for device in devices} == {"cpu"}
    other = jax.devices()[-1]
    with jax.default_device(other):
        solve(0.8)
    assert {*devices} == {other}


@pytest.mark.parametrize("given", [None, "cpu,xyz"])
def test_a_command_asks_jax_for_the_processor(given, command_surroundings):
    """Unless the user asks for more."""
    jax.config.update("jax_platforms", given)
    run_command(["table", "--problem=no such problem"])
    assert jax.config.jax_platforms == (given or "cpu")  # pyright: ignore


# Batches that JAX divides among the threads of XLA's pool: eight in one program, or one in each of
# two threads.
SOLVES = """
import sys, threading
import jax, jax.numpy as jnp, numpy as np
import ropeode.threads
def solve(a):
    return [jnp.linalg.solve(a + i, a) for i in range({each})]
a = np.random.default_rng(0).standard_normal((64, {size}, {size}))
program = jax.jit(solve).lower(a).compile()
def work():
    for _ in range({times}):
        jax.block_until_ready(program(a))
threads = [threading.Thread(target=work) for _ in range({threads})]
for each in threads:
    each.start()
for each in threads:
    each.join()
"""


@pytest.mark.parametrize(
    "code",
    [
        SOLVES.format(size=16, each=8, threads=1, times=50),
        pytest.param(SOLVES.format(size=31, each=1, threads=2, times=3000), marks=pytest.mark.slow),
    ],
    ids=["in one program", "in two programs"],
)
def test_batches_of_matrices_do_not_wait_for_one_another(code):
    # In a process of its own: what hangs keeps the threads of XLA.
    subprocess.run([sys.executable, "-c", code], check=True, timeout=HANGS_AFTER_S)


def small(rng, *shape):
    return rng.standard_normal(shape) + 5.0 * np.eye(*shape[-2:])


@pytest.mark.parametrize(
    "function",
    [
        jnp.linalg.solve,
        lambda a, b: jnp.linalg.cholesky(a @ a.mT) @ b,
        lambda a, b: jnp.linalg.eigh(a + a.mT),
        lambda a, b: jnp.linalg.qr(a),
        lambda a, b: jnp.linalg.svd(a + 1j * a.mT),
        lambda a, b: jax.lax.linalg.tridiagonal_solve(a[..., 0], 9.0 + a[..., 1], a[..., 0], b),
    ],
    ids=["lu", "cholesky", "eigh", "qr", "svd", "tridiagonal"],
)
def test_a_batch_is_solved_as_each_matrix_alone(function):
    """To the last bit; of 45 matrices some are left over when equal parts are made."""
    rng = np.random.default_rng(1)
    with jax.enable_x64(True):
        solve = jax.jit(function)
        a, b = small(rng, 5, 9, 20, 20), small(rng, 5, 9, 20, 3)
        every = jax.tree.leaves(solve(a, b))
        for index in np.ndindex(5, 9):
            alone = jax.tree.leaves(solve(a[index], b[index]))
            for one, other in zip(every, alone, strict=True):
                np.testing.assert_array_equal(one[index], other)


def test_a_limit_holds_until_it_is_taken_back():
    there = cores()
    try:
        use_cores(1)
        assert cores() == 1
        use_cores(there + 7)
        assert cores() == there
    finally:
        use_cores(None)
    assert cores() == there
