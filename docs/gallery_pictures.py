"""The pictures of the gallery, drawn by the very code that stands above them on the page."""

from __future__ import annotations

import contextlib
import re
import tempfile
from pathlib import Path
from typing import Any

import generated

HERE = Path(__file__).parent
_BLOCKS = iter(
    re.findall(r"^```python\n(.*?)^```", (HERE / "gallery/index.md").read_text(), re.M | re.S)
)
_NAMES: dict[str, Any] = {"__name__": "gallery"}


def drawn(name: str, words: str) -> str:
    """Run the blocks of the page up to the next figure, and show that."""
    return generated.picture(_next("figure"), f"gallery-{name}.png", words)


def filmed(name: str, words: str) -> str:
    """The same for a film."""
    file = _next("film").save(generated.IMAGES / f"gallery-{name}.gif")
    return f"![{words}](../images/{file.name})"


def _next(result: str) -> Any:
    """What the next block makes that has such a result."""
    _NAMES.pop(result, None)
    with tempfile.TemporaryDirectory() as folder, contextlib.chdir(folder):
        while result not in _NAMES:
            exec(compile(next(_BLOCKS), "gallery/index.md", "exec"), _NAMES)
    return _NAMES[result]
