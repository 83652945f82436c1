"""What is wrong with a step."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any, NamedTuple

from ropeode.json_form import json_shows


@json_shows("cause", "finding=line", "remedy=known_remedy", "evidence")
@dataclasses.dataclass(frozen=True)
class Diagnosis:
    """What is wrong, as far as the evidence goes.

    Arguments:
        cause: a keyword, such as `parameters`, `start`, `lagged-damping`,
            `damping-per-step`, `stage-time`, `in-place`, `float32`, `step-size`,
            `forces-add-up`, `fixed-node`, `extra-step`, `departure`, `method`,
            `unknown`.
        line: a sentence for the author.
        evidence: the numbers behind it, as plain JSON values.
        remedy: what to write instead; empty where that is not known.
    """

    cause: str
    line: str
    evidence: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    remedy: str = ""

    @property
    def known_remedy(self) -> str | None:
        """What to write instead; None where that is not known."""
        return self.remedy or None


class Fault(NamedTuple):
    """Something that is wrong.

    Fields:
        words: that say it.
        named: whether they name the mistake; if not, they only say how far off a term is.
        remedy: what is to be written instead, if that is known.
        term: that is off by one factor everywhere, and the factor; a key of `TERMS`, or another
            law.
    """

    words: str
    named: bool = True
    remedy: str = ""
    term: tuple[str, float] = ("", 1.0)
