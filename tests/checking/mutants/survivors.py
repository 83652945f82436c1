"""The mutants that no check rejects, and why none has to."""

from __future__ import annotations

SURVIVORS: dict[str, str] = {
    "explicit_euler: force at the end": (
        "Forces a hundred steps late are no more than a larger error of order 1, which is all that "
        "is claimed: it converges to the solution."
    ),
}
