"""What the worker says to the server alone; all else it says is for pages."""

from __future__ import annotations

from typing import Any, Literal

from ropeode.laboratory.messages import Message, OwnStepper


class Ready(Message):
    """The worker is ready, and the page is opened with this link."""

    kind: Literal["ready"] = "ready"
    link: dict[str, Any]


class Stopped(Message):
    """A question was left off, since nobody wants it any more."""

    kind: Literal["stopped"] = "stopped"


class Loaded(Message):
    """What became of a version of the user's file: its steppers, and the files that it imports."""

    kind: Literal["loaded"] = "loaded"
    own: tuple[OwnStepper, ...]
    files: tuple[str, ...]
