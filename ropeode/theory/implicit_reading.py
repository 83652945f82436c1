"""The coefficients of an implicit method, read off its step.

Where the slope depends on time alone, each stage's slope is known before its equation is solved.
So a component whose slope is 1 at the time of one stage, and 0 at those of all others, shows the
weight of that stage. A second component whose slope is the first one, at the time of another stage
alone, shows the entry of the matrix. The stages' equations are linear then, and Newton's method,
like any other, solves them up to rounding.
"""

from __future__ import annotations

import numpy as np

from ropeode.tableaus import Tableau
from ropeode.theory.explicit_reading import fractions
from ropeode.theory.recorded_step import NotReadable, RecordedStep

_DT = 0.25
# Times that differ by less are those of one stage, in units of dt.
_SAME_TIME = 1e-6


def read_implicit(step: RecordedStep) -> Tableau:
    """The only tableau that a step may have, if its stages are at different times.

    Arguments:
        step: on states of enough components: one for each stage and each pair of stages.

    Raises:
        NotReadable: the state has too few components.
    """
    size = int(np.prod(step.shape))
    resting = step.run(lambda i, t, y: np.zeros_like(y), 0.0, np.zeros(step.shape), _DT)
    times = _apart(resting.times / _DT)
    stages = len(times)
    if not stages or stages + stages**2 > size:
        raise NotReadable("takes slopes at too many times")

    def slope(i: int, t: float, y: np.ndarray) -> np.ndarray:
        now = np.zeros(stages)
        now[np.argmin(np.abs(t / _DT - times))] = 1.0
        k, flat = np.zeros(size), y.reshape(-1)
        k[:stages] = now
        k[stages : stages + stages**2] = np.outer(now, flat[:stages]).reshape(-1)
        return k.reshape(step.shape)

    result = step.run(slope, 0.0, np.zeros(step.shape), _DT).result.reshape(-1)
    if not np.all(np.isfinite(result)):
        raise NotReadable("gives not-a-number")
    b = result[:stages] / _DT
    pairs = result[stages : stages + stages**2].reshape(stages, stages) / _DT**2
    # Slopes without weight are first guesses.
    (kept,) = np.nonzero(b)
    if not len(kept):
        raise NotReadable("takes slopes that have no weight")
    a = pairs[np.ix_(kept, kept)] / b[kept, None]
    return Tableau(tuple(map(fractions, a)), fractions(b[kept]), fractions(times[kept]))


def _apart(times: np.ndarray) -> np.ndarray:
    """Times without repetitions, in order: that in which a step asks for stages says nothing."""
    different: list[float] = []
    for time in np.sort(times):
        if all(abs(time - other) > _SAME_TIME for other in different):
            different.append(float(time))
    return np.array(different)
