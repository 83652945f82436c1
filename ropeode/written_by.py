"""Who writes results as text.

Results stand below the room that writes them, so they do not import it. The package, which knows
all rooms, names it here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

writer: Callable[[], Any]
