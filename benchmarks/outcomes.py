"""Files of outcomes, to which a benchmark that was interrupted adds when it is run again."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any


def lines_in(out: Path) -> Iterator[dict[str, Any]]:
    """The outcomes in a file, if there is one; a line that was cut off does not count."""
    for text in out.read_text().splitlines() if out.exists() else ():
        try:
            yield json.loads(text)
        except json.JSONDecodeError:
            continue
