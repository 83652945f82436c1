"""Which question is answered next, and what each page is told."""

from __future__ import annotations

import asyncio
import itertools
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from ropeode.errors import InputError, RopeodeError
from ropeode.laboratory.messages import Message, OwnStepper, Refused, Reloaded, Working
from ropeode.laboratory.recent import Recent
from ropeode.laboratory.wants import entries_of, wants_of
from ropeode.laboratory.watch import Version, WatchedFile, hash_of
from ropeode.laboratory.wire import with_key
from ropeode.laboratory.worker import Lost, WorkerProcess
from ropeode.validation import bad_value

_MOST_KEPT = 2**27
# Between messages of a page: a key that is held down sends fewer.
_BETWEEN_S = 0.005
# Its answer has the user's own steppers, whose file may change.
_LIBRARY = json.dumps({"kind": "library"})
_LONG = ("check", "film", "theory")


class Connection:
    """A page at the other end of a WebSocket.

    Arguments:
        socket: which has been accepted.
        kept: answers by question, for all pages.
        changed: is called when what is wanted has changed.
    """

    def __init__(self, socket: WebSocket, kept: Recent[bytes], changed: Callable[[], None]) -> None:
        self._socket, self._kept, self._changed = socket, kept, changed
        # Questions by key, the most urgent first.
        self._wanted: dict[str, str] = {}
        self._refusals: dict[str, Refused] = {}
        # The newest of each kind, which is enough.
        self._news: dict[str, Message] = {}
        self._something = asyncio.Event()

    def open_question(self) -> str | None:
        """The most urgent of those that are wanted and not answered yet."""
        return next((each for each in self._wanted.values() if not self._is_answered(each)), None)

    def _is_answered(self, question: str) -> bool:
        return question in self._kept or question in self._refusals

    def tell(self, message: Message) -> None:
        """Send news; an earlier one of the same kind that was not sent yet is dropped."""
        self._news[type(message).__name__] = message
        self._something.set()

    def tell_progress(self, question: str, text: str) -> None:
        """Send what is being done for a question, if it is wanted here."""
        for key, wanted in self._wanted.items():
            if wanted == question:
                self.tell(Working(key=key, text=text))
                return

    def answered(self, question: str, refused: Refused | None) -> None:
        """A question has an answer, which is kept, or is refused."""
        if question in self._wanted.values():
            if refused is not None:
                self._refusals[question] = refused
            self._something.set()

    async def serve(self) -> None:
        """Talk to the page until it is gone."""
        tasks = [asyncio.create_task(each) for each in (self._listen(), self._speak())]
        try:
            await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for each in tasks:
                each.cancel()
            ends = await asyncio.gather(*tasks, return_exceptions=True)
        for end in ends:
            expected = (WebSocketDisconnect, asyncio.CancelledError)
            if isinstance(end, BaseException) and not isinstance(end, expected):
                raise end

    async def _listen(self) -> None:
        while True:
            received = await self._socket.receive()
            if received["type"] == "websocket.disconnect":
                return
            try:
                entries = entries_of(received.get("text"))
            except InputError as error:
                await self._send_text("", Refused(message=str(error)))
            else:
                await self._want(entries)
            await asyncio.sleep(_BETWEEN_S)

    async def _want(self, entries: list[Any]) -> None:
        wanted, refused = wants_of(entries)
        for key, refusal in refused:
            await self._send_text(key, refusal)
        # The same text for all who ask the same.
        texts = (json.dumps(ask.model_dump(), sort_keys=True) for ask in wanted.values())
        self._wanted = dict(zip(wanted, texts, strict=True))
        self._refusals = {}
        self._something.set()
        self._changed()

    async def _speak(self) -> None:
        while True:
            await self._something.wait()
            self._something.clear()
            while answered := [each for each in self._wanted.items() if self._is_answered(each[1])]:
                key, question = answered[0]
                del self._wanted[key]
                if question in self._refusals:
                    await self._send_text(key, self._refusals[question])
                else:
                    # A page that reads slowly is sent one answer after the other; what it no
                    # longer wants by then, it is not sent.
                    await self._socket.send_bytes(with_key(key, self._kept[question]))
            while self._news:
                _, message = self._news.popitem()
                await self._socket.send_text(message.model_dump_json())

    async def _send_text(self, key: str, message: Message) -> None:
        await self._socket.send_text(json.dumps({"key": key, **message.model_dump()}))


