"""The lab as a widget: the page in a frame of a notebook's cell, and the kernel behind it."""

from __future__ import annotations

import functools
import html
import json
import threading
import weakref
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import anywidget
import traitlets

from ropeode.files import check_suffix, write_whole
from ropeode.laboratory.answers import answer_to
from ropeode.laboratory.messages import Ask, Message, Working
from ropeode.laboratory.page_files import PAGE
from ropeode.laboratory.replies import reply
from ropeode.laboratory.setup import Laboratory
from ropeode.laboratory.single_file import page_with_answers
from ropeode.laboratory.wants import entries_of, wants_of
from ropeode.laboratory.wire import encoded
from ropeode.progress import Progress, bar, shows_progress

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

    def _tell(self, page: str, key: str, text: str) -> None:
        self._send(page, _text(key, Working(key=key, text=text)))


def _text(key: str, message: Message) -> str:
    return json.dumps({**message.model_dump(), "key": key})


class Lab(anywidget.AnyWidget):
    """The lab in a notebook, as `ropeode.lab` makes it.

    The cell holds the page with a recording of what its keys ask for, so that it plays in a saved
    notebook and in what is exported from one. As long as the kernel runs, it answers the rest.

    Arguments:
        laboratory: computes the answers.
        link: what the page shows at first, as `setup.link_of` has it.
        height: of the frame, in pixels.
        progress: called with what is being done and the fraction that is done.

    Raises:
        InputError: the problem cannot be used.
        ReferenceRefused: the problem has no certified reference.
    """

    _esm = (PAGE / "widget.js").read_text("utf-8")
    # HTML that needs nothing else.
    page = traitlets.Unicode().tag(sync=True)
    height = traitlets.Int().tag(sync=True)

    def __init__(
        self, laboratory: Laboratory, link: Mapping[str, Any], height: int, progress: Progress
    ) -> None:
        self._laboratory, self._link = laboratory, link
        self._background = Background(laboratory, _sender(weakref.ref(self)))
        # The thread ends with the widget, or with the kernel.
        weakref.finalize(self, self._background.close)
        page = page_with_answers(laboratory, link, progress, checks=False)
        super().__init__(page=page, height=height)
        self.on_msg(_heard)

    @shows_progress
    def export(self, path: Any, *, progress: Progress = bar) -> None:
        """Write the lab to one file that plays without Python, as ``ropeode lab --out`` does.

        Arguments:
            path: whose name ends in ``.html``.
            progress: called with what is being done and the fraction that is done.

        Raises:
            InputError: the name ends in something else, or the file cannot be written.
        """
        target = check_suffix("path", path, [".html"])
        write_whole(target, page_with_answers(self._laboratory, self._link, progress))

    def close(self) -> None:
        """Close the widget, and leave off what it computes."""
        self._background.close()
        super().close()

    def __repr__(self) -> str:
        return f"<Lab: {self._link['problem']['name']}; {', '.join(self._link['steppers'])}>"

    def _repr_mimebundle_(self, **kwargs: Any) -> Any:
        bundle = super()._repr_mimebundle_(**kwargs)
        if bundle is None:
            return None
        data, metadata = bundle
        # For notebooks that are looked at without a kernel, and without widgets.
        frame = (
            f'<iframe title="ropeode lab" sandbox="allow-scripts allow-downloads" '
            f'style="width: 100%; height: {self.height}px; border: 0" '
            f'srcdoc="{html.escape(self.page)}"></iframe>'
        )
        return {**data, "text/html": frame}, metadata


def _heard(lab: Lab, content: Any, _: Any) -> None:
    """What a page says: its name alone when it is new, later also what it wants."""
    match content:
        case {"page": str(page), "text": str(text)}:
            lab._background.want(page, entries_of(text))
        case {"page": str(page)}:
            lab.send({"page": page})


def _sender(widget: weakref.ref[Lab]) -> Any:
    def send(page: str, message: bytes | str) -> None:
        lab = widget()
        if lab is None:
            return
        if isinstance(message, str):
            lab.send({"page": page, "text": message})
        else:
            lab.send({"page": page}, buffers=[message])

    return send
