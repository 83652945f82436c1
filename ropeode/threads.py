"""Threads that run compiled programs side by side."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor

import jax

# Not first in one of the threads: while it is being imported there, Equinox, which others may be
# importing, finds `jax` without it.
import jax.extend

from ropeode import lapack  # noqa: F401  (for what it does to JAX)

_most: int | None = None


def use_cores(most: int | None) -> None:
    """Limit this process to so many processors; None removes the limit.

    For worker processes that share a machine.
    """
    global _most
    _most = most


def cores() -> int:
    """The number of processors that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        available = len(os.sched_getaffinity(0))
    else:
        available = os.cpu_count() or 1
    return available if _most is None else min(available, _most)


@contextlib.contextmanager
def threads(count: int) -> Iterator[ThreadPoolExecutor]:
    """A pool of threads that use the JAX device of the caller.

    If the block raises, tasks that have not started are dropped.

    Arguments:
        count: 1 or more.
    """
    own = jax.config.jax_default_device  # pyright: ignore[reportAttributeAccessIssue]
    device = jax.default_device(own)
    # The device is set for a thread, and the thread ends with the pool.
    pool = ThreadPoolExecutor(count, "ropeode", initializer=device.__enter__)
    try:
        yield pool
    finally:
        pool.shutdown(cancel_futures=True)
