"""daceypy's Dormand-Prince method of order 8, one step at a time."""

from __future__ import annotations

import numpy as np
from daceypy import integrator
from daceypy.RK import RK78_DP
from rope import runs_of


class OneStep(integrator):
    """From time 0 to `dt`, in a step of that length."""

    def __init__(self, slope, t, dt):
        super().__init__(RK78_DP(), np.ndarray)
        self.f = lambda y, since: slope(t + since, y)
        self.loadTime(0.0, dt)
        self.loadTol(1.0, 1.0)
        self.loadStepSize(dt, dt)

    def _acceptStep(self, pn, tnew):
        """Overloaded, as its documentation suggests: any error will do.

        `tnew` may be one rounding off the end, which `propagate` then never reaches.
        """
        self._err = 0.0
        super()._acceptStep(pn, self._tf)


def step(slope, t, y, dt):
    """One step."""
    one = OneStep(slope, t, dt)
    return one.propagate(y, 0.0, dt)


if __name__ == "__main__":
    runs_of(step)
