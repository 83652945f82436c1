"""A process that has imported everything, and forks one process for each submission.

It runs no user's code and starts no thread: JAX has threads from its first computation on, and a
process that is forked after that hangs. So each submission has JAX imported, and nothing else.
"""

from __future__ import annotations

import contextlib
import ctypes
import dataclasses
import functools
import gc
import importlib
import json
import os
import resource
import selectors
import shutil
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from ropeode.cache import set_up_jax
from ropeode.classroom.asked import Asked
from ropeode.classroom.examination import examined
from ropeode.classroom.outcome import as_json
from ropeode.terminal.supervision import how_it_ended
from ropeode.threads import use_cores

_LOOKS_AGAIN_S, _ENDS_IN_S = 0.1, 2.0
_MEBIBYTE = 2**20
# Lines from the process of a submission begin with one of these. It may say so much, in bytes, and
# what it is doing in so many letters; an outcome takes some ten kilobytes.
_DOES, _OUTCOME = b"does ", b"outcome "
_MOST_BYTES, _LONGEST_WORDS = 4 * _MEBIBYTE, 200
_PR_SET_CHILD_SUBREAPER = 36


@dataclasses.dataclass
class _Job:
    """A submission under way.

    Arguments:
        name: of the submission.
        keeper: the process that waits for the one that runs it.
        line: what comes from it is read here; None where it can say no more.
        ends_at: when it must have ended.
        said: what came from it so far, of which nothing can be trusted.
        limit: that it broke; empty while it has not.
    """

    name: str
    keeper: int
    line: int | None
    ends_at: float
    said: bytes = b""
    limit: str = ""


def main() -> None:
    """Examine the submissions that standard input names, and write a line of JSON about each."""
    told = json.loads(sys.stdin.readline())
    module, name = told["kind"]
    asked = getattr(importlib.import_module(module), name)(**told["asked"])
    set_up_jax()
    for module in asked.ahead:
        importlib.import_module(module)
    use_cores(1)
    gc.collect()
    # What is imported stays: to look for garbage in it takes long, in each process.
    gc.freeze()
    _adopt_orphans()
    nursery = _Nursery(told, asked)
    try:
        nursery.work()
    finally:
        nursery.end()
        shutil.rmtree(told["scratch"], ignore_errors=True)


class _Nursery:
    """Keeps so many submissions under way.

    Arguments:
        told: as `ropeode.classroom.running` sends it.
        asked: of each submission.
    """

    def __init__(self, told: Mapping[str, Any], asked: Asked) -> None:
        self._asked, self._limits = asked, asked.limits
        self._folder, self._scratch = Path(told["folder"]), Path(told["scratch"])
        self._workers = told["workers"]
        self._waiting = list(reversed(told["submissions"]))
        self._jobs: list[_Job] = []
        self._selector = selectors.DefaultSelector()
        # It ends when the process ends that wants the results.
        self._selector.register(sys.stdin.fileno(), selectors.EVENT_READ)

    def work(self) -> None:
        """Until all are done, or nobody wants them any more."""
        while self._waiting or self._jobs:
            while self._waiting and len(self._jobs) < self._workers:
                self._begin(*self._waiting.pop())
            for key, _ in self._selector.select(_LOOKS_AGAIN_S):
                if key.data is None:
                    return
                self._hear(key.data)
            for job in list(self._jobs):
                self._look_at(job)
            self._end_orphans()

    def end(self) -> None:
        """End all processes that there are."""
        for job in self._jobs:
            _kill(job)
        self._jobs, until = [], time.monotonic() + _ENDS_IN_S
        while self._end_orphans() and time.monotonic() < until:
            time.sleep(_LOOKS_AGAIN_S / 10.0)

    def _end_orphans(self) -> bool:
        """End what submissions have started and left to itself; says whether there was any."""
        keepers = {job.keeper for job in self._jobs}
        orphans = [each for each in _children(os.getpid()) if each not in keepers]
        for each in orphans:
            with contextlib.suppress(ProcessLookupError, ChildProcessError):
                os.kill(each, signal.SIGKILL)
                os.waitpid(each, os.WNOHANG)
        return bool(orphans)

    def _begin(self, name: str, where: Sequence[str]) -> None:
        ours, theirs = os.pipe()
        keeper = os.fork()
        if keeper == 0:
            work = functools.partial(self._run, name, where, theirs)
            lines = [ours, *(job.line for job in self._jobs if job.line is not None)]
            _keep(work, [*lines, self._selector.fileno()], self._limits.processor_s)
        with contextlib.suppress(PermissionError, ProcessLookupError):
            # Here too: it may have to be killed before it has done so itself.
            os.setpgid(keeper, keeper)
        os.close(theirs)
        os.set_blocking(ours, False)
        job = _Job(name, keeper, ours, time.monotonic() + self._limits.wall_s)
        self._jobs.append(job)
        self._selector.register(ours, selectors.EVENT_READ, job)

    def _run(self, name: str, where: Sequence[str], line: int) -> None:
        """In the process of a submission."""
        said = ""

        def doing(text: str) -> None:
            nonlocal said
            if text != said:
                said = text
                _say(line, _DOES, text.encode(errors="replace"))

        # A working directory of its own.
        os.chdir(tempfile.mkdtemp(dir=self._scratch))
        outcome = examined(name, where, self._folder, self._asked, self._scratch, doing)
        _say(line, _OUTCOME, as_json(outcome))

    def _hear(self, job: _Job) -> bool:
        """Read once; says whether there may be more."""
        if job.line is None:
            return False
        try:
            more = os.read(job.line, 2**16)
        except BlockingIOError:
            return False
        job.said += more
        if len(job.said) > _MOST_BYTES:
            job.limit, more = "report", b""
            _kill(job)
        if not more:
            # All who could write have ended, or closed it; or it has said enough.
            self._selector.unregister(job.line)
            os.close(job.line)
            job.line = None
        return bool(more)

    def _end(self, job: _Job, status: int) -> None:
        """Once its keeper has ended. What it has started may go on, and hold the line open."""
        _kill(job)
        while self._hear(job):
            pass
        if job.line is not None:
            self._selector.unregister(job.line)
            os.close(job.line)
        self._jobs.remove(job)
        does, outcomes = _lines(job.said, _DOES), _lines(job.said, _OUTCOME)
        if os.WIFSIGNALED(status):
            # Whatever it has found: it was ended, or has killed its parent.
            outcomes = []
        code = os.waitstatus_to_exitcode(status)
        limit = job.limit
        if code == 128 + signal.SIGXCPU:
            limit = "processor"
        event = {
            "name": job.name,
            "outcome": outcomes[-1] if outcomes else None,
            "how": how_it_ended(code, shell=True),
            "limit": limit,
            "during": does[-1][:_LONGEST_WORDS] if does else "",
        }
        sys.stdout.write(json.dumps(event) + "\n")
        sys.stdout.flush()

    def _look_at(self, job: _Job) -> None:
        ended, status = os.waitpid(job.keeper, os.WNOHANG)
        if ended:
            self._end(job, status)
        elif time.monotonic() > job.ends_at:
            job.limit = "wall"
            _kill(job)
        elif sum(map(_memory, _children(job.keeper))) > self._limits.memory_mib * _MEBIBYTE:
            job.limit = "memory"
            _kill(job)


