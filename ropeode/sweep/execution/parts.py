"""How many problems of a task are finished before its rows are handed back."""

from __future__ import annotations

import time
from collections.abc import Hashable, Iterator, Sequence

# Seconds for each problem of a kind, the last time in this process; None where only the first was
# solved, for which programs were compiled.
_pace: dict[Hashable, float | None] = {}


def in_time(keys: Sequence[str], kind: Hashable, seconds: float) -> Iterator[list[str]]:
    """Problems, some at a time, as long as the time suffices, and one at least.

    The time that the caller takes for those before tells how many are next.

    Arguments:
        keys: of the problems.
        kind: equal for problems that take about the same time.
        seconds: for all of them, without what is compiled.
    """
    left = seconds
    while keys:
        first, pace = kind not in _pace, _pace.get(kind)
        count = max(1, int(left / pace)) if pace else 1
        some, keys = keys[:count], keys[count:]
        began = time.perf_counter()
        yield [*some]
        spent = time.perf_counter() - began
        _pace[kind] = None if first else spent / len(some)
        left -= 0.0 if first else spent
        if left < (_pace[kind] or 0.0):
            return


class Part:
    """The first problems of a task, which become fewer where they take long.

    Arguments:
        keys: of the problems.
        seconds: that their runs may take.
    """

    def __init__(self, keys: Sequence[str], seconds: float):
        self.keys, self._left = [*keys], seconds

    def spend(self, seconds: float, finished: int = 0) -> None:
        """Note that runs took some time; where none is left, later ones are of fewer problems.

        Arguments:
            seconds: that they took.
            finished: so many of the first problems have all the runs of this kind; where it is 0,
                all of them have the same ones.
        """
        self._left -= seconds
        if self._left < 0.0:
            del self.keys[max(1, finished or len(self.keys) // 2) :]
