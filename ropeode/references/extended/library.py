"""heyoka, which not every user needs, and which is installed with an extra."""

from __future__ import annotations

import importlib
from typing import Any

from ropeode.errors import InputError


def heyoka() -> Any:
    """The module, imported when it is first needed.

    Raises:
        InputError: it cannot be imported.
    """
    try:
        return importlib.import_module("heyoka")
    except ImportError as error:
        raise InputError(
            f"heyoka: it cannot be imported ({error}); allowed: extended references with the "
            "extra 'extended' only. Fix: pip install 'ropeode[extended]'"
        ) from None
