"""What people and programs read, held by files: a small made-up result in each format."""

from __future__ import annotations

import os
from pathlib import Path

FOLDER = Path(__file__).parent / "render/golden"


def check_golden(name: str, text: str) -> None:
    """The text is that of the file; with UPDATE_GOLDEN=1 the file becomes the text.

    Arguments:
        name: of the file.
        text: what is written now.
    """
    path = FOLDER / name
    if os.environ.get("UPDATE_GOLDEN"):
        FOLDER.mkdir(exist_ok=True)
        path.write_text(text)
    assert path.exists(), f"{path} is missing; write it with UPDATE_GOLDEN=1"
    assert text == path.read_text(), f"{path} says something else; see CONTRIBUTING.md"
