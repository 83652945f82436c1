"""heyoka, which an extra installs."""

from __future__ import annotations

from typing import Any

from ropeode.validation import require


def heyoka() -> Any:
    """The heyoka module, imported when it is first needed.

    Raises:
        InputError: it cannot be imported.
    """
    return require("heyoka", "extended", "extended references")
