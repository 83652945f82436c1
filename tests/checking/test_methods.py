"""Each method that files are compared with has the order that is said of it, and no other."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from ropeode.checking.diagnosis.methods import METHODS, MISTAKEN

END = 2.0
CASES = [*METHODS["springs"], *MISTAKEN]


class Pendulum:
    """A damped pendulum and a hard spring, as accelerations of two nodes."""

    def __init__(self, damping):
        self.damping, self.last = damping, None

    def __call__(self, x, v):
        self.last = np.stack([-9.0 * np.sin(x[..., 0]), -x[..., 1] - x[..., 1] ** 3], axis=-1)
        self.last = self.last - self.damping * v
        return self.last


def error(method, damping, steps, velocity):
    a, dt = Pendulum(damping), END / steps
    x, v = np.array([[[1.2, 0.9]]]), velocity * np.array([[[0.5, -0.8]]])

    def slope(t, y):
        return np.concatenate([y[2:], Pendulum(damping)(y[None, None, :2], y[2:]).ravel()])

    y = np.concatenate([x.ravel(), v.ravel()])
    right = solve_ivp(slope, (0.0, END), y, method="DOP853", rtol=1e-13, atol=1e-13).y[:2, -1]
    v = method.start(Pendulum(damping), x, v, dt)
    for _ in range(steps):
        x, v = method.step(a, x, v, dt)
    return np.max(np.abs(x.ravel() - right))


@pytest.mark.parametrize("damping", [0.0, 0.4])
@pytest.mark.parametrize("method", CASES, ids=lambda method: method.name)
def test_order(method, damping):
    whole = method.order if isinstance(method.order, int) else method.order[damping > 0.0]
    velocity = 0.0 if "starts at rest" in method.name else 1.0
    coarse, fine = (error(method, damping, steps, velocity) for steps in (512, 768))
    assert np.log(coarse / fine) / np.log(1.5) == pytest.approx(whole, abs=0.2)