def _keep(work: Callable[[], None], close: list[int], seconds: int) -> NoReturn:
    """Run the work in a process below this one, and end as that does.

    So code that kills its parent, or its group, kills no more than this.

    Arguments:
        work: what to do there.
        close: files of others, which it has no use for.
        seconds: of processor time that it may take.
    """
    os.setpgid(0, 0)
    worker = os.fork()
    if worker == 0:
        try:
            nothing = os.open(os.devnull, os.O_RDWR)
            for each in (0, 1, 2):
                os.dup2(nothing, each)
            for each in close:
                with contextlib.suppress(OSError):
                    os.close(each)
            resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5))
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            work()
            os._exit(0)
        finally:
            os._exit(1)
    # The worker alone holds the line, so that its end is heard.
    os.closerange(0, 256)
    _, status = os.waitpid(worker, 0)
    code = os.waitstatus_to_exitcode(status)
    os._exit(code if code >= 0 else 128 - code)


def _kill(job: _Job) -> None:
    """End a submission and what it started."""
    with contextlib.suppress(ProcessLookupError):
        os.killpg(job.keeper, signal.SIGKILL)


def _adopt_orphans() -> None:
    """Be the parent of all processes below this one whose own has ended, where this is Linux."""
    with contextlib.suppress(OSError, AttributeError):
        ctypes.CDLL(None).prctl(_PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)


def _children(process: int) -> list[int]:
    """The children of a process that has one thread; none where the system does not say."""
    try:
        return [*map(int, Path(f"/proc/{process}/task/{process}/children").read_text().split())]
    except OSError:
        return []


def _say(line: int, kind: bytes, words: bytes) -> None:
    """Write a line of its own, whatever the submission's code has written before."""
    left = memoryview(b"\n" + kind + b" ".join(words.split(b"\n")) + b"\n")
    while left:
        left = left[os.write(line, left) :]


def _lines(said: bytes, kind: bytes) -> list[str]:
    """What a submission's process has said; its code may have written into it, or cut it off."""
    lines = [line[len(kind) :] for line in said.split(b"\n") if line.startswith(kind)]
    return [line.decode(errors="replace") for line in lines]


def _memory(process: int) -> int:
    """The memory that a process holds, in bytes; 0 where the system does not say."""
    try:
        pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    except (OSError, ValueError, IndexError):
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")
