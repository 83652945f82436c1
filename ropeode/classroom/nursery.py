"""A process that has imported everything, and forks one process for each submission.

It runs no user's code and starts no thread: JAX has threads from its first computation on, and a
process that is forked after that hangs. So each submission has JAX imported, and nothing else.
"""

from __future__ import annotations

import contextlib
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
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, NoReturn

from ropeode.classroom.asked import Asked
from ropeode.classroom.examination import examined
from ropeode.classroom.steppers import Steppers
from ropeode.classroom.trajectories import Trajectories
from ropeode.references.jax_setup import set_up_jax
from ropeode.terminal.supervision import how_it_ended
from ropeode.threads import use_cores

_LOOKS_AGAIN_S, _ENDS_IN_S = 0.1, 2.0
_MEBIBYTE = 2**20
_KINDS: dict[str, type[Asked]] = {each.__name__: each for each in (Steppers, Trajectories)}


@dataclasses.dataclass
class _Job:
    """A submission under way.

    Arguments:
        name: of the submission.
        keeper: the process that waits for the one that runs it.
        ends_at: when it must have ended.
        said: what came from it so far.
        worker: the process that runs it; 0 until it has said so.
        limit: that it broke; empty while it has not.
    """

    name: str
    keeper: int
    ends_at: float
    said: bytes = b""
    worker: int = 0
    limit: str = ""


def main() -> None:
    """Examine the submissions that standard input names, and write a line of JSON about each."""
    told = json.loads(sys.stdin.readline())
    asked = _KINDS[told["kind"]](**told["asked"])
    set_up_jax()
    for module in asked.ahead:
        importlib.import_module(module)
    use_cores(1)
    gc.collect()
    # What is imported stays: to look for garbage in it takes long, in each process.
    gc.freeze()
    try:
        _Nursery(told, asked).work()
    finally:
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
        self._jobs: dict[int, _Job] = {}
        self._selector = selectors.DefaultSelector()
        # It ends when the process ends that wants the results.
        self._selector.register(sys.stdin.fileno(), selectors.EVENT_READ)

    def work(self) -> None:
        """Until all are done, or nobody wants them any more."""
        while self._waiting or self._jobs:
            while self._waiting and len(self._jobs) < self._workers:
                self._begin(*self._waiting.pop())
            for key, _ in self._selector.select(_LOOKS_AGAIN_S):
                if key.fd == sys.stdin.fileno():
                    for job in self._jobs.values():
                        _kill(job)
                    return
                self._hear(key.fd)
            for job in self._jobs.values():
                self._look_at(job)

    def _begin(self, name: str, where: Sequence[str]) -> None:
        ours, theirs = os.pipe()
        keeper = os.fork()
        if keeper == 0:
            work = functools.partial(self._run, name, where, theirs)
            _keep(work, [ours, *self._jobs], self._limits.processor_s)
        with contextlib.suppress(PermissionError, ProcessLookupError):
            # Here too: it may have to be killed before it has done so itself.
            os.setpgid(keeper, keeper)
        os.close(theirs)
        os.set_blocking(ours, False)
        self._jobs[ours] = _Job(name, keeper, time.monotonic() + self._limits.wall_s)
        self._selector.register(ours, selectors.EVENT_READ)

    def _run(self, name: str, where: Sequence[str], line: int) -> None:
        """In the process of a submission."""

        def say(kind: str, value: Any) -> None:
            os.write(line, _line([kind, value]))

        said = ""

        def doing(text: str) -> None:
            nonlocal said
            if text != said:
                said = text
                say("does", text)

        say("worker", os.getpid())
        # A working directory of its own.
        os.chdir(tempfile.mkdtemp(dir=self._scratch))
        outcome = examined(name, where, self._folder, self._asked, self._scratch, doing)
        contents = memoryview(_line(["outcome", vars(outcome)]))
        while contents:
            contents = contents[os.write(line, contents) :]

    def _hear(self, line: int) -> None:
        job = self._jobs[line]
        more = os.read(line, 2**16)
        job.said += more
        if not job.worker:
            job.worker = next((value for kind, value in _lines(job.said) if kind == "worker"), 0)
        if more:
            return
        # All who could write have ended, or closed it.
        self._selector.unregister(line)
        os.close(line)
        del self._jobs[line]
        self._end(job)

    def _end(self, job: _Job) -> None:
        said = list(_lines(job.said))
        does = [value for kind, value in said if kind == "does"]
        outcomes = [value for kind, value in said if kind == "outcome"]
        until = time.monotonic() + _ENDS_IN_S
        ended, status = os.waitpid(job.keeper, os.WNOHANG)
        while not ended and not outcomes and time.monotonic() < until:
            time.sleep(_LOOKS_AGAIN_S)
            ended, status = os.waitpid(job.keeper, os.WNOHANG)
        _kill(job)
        if not ended:
            # It has done its work, or closed the line and goes on.
            _, status = os.waitpid(job.keeper, 0)
        elif os.WIFSIGNALED(status):
            # Whatever it has found: it has killed its parent.
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
            "during": does[-1] if does else "",
        }
        sys.stdout.write(json.dumps(event) + "\n")
        sys.stdout.flush()

    def _look_at(self, job: _Job) -> None:
        if time.monotonic() > job.ends_at:
            job.limit = "wall"
            _kill(job)
        elif job.worker and _memory(job.worker) > self._limits.memory_mib * _MEBIBYTE:
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


def _line(words: list[Any]) -> bytes:
    """A line of its own, whatever the submission's code has written before."""
    return b"\n" + json.dumps(words).encode() + b"\n"


def _lines(said: bytes) -> Iterator[tuple[str, Any]]:
    """What a submission's process has said; its code may have written into it, or cut it off."""
    for line in said.split(b"\n"):
        with contextlib.suppress(ValueError, TypeError):
            kind, value = json.loads(line)
            yield kind, value


def _memory(process: int) -> int:
    """The memory that a process holds, in bytes; 0 where the system does not say."""
    try:
        pages = int(Path(f"/proc/{process}/statm").read_text().split()[1])
    except (OSError, ValueError, IndexError):
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")
