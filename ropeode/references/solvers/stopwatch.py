"""How long a run takes."""

from __future__ import annotations

import time


class Stopwatch:
    """Seconds since it was made: by the wall clock, or of the processor if these are fewer.

    So other programs on the same machine take nothing from a run's time, nor do the other threads
    of this one.
    """

    def __init__(self) -> None:
        self._began = time.perf_counter(), time.process_time()

    @property
    def seconds(self) -> float:
        """As above."""
        wall, processor = self._began
        return min(time.perf_counter() - wall, time.process_time() - processor)
