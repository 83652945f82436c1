"""Questions that are answered in a thread, beside what the process does otherwise."""

from __future__ import annotations

import functools
import json
import threading
from collections.abc import Callable, Iterable
from typing import Any

from ropeode.laboratory.answers import answer_to
from ropeode.laboratory.messages import Ask, Message, Refused, Working
from ropeode.laboratory.own_file import in_words
from ropeode.laboratory.replies import reply
from ropeode.laboratory.setup import Laboratory
from ropeode.laboratory.wants import wants_of
from ropeode.laboratory.wire import encoded

# For work to end when the process does; compiled code cannot be stopped sooner.
_ENDS_IN_S = 10.0

# Called with the page, and with bytes as `wire.encoded` writes them or with text in JSON.
Send = Callable[[str, bytes | str], None]


class Background:
    """Answers what pages want: one question at a time, the most urgent of each page in turn.

    A question that is no longer the most urgent of its page is left off.

    Arguments:
        laboratory: computes the answers.
        send: sends them; called from the thread.
    """

    def __init__(self, laboratory: Laboratory, send: Send) -> None:
        self._laboratory, self._send = laboratory, send
        # What each page wants by key, the most urgent first; without pages that want nothing.
        self._wanted: dict[str, dict[str, Ask]] = {}
        # Held while that, or the thread, is read or changed.
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None

    def want(self, page: str, entries: Iterable[Any]) -> None:
        """Take what a page wants now, in place of what it wanted before."""
        wanted, refused = wants_of(entries)
        for key, refusal in refused:
            self._send(page, _text(key, refusal))
        with self._lock:
            self._wanted.pop(page, None)
            if not wanted:
                return
            self._wanted[page] = wanted
            if self._thread is None:
                self._thread = threading.Thread(target=self._work, name="ropeode lab", daemon=True)
                self._thread.start()

    def close(self) -> None:
        """Leave everything off, and wait until the thread has."""
        with self._lock:
            self._wanted.clear()
            thread = self._thread
        if thread is not None:
            thread.join(_ENDS_IN_S)

    def _work(self) -> None:
        while (chosen := self._next()) is not None:
            page, key, ask = chosen
            found = reply(
                functools.partial(answer_to, ask, self._laboratory),
                functools.partial(self._is_first, page, key, ask),
                functools.partial(self._tell, page, key),
                lambda error: Refused(message=in_words(error)),
            )
            if found is None:
                continue
            with self._lock:
                wanted = self._wanted.get(page, {})
                if wanted.get(key) == ask:
                    del wanted[key]
                if not wanted:
                    self._wanted.pop(page, None)
            self._send(page, encoded(key, *found))

    def _next(self) -> tuple[str, str, Ask] | None:
        """The most urgent question of the page whose turn it is; the thread ends without one."""
        with self._lock:
            for page in self._wanted:
                wanted = self._wanted[page] = self._wanted.pop(page)
                return page, *next(iter(wanted.items()))
            self._thread = None
            return None

    def _is_first(self, page: str, key: str, ask: Ask) -> bool:
        with self._lock:
            return next(iter(self._wanted.get(page, {}).items()), None) == (key, ask)

    def _tell(self, page: str, key: str, text: str, fraction: float | None) -> None:
        self._send(page, _text(key, Working(key=key, text=text, fraction=fraction)))


def _text(key: str, message: Message) -> str:
    return json.dumps({**message.model_dump(), "key": key})
