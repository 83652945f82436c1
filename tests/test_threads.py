"""How many processors are used."""

from __future__ import annotations

import contextlib
import threading

import pytest

from ropeode.sweep.execution import engines
from ropeode.threads import cores, threads, use_cores
from tests.time_limit import HANGS_AFTER_S


def told(task):
    return [{"cores": cores(), "task": task}]


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


def test_a_worker_uses_one():
    try:
        assert engines.on_one_core(told, 4) == [{"cores": 1, "task": 4}]
    finally:
        use_cores(None)


@pytest.mark.slow
def test_a_process_of_this_machine_uses_one():
    with contextlib.closing(engines.LocalProcesses(told, 1)) as engine:
        assert engine.submit(3).result() == [{"cores": 1, "task": 3}]


def test_as_many_threads_as_are_asked_for():
    together = threading.Barrier(3)
    with threads(3) as pool:
        for each in [pool.submit(together.wait, HANGS_AFTER_S) for _ in range(3)]:
            each.result()
