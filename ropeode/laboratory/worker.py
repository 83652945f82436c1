"""The process that computes the answers; it is the only one that runs JAX, and the user's code.

The server sees it as a `WorkerProcess`, which may hang, die, or grow, and is replaced then.

It hears orders: ``{"number": N, "ask": {...}}``, a question; ``{"stop": N}``, leave it off;
``{"number": N, "load": {...}}``, a version of the user's file. It says messages, bytes as
`wire.encoded` writes them with the number of the order for a key. The first, of number 0, says what
the lab was opened with.
"""

from __future__ import annotations

import asyncio
import collections
import functools
import os
import queue
import sys
import threading
import time
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, NoReturn, Protocol

from pydantic import TypeAdapter

from ropeode import sandbox
from ropeode.errors import RopeodeError
from ropeode.laboratory.messages import Ask, Message, Refused, Working
from ropeode.laboratory.replies import NotWanted, reply
from ropeode.laboratory.wire import Loaded, Ready, Stopped, checked_header, encoded
from ropeode.progress import Progress
from ropeode.sandbox import (
    MEBIBYTE,
    Child,
    Ended,
    GuardLost,
    end_if_python_stops,
    heard,
    say,
)

if TYPE_CHECKING:
    from ropeode.laboratory.answers import Answer

# The wall time that is allowed, over the processor time: user's code may wait for something.
_WAITING = 10.0
# The browser draws meanwhile.
_NICE = 10
# Without a question for so long, answers are prepared that nobody wants yet.
_QUIET_S = 0.5
# Processor time for which compiled code may keep Python from running.
_PYTHON_STOPS_S = 60.0


class Answering(Protocol):
    """What has answers.

    Attributes:
        link: what the page shows at first, as parts of its link.
        path: of the user's file; None for none.
    """

    link: dict[str, Any]
    path: Path | None

    def answer(self, ask: Ask, progress: Progress) -> Answer:
        """The answer to a question, as `ropeode.laboratory.answers.answer_to`."""
        ...

    def ahead(self) -> Iterator[Ask]:
        """Questions whose answers are prepared while there is nothing else to do."""
        ...

    def load(self, version: str, text: str, fault: str | None) -> Loaded:
        """Run a version of the user's file, as `OwnFile.load`."""
        ...


class OfRopeode:
    """The answers of ropeode, as `Answering`.

    Arguments:
        own: the user's file, with a name where one is asked for; None for none.
        problem: that the lab is opened with; None for none.
        scene: likewise.
    """

    def __init__(self, own: str | None, problem: str | None, scene: str | None) -> None:
        from ropeode.cache import set_up_jax

        set_up_jax()
        from ropeode.laboratory.answers import answer_to
        from ropeode.laboratory.compilations import told_of
        from ropeode.laboratory.own_file import OwnFile
        from ropeode.laboratory.setup import Laboratory, link_of, opened_with

        given, choice = opened_with(problem) if problem else (None, None)
        self.link = link_of(choice, scene)
        self._answer_to, self._told_of = answer_to, told_of
        self._laboratory = Laboratory(given)
        self._own = OwnFile(own) if own else None
        self.path = self._own.path if self._own else None

    def answer(self, ask: Ask, progress: Progress) -> Answer:
        """See `Answering`."""
        with self._told_of(progress) as told:
            return self._answer_to(ask, self._laboratory, told)

    def ahead(self) -> Iterator[Ask]:
        """See `Answering`."""
        from ropeode.laboratory.asks import asks_ahead

        return asks_ahead()

    def load(self, version: str, text: str, fault: str | None) -> Loaded:
        """See `Answering`."""
        assert self._own is not None
        loaded = self._own.load(version, text, fault)
        self._laboratory.own = self._own.own
        return loaded


class Limits(NamedTuple):
    """What a worker may take.

    Fields:
        seconds: of processor time without a sign of life; of wall time ten times as many.
        stops_in: seconds within which it leaves off what nobody wants any more.
        memory: in bytes, with what it started.
        tidy_memory: with more than this it is replaced as soon as it has nothing to do.
    """

    seconds: float = 20.0
    stops_in: float = 10.0
    memory: float = 4096 * MEBIBYTE
    tidy_memory: float = 2048 * MEBIBYTE


class Lost(RopeodeError):
    """The worker is of no use any more; the message says what it did, as of a subject before it."""


