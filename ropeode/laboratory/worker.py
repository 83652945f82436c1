"""The process that computes the answers; it is the only one that runs JAX, and the user's code.

It hears orders: ``{"number": N, "ask": {...}}``, a question; ``{"stop": N}``, leave it off;
``{"number": N, "load": {...}}``, a version of the user's file. It says messages, bytes as
`wire.encoded` writes them with the number of the order for a key. The first, of number 0, says what
the lab was opened with.
"""

from __future__ import annotations

import collections
import functools
import os
import queue
import sys
import threading
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NoReturn, Protocol

from pydantic import TypeAdapter

from ropeode.errors import RopeodeError
from ropeode.laboratory.messages import Ask, Message, Refused, Working
from ropeode.laboratory.orders import Loaded, Ready, Stopped
from ropeode.laboratory.replies import NotWanted, reply
from ropeode.laboratory.wire import encoded
from ropeode.progress import Progress
from ropeode.sandbox import end_if_python_stops, heard, say

if TYPE_CHECKING:
    from ropeode.laboratory.answers import Answer

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
    """

    link: dict[str, Any]

    def answer(self, ask: Ask, progress: Progress) -> Answer:
        """The answer to a question, as `ropeode.laboratory.answers.answer_to`."""
        ...

    def ahead(self) -> Iterator[Ask]:
        """Questions whose answers are prepared while there is nothing else to do."""
        ...

    def load(self, version: str, text: str, fault: str | None) -> Loaded:
        """Run a version of the user's file, as `OwnFile.load`."""
        ...

    def refusal(self, error: RopeodeError) -> Refused:
        """What became of a question that has no answer."""
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
        from ropeode.laboratory import opening
        from ropeode.laboratory.answers import answer_to
        from ropeode.laboratory.compilations import told_of
        from ropeode.laboratory.own_file import OwnFile
        from ropeode.laboratory.setup import Laboratory

        given, choice = opening.opened_with(problem) if problem else (None, None)
        self.link = opening.link_of(choice, scene)
        self._answer_to, self._told_of = answer_to, told_of
        self._laboratory = Laboratory(given)
        self._own = OwnFile(own) if own else None

    def answer(self, ask: Ask, progress: Progress) -> Answer:
        """See `Answering`."""
        with self._told_of(progress) as told:
            return self._answer_to(ask, self._laboratory, told)

    def ahead(self) -> Iterator[Ask]:
        """See `Answering`."""
        from ropeode.laboratory.ahead import asks_ahead

        return asks_ahead()

    def load(self, version: str, text: str, fault: str | None) -> Loaded:
        """See `Answering`."""
        assert self._own is not None
        loaded = self._own.load(version, text, fault)
        self._laboratory.own = self._own.own
        return loaded

    def refusal(self, error: RopeodeError) -> Refused:
        """See `Answering`."""
        if self._own is None:
            return Refused(message=str(error))
        from ropeode.laboratory.own_file import in_words, line_of

        return Refused(message=in_words(error), line=line_of(error, self._own.path))


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

        def tell(text: str, fraction: float | None) -> None:
            _say(number, Working(key=str(number), text=text, fraction=fraction), {})

        found = reply(
            functools.partial(answers.answer, question),
            lambda: self._stopped != number,
            tell,
            answers.refusal,
        )
        _say(number, *(found or (Stopped(), {})))


def _say(number: int, message: Message, arrays: Mapping[str, Any]) -> None:
    say(encoded(str(number), message, arrays))
