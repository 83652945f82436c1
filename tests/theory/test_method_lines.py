"""A tableau as the lines of a program, and which of them a nearly right method must have."""

import dataclasses
from fractions import Fraction

from ropeode.theory.known_tableaus import EXPLICIT, SECOND_ORDER
from ropeode.theory.method_lines import lines_of
from ropeode.theory.recognised_methods import recognised


def test_the_lines_of_well_known_methods():
    assert lines_of(EXPLICIT["Heun's method"]) == [
        "k1 = f(t, y)",
        "k2 = f(t + dt, y + dt * k1)",
        "y_new = y + dt * (1/2 * k1 + 1/2 * k2)",
    ]
    assert lines_of(SECOND_ORDER["velocity-verlet"])[1:] == [
        "k2 = a(t + dt, x_new)",
        "x_new = x + dt * v + 1/2 * dt**2 * k1",
        "v_new = v + dt * (1/2 * k1 + 1/2 * k2)",
    ]


def test_only_what_differs_is_corrected():
    rk4 = EXPLICIT["RK4"]
    wrong = dataclasses.replace(rk4, a=(*rk4.a[:3], (0, Fraction(1), 0, 0)))
    found = recognised(wrong)
    assert found is not None
    assert found.corrections == ["k4 = f(t + dt, y + dt * k3)"]
    exact = recognised(rk4)
    assert exact is not None
    assert exact.corrections == []
