"""How many processors are used."""

from __future__ import annotations

import threading

from ropeode.sweep.execution.engines import LocalProcesses, on_one_core
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
    engine = LocalProcesses(told, 1)
    try:
        assert engine.submit(3).result() == [{"cores": 1, "task": 3}]
    finally:
        engine.close()
    try:
        assert on_one_core(told, 4) == [{"cores": 1, "task": 4}]
    finally:
        use_cores(None)


def test_as_many_threads_as_are_asked_for():
    together = threading.Barrier(3)
    with threads(3) as pool:
        for each in [pool.submit(together.wait, HANGS_AFTER_S) for _ in range(3)]:
            each.result()
