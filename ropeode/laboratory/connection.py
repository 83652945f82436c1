"""One page that is connected: what it wants, and what it has been told."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

from ropeode.errors import InputError
from ropeode.laboratory.messages import Ask, Message, Refused, Working
from ropeode.laboratory.recent import Recent
from ropeode.laboratory.wants import entries_of, wants_of
from ropeode.laboratory.wire import with_key

# Between messages of a page: a key that is held down sends fewer.
_BETWEEN_S = 0.005


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
        self._wanted = {key: canonical(ask) for key, ask in wanted.items()}
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


def canonical(ask: Ask) -> str:
    """A question as text, the same for all who ask it."""
    return json.dumps(ask.model_dump(), sort_keys=True)
