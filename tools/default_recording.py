"""Write the recording of the default scene that the page of the lab plays while Python starts.

``python tools/default_recording.py`` writes ``ropeode/laboratory/page/recordings/default.json``.
"""

from pathlib import Path

import jax

from ropeode.files import write_whole
from ropeode.laboratory import (
    DEFAULT_LADDER,
    DEFAULT_PROBLEM,
    DEFAULT_STEPPERS,
    Laboratory,
    asks_of,
    recorded,
)
from ropeode.progress import bar

FILE = Path(__file__).parents[1] / "ropeode/laboratory/page/recordings/default.json"


def main() -> None:
    """Compute the answers, and write them."""
    jax.config.update("jax_enable_x64", True)
    laboratory = Laboratory()
    asks = asks_of(laboratory, DEFAULT_PROBLEM, DEFAULT_STEPPERS, DEFAULT_LADDER)
    FILE.parent.mkdir(exist_ok=True)
    write_whole(FILE, recorded(asks, laboratory, bar))


if __name__ == "__main__":
    main()
