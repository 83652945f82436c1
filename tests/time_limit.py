"""How long a test waits for a process."""

from __future__ import annotations

import time
from collections.abc import Callable

# Only so that one that hangs ends some day; no test may depend on how busy the machine is.
HANGS_AFTER_S = 600


def until(done: Callable[[], object]) -> None:
    """Wait for what another process or thread does."""
    end = time.monotonic() + HANGS_AFTER_S
    while not done() and time.monotonic() < end:
        time.sleep(0.01)
    assert done()