class WorkerProcess:
    """A process that answers one question at a time.

    Arguments:
        limits: what it may take.
        words: what its answers are made from.
        answering: makes what has the answers, in the process.
    """

    def __init__(
        self, limits: Limits, *words: Any, answering: Callable[..., Answering] = OfRopeode
    ) -> None:
        self._limits, self._answering, self._words = limits, answering, words
        # Whether it has imported what it needs.
        self.is_ready = False
        self._child: Child | None = None
        self._stop_sent: float | None = None

    def start(self) -> None:
        """Start it."""
        self._child = Child(serve, self._answering, *self._words)

    async def kill(self) -> None:
        """End it at once, with all processes that it started; nothing, if it does not run."""
        child, self._child, self._stop_sent = self._child, None, None
        self.is_ready = False
        if child is not None:
            await asyncio.to_thread(child.end)

    def order(self, **order: Any) -> None:
        """Send an order, as `ropeode.laboratory.worker` reads them."""
        self._stop_sent = time.monotonic() if "stop" in order else None
        self._running().send(order)
        if self._stop_sent is not None:
            # It may be waited for already.
            self._set_limits()

    async def said(self) -> tuple[dict[str, Any], bytes]:
        """The header of the next message, and the message.

        Raises:
            Lost: the worker has died, did not say anything for too long, takes too much memory,
                or says what is no message.
        """
        child = self._running()
        self._set_limits()
        try:
            said = await asyncio.to_thread(child.read)
            # Nobody waits for it until the next order.
            child.limit(sandbox.Limits(memory=self._limits.memory))
            if not isinstance(said, Ended):
                return checked_header(said), said
        except GuardLost:
            raise Lost("ended the process that guards it") from None
        except ValueError as error:
            why = " ".join(str(error).split())
            raise Lost(f"wrote something in place of its answer ({why:.200})") from None
        if said.limit == "wall" and self._stop_sent is not None:
            raise Lost("did not stop when nobody wanted it any more")
        raise Lost(said.how)

    def _set_limits(self) -> None:
        limits = self._limits
        wall = _WAITING * limits.seconds
        if self._stop_sent is not None:
            wall = min(wall, self._stop_sent + limits.stops_in - time.monotonic())
        self._running().limit(sandbox.Limits(limits.seconds, wall, limits.memory))

    def wants_rest(self) -> bool:
        """Whether it takes more memory than one that has nothing to do should."""
        return self._running().memory() > self._limits.tidy_memory

    def _running(self) -> Child:
        assert self._child is not None, "the worker was not started"
        return self._child


# ---- in the process


def serve(answering: Callable[..., Answering], *words: Any) -> NoReturn:
    """Answer questions until the server is gone.

    Arguments:
        answering: makes what has the answers.
        words: that it makes them from.
    """
    # Of two compiled files with the same second and size, the older might be taken.
    sys.dont_write_bytecode = True
    os.nice(_NICE)
    # What the user's code prints goes to standard error.
    os.dup2(2, 1)
    end_if_python_stops(_PYTHON_STOPS_S)
    _Worker().run(answering, words)


class _Worker:
    def __init__(self) -> None:
        self._waiting: queue.SimpleQueue[Mapping[str, Any]] = queue.SimpleQueue()
        self._stopped = 0

    def run(self, answering: Callable[..., Answering], words: Sequence[Any]) -> NoReturn:
        threading.Thread(target=self._listen, daemon=True).start()
        try:
            answers = answering(*words)
        except RopeodeError as error:
            _say(0, Refused(message=str(error)), {})
            os._exit(1)
        _say(0, Ready(link=answers.link), {})
        ahead = collections.deque(answers.ahead())
        while True:
            try:
                order = self._waiting.get(timeout=_QUIET_S if ahead else None)
            except queue.Empty:
                while ahead and self._is_prepared(answers, ahead[0]):
                    ahead.popleft()
                continue
            if "load" in order:
                _say(order["number"], answers.load(**order["load"]), {})
            else:
                self._answer(answers, order["number"], order["ask"])

    def _listen(self) -> NoReturn:
        for order in heard():
            if "stop" in order:
                self._stopped = order["stop"]
            else:
                self._waiting.put(order)
        # The server is gone, or has no use for this process any more.
        os._exit(0)

    def _is_prepared(self, answers: Answering, ask: Ask) -> bool:
        """Make an answer that nobody wants yet; False if an order came in between."""

        def progress(*_: Any) -> None:
            if not self._waiting.empty():
                raise NotWanted

        try:
            answers.answer(ask, progress)
        except NotWanted:
            return False
        except Exception:
            # Who asks the same is told what is wrong.
            traceback.print_exc()
        return True

    def _answer(self, answers: Answering, number: int, ask: Any) -> None:
        question = TypeAdapter(Ask).validate_python(ask)

        def tell(text: str) -> None:
            _say(number, Working(key=str(number), text=text), {})

        found = reply(
            functools.partial(answers.answer, question),
            lambda: self._stopped != number,
            tell,
            answers.path,
        )
        _say(number, *(found or (Stopped(), {})))


def _say(number: int, message: Message, arrays: Mapping[str, Any]) -> None:
    say(encoded(str(number), message, arrays))
