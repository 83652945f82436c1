"""Whether a mistake explains the errors of runs, from what it leaves of them."""

from __future__ import annotations

import operator
from collections.abc import Sequence

import numpy as np

# A mistake explains errors if at most these parts of them remain in the finest run and in the next.
_REMAINDERS = (0.05, 0.2)
# Or if this part remains in the finest run, and falls over so many runs with a power of dt between
# these: the mistake explains the leading term, and the next one or two orders remain.
_LARGEST, _LEAST_POWER, _LARGEST_POWER = 0.25, 0.75, 2.5
RUNS = 3


def explains(parts: Sequence[float], dts: Sequence[float]) -> bool:
    """Whether so little remains that a mistake without free parameters explains the errors.

    Arguments:
        parts: of the errors that remain in each run, from the finest on; `RUNS` are enough.
        dts: their step sizes.
    """
    if len(parts) >= len(_REMAINDERS) and all(map(operator.le, parts, _REMAINDERS)):
        return True
    if len(parts) < RUNS or parts[0] > _LARGEST or min(parts) <= 0.0:
        return False
    powers = np.diff(np.log(parts)) / np.diff(np.log(dts))
    return bool(np.all((powers >= _LEAST_POWER) & (powers <= _LARGEST_POWER)))
