"""Rooms that results ask for what stands above them: for text, or for more references.

Results do not import these rooms. The package, which knows all rooms, names them here.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

render: Callable[[], Any]
references: Callable[[], Any]
