"""The worker as the server sees it: a process that may hang, die, or grow, and is replaced then."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any, NamedTuple

from ropeode import sandbox
from ropeode.errors import RopeodeError
from ropeode.laboratory.orders import checked_header
from ropeode.laboratory.worker import Answering, OfRopeode, serve
from ropeode.sandbox import MEBIBYTE, Child, Ended, GuardLost

# The wall time that is allowed, over the processor time: user's code may wait for something.
_WAITING = 10.0


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
