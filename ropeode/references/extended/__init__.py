"""References in more digits than float64 has, by Taylor series of the same right-hand side."""

from __future__ import annotations

from typing import Any

from ropeode.validation import require


def heyoka() -> Any:
    """The heyoka module, imported when it is first needed.

    Raises:
        InputError: it cannot be imported.
    """
    module = require("heyoka", "extended", "extended references")
    # It warns on standard output, where results go, of a cache folder that it does not find.
    module.set_logger_level_critical()
    return module