class Dispatcher:
    """Takes the questions of all pages to the worker, one at a time.

    Arguments:
        worker: that answers them.
        file: of the user's own steppers.
        problem: file of the problem that the lab was opened with. Another worker would take it as
            it is by then, and the pages know answers about what it was.

    Attributes:
        opened: is called with parts of the page's link, once the worker is ready.
        failure: why the lab cannot work at all; None while it can.
        connections: to pages.
    """

    def __init__(
        self,
        worker: WorkerProcess,
        file: WatchedFile | None = None,
        problem: Path | None = None,
    ) -> None:
        self._worker, self._file = worker, file
        self._problem, self._problem_was = problem, problem and hash_of(problem)
        self.opened: Callable[[dict[str, Any]], None] = lambda _: None
        self.failure: RopeodeError | None = None
        self.connections: list[Connection] = []
        self._kept = Recent[bytes](_MOST_KEPT, len)
        self._numbers = itertools.count(1)
        self._current: tuple[int, str] | None = None
        self._something = asyncio.Event()
        # Whether the worker has answered anything since it was started.
        self._has_worked = False
        # Versions of the file: the last that works, and the last that was tried.
        self._good: Version | None = None
        self._tried: Version | None = None
        self._own: tuple[OwnStepper, ...] = ()

    async def serve(self, socket: WebSocket) -> None:
        """Talk to a page until it is gone."""
        connection = Connection(socket, self._kept, self._changed)
        self.connections.append(connection)
        try:
            await connection.serve()
        finally:
            self.connections.remove(connection)
            self._changed()

    async def work(self) -> None:
        """Answer questions, until the worker cannot be started at all."""
        watching = asyncio.create_task(self._watch())
        try:
            self.opened(await self._start())
            while True:
                while await self._did_something():
                    pass
                await self._something.wait()
                self._something.clear()
        except RopeodeError as error:
            self.failure = error
        finally:
            watching.cancel()
            await self._worker.kill()

    async def _watch(self) -> None:
        while self._file is not None:
            await self._file.changed()
            self._something.set()

    def _changed(self) -> None:
        """What is wanted has changed: leave off what is not the most urgent of any page.

        What takes long gives way to what another page wants, and is done again later.
        """
        self._something.set()
        if self._current is not None:
            number, question = self._current
            urgent = [each for _, each in self._urgent()]
            if question not in urgent or _is_long(question) > min(map(_is_long, urgent)):
                self._current = None
                self._worker.order(stop=number)
        if not self._worker.is_ready:
            self._tell_that_it_starts()

    def _tell_that_it_starts(self) -> None:
        for each, question in self._urgent():
            each.tell_progress(question, "Python starts")

    async def _did_something(self) -> bool:
        """Whether there was something to do; it is done."""
        newest = self._file.newest if self._file else None
        if newest is not None and (self._tried is None or newest.name != self._tried.name):
            await self._take(newest)
        elif (question := self._most_urgent()) is not None:
            await self._answer(question)
        elif not self._worker.is_ready or (self._has_worked and self._worker.wants_rest()):
            # So that the next question does not wait for it.
            try:
                await self._start()
            except RopeodeError:
                return False
        else:
            return False
        return True

    def _most_urgent(self) -> str | None:
        """The first question of a page, a short one if there is any; each page has its turn."""
        urgent = self._urgent()
        if not urgent:
            return None
        connection, question = min(urgent, key=lambda each: _is_long(each[1]))
        self.connections.remove(connection)
        self.connections.append(connection)
        return question

    def _urgent(self) -> list[tuple[Connection, str]]:
        """The most urgent question of each page that has one."""
        first = [(each, each.open_question()) for each in self.connections]
        return [(each, question) for each, question in first if question is not None]

    async def _start(self) -> dict[str, Any]:
        """Start the worker, with the versions of the file that another one had.

        Returns:
            Parts of the link with which the page is opened.

        Raises:
            Lost: it dies before it is ready.
            InputError: the lab was opened with what cannot be used.
        """
        await self._worker.kill()
        if self._problem is not None and hash_of(self._problem) != self._problem_was:
            allowed = "the file that the lab was opened with; it has changed"
            raise bad_value(
                "problem", str(self._problem), allowed, "close the lab and open it again"
            )
        self._tell_that_it_starts()
        self._worker.start()
        try:
            header, _ = await self._end_of(0)
            if header["kind"] == "refused":
                raise InputError(header["message"])
            self._worker.is_ready, self._has_worked = True, False
            if self._good is not None and self._file is not None:
                if self._good.beside == self._file.newest.beside:
                    await self._load(self._good)
                else:
                    self._good = None
            if self._tried is not None and self._tried != self._good:
                await self._load(self._tried)
        except RopeodeError:
            await self._worker.kill()
            raise
        return header["link"]

    async def _take(self, version: Version) -> None:
        """Have a new version of the file run; where that ends the worker, it is not run again."""
        try:
            if not self._worker.is_ready:
                await self._start()
            await self._load(version)
            self._tried = version
        except Lost as lost:
            self._tried = version._replace(fault=f"The file {lost}")
            try:
                await self._start()
            except RopeodeError:
                self._good = None
        if self._file is not None and any(each.version == version.name for each in self._own):
            self._good = version._replace(beside=self._file.newest.beside)
        self._kept.drop(_LIBRARY)
        for each in self.connections:
            each.tell(Reloaded(own=self._own))

    async def _load(self, version: Version) -> None:
        number = next(self._numbers)
        load = {"version": version.name, "text": version.text, "fault": version.fault}
        self._worker.order(number=number, load=load)
        header, _ = await self._end_of(number)
        self._own = tuple(OwnStepper(**each) for each in header["own"])
        if self._file is not None:
            self._file.import_from(map(Path, header["files"]))

    async def _answer(self, question: str) -> None:
        number = next(self._numbers)
        refused: Refused | None = None
        try:
            if not self._worker.is_ready:
                await self._start()
            self._worker.order(number=number, ask=json.loads(question))
            self._current = number, question
            # It may have been given up meanwhile.
            self._changed()
            header, contents = await self._end_of(number, question)
            if header["kind"] == "stopped":
                return
            if header["kind"] == "refused":
                refused = Refused(message=header["message"], line=header["line"])
            else:
                self._kept[question] = contents
        except RopeodeError as error:
            self._current = None
            await self._worker.kill()
            refused = Refused(message=_in_words(error))
        finally:
            self._current, self._has_worked = None, True
        for each in self.connections:
            each.answered(question, refused)

    async def _end_of(self, number: int, question: str = "") -> tuple[dict[str, Any], bytes]:
        """The answer to an order, after what is said of its progress."""
        while True:
            header, contents = await self._worker.said()
            if header["key"] != str(number):
                continue
            if header["kind"] != "working":
                return header, contents
            for each in self.connections:
                each.tell_progress(question, header["text"])


def _is_long(question: str) -> bool:
    """Whether an answer takes so long that other pages should not wait for it."""
    return json.loads(question)["kind"] in _LONG


def _in_words(error: RopeodeError) -> str:
    if not isinstance(error, Lost):
        return str(error)
    return (
        f"The computation {error}; allowed: one that returns, and leaves its process alone. Fix: "
        "take fewer steps, frames or nodes; in code of yours, look for what does this."
    )
