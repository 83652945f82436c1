"""What is wrong with a step."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from typing import Any


@dataclasses.dataclass(frozen=True)
class Diagnosis:
    """What is wrong, as far as the evidence goes.

    Arguments:
        cause: a keyword, such as `parameters`, `start`, `lagged-damping`,
            `damping-per-step`, `stage-time`, `in-place`, `float32`, `step-size`, `unknown`.
        line: a sentence for the author.
        evidence: the numbers behind it, as plain JSON values.
        remedy: what to write instead, if that is known.
    """

    cause: str
    line: str
    evidence: Mapping[str, Any] = dataclasses.field(default_factory=dict)
    remedy: str = ""
