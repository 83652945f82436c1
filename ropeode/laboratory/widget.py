"""The lab as a widget: the page in a frame of a notebook's cell, and the kernel behind it."""

from __future__ import annotations

import html
import weakref
from collections.abc import Mapping
from typing import Any

import anywidget
import traitlets

from ropeode.files import check_suffix, write_whole
from ropeode.laboratory.background import Background
from ropeode.laboratory.page_files import PAGE
from ropeode.laboratory.setup import Laboratory
from ropeode.laboratory.single_file import page_with_answers
from ropeode.laboratory.wants import entries_of
from ropeode.progress import Progress, bar, shows_progress


class Lab(anywidget.AnyWidget):
    """The lab in a notebook, as `ropeode.lab` makes it.

    The cell holds the page with a recording of what its keys ask for, so that it plays in a saved
    notebook and in what is exported from one. As long as the kernel runs, it answers the rest.

    Arguments:
        laboratory: computes the answers.
        link: what the page shows at first, as `opening.link_of` has it.
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
