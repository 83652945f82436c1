"""One fault that several files have, said once."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path

from ropeode.validation import listed

_NUMBER = re.compile(r"[-+]?\d[\d.]*(e[-+]?\d+)?", re.IGNORECASE)


def each_once(faults: Sequence[tuple[Path, str]]) -> list[str]:
    """Complaints about files; those that differ by numbers alone are one, which names all files.

    Arguments:
        faults: the path of a file and the complaint, in the order of the files.
    """
    alike: dict[str, list[tuple[Path, str]]] = {}
    for path, line in faults:
        alike.setdefault(_NUMBER.sub("#", line.replace(str(path), "")), []).append((path, line))
    return [_together([path for path, _ in each], each[0][1]) for each in alike.values()]


def _together(paths: Sequence[Path], line: str) -> str:
    others = list(dict.fromkeys(path.name for path in paths[1:] if path != paths[0]))
    return f"{line} So in {listed(others)}." if others else line
