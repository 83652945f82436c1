"""Stiff problems of the test sets, certified in each component and held against known end values.

    python benchmarks/published.py --out build/published.json [--only NAME ...]

The problems are those of the Test Set for IVP Solvers (Mazzia and Magherini, release 2.4), of
DETEST (Enright, Hull, and Lindberg, Comparing numerical methods for stiff systems of O.D.E.s, BIT
15, 1975; Enright and Pryce, Two FORTRAN packages for assessing initial value methods, ACM
Transactions on Mathematical Software 13, 1987), and of Hairer, Nørsett, and Wanner, Solving
Ordinary Differential Equations I and II. All are written in NumPy and given to
`Problem.from_scipy`, each component in units of its own largest value, rounded to a power of ten,
so that an accuracy of 1e-9 is one of each component.

End values are the test set's own where it has some. The others are those of SciPy's Radau at 1e-12,
and `agreed` is how far those of its LSODA at the same tolerance are from them. What the output file
holds already is not computed again.
"""

from __future__ import annotations

import argparse
import functools
import json
import sys
import time
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from ropeode import reference
from ropeode.errors import ReferenceRefused
from ropeode.problems import Problem

ACCURACIES = 1e-9, 1e-6
FRAMES = 5
PROBLEMS = {}


def problem(name, end, y0, published=None, jumps=(), start=0.0):
    """Enter a right-hand side ``f(t, y)``; `published` are end values, a dict for some of them."""

    def enter(fun):
        values = published if isinstance(published, dict) else dict(enumerate(published or ()))
        PROBLEMS[name] = fun, (start, end), np.array(y0, dtype=float), values, jumps
        return fun

    return enter


@problem(
    "HIRES",
    321.8122,
    [1, 0, 0, 0, 0, 0, 0, 0.0057],
    [
        0.7371312573325668e-3,
        0.1442485726316185e-3,
        0.5888729740967575e-4,
        0.1175651343283149e-2,
        0.2386356198831331e-2,
        0.6238968252742796e-2,
        0.2849998395185769e-2,
        0.2850001604814231e-2,
    ],
)
def hires(t, y):
    fast = 280.0 * y[5] * y[7]
    return np.array(
        [
            -1.71 * y[0] + 0.43 * y[1] + 8.32 * y[2] + 0.0007,
            1.71 * y[0] - 8.75 * y[1],
            -10.03 * y[2] + 0.43 * y[3] + 0.035 * y[4],
            8.32 * y[1] + 1.71 * y[2] - 1.12 * y[3],
            -1.745 * y[4] + 0.43 * y[5] + 0.43 * y[6],
            -fast + 0.69 * y[3] + 1.71 * y[4] - 0.43 * y[5] + 0.69 * y[6],
            fast - 1.81 * y[6],
            -fast + 1.81 * y[6],
        ]
    )


@problem(
    "pollution",
    60.0,
    [0, 0.2, 0, 0.04, 0, 0, 0.1, 0.3, 0.01, 0, 0, 0, 0, 0, 0, 0, 0.007, 0, 0, 0],
    [
        0.5646255480022769e-01,
        0.1342484130422339e00,
        0.4139734331099427e-08,
        0.5523140207484359e-02,
        0.2018977262302196e-06,
        0.1464541863493966e-06,
        0.7784249118997964e-01,
        0.3245075353396018e00,
        0.7494013383880406e-02,
        0.1622293157301561e-07,
        0.1135863833257075e-07,
        0.2230505975721359e-02,
        0.2087162882798630e-03,
        0.1396921016840158e-04,
        0.8964884856898295e-02,
        0.4352846369330103e-17,
        0.6899219696263405e-02,
        0.1007803037365946e-03,
        0.1772146513969984e-05,
        0.5682943292316392e-04,
    ],
)
def pollution(t, y):
    r1, r2, r3 = 0.35 * y[0], 26.6 * y[1] * y[3], 12300.0 * y[4] * y[1]
    r4, r5, r6, r7 = 0.86e-3 * y[6], 0.82e-3 * y[6], 15000.0 * y[6] * y[5], 0.13e-3 * y[8]
    r8, r9, r10 = 24000.0 * y[8] * y[5], 16500.0 * y[10] * y[1], 9000.0 * y[10] * y[0]
    r11, r12, r13 = 0.022 * y[12], 12000.0 * y[9] * y[1], 1.88 * y[13]
    r14, r15, r16 = 16300.0 * y[0] * y[5], 4.8e6 * y[2], 0.35e-3 * y[3]
    r17, r18, r19 = 0.0175 * y[3], 1e8 * y[15], 4.44e11 * y[15]
    r20, r21, r22 = 1240.0 * y[16] * y[5], 2.1 * y[18], 5.78 * y[18]
    r23, r24, r25 = 0.0474 * y[0] * y[3], 1780.0 * y[18] * y[0], 3.12 * y[19]
    return np.array(
        [
            -r1 - r10 - r14 - r23 - r24 + r2 + r3 + r9 + r11 + r12 + r22 + r25,
            -r2 - r3 - r9 - r12 + r1 + r21,
            -r15 + r1 + r17 + r19 + r22,
            -r2 - r16 - r17 - r23 + r15,
            -r3 + 2.0 * r4 + r6 + r7 + r13 + r20,
            -r6 - r8 - r14 - r20 + r3 + 2.0 * r18,
            -r4 - r5 - r6 + r13,
            r4 + r5 + r6 + r7,
            -r7 - r8,
            -r12 + r7 + r9,
            -r9 - r10 + r8 + r11,
            r9,
            -r11 + r10,
            -r13 + r12,
            r14,
            -r18 - r19 + r16,
            -r20,
            r20,
            -r21 - r22 - r24 + r23 + r25,
            -r25 + r24,
        ]
    )


@problem(
    "ring modulator",
    1e-3,
    [0.0] * 15,
    [
        -0.2339057358486745e-1,
        -0.7367485485540825e-2,
        0.2582956709291169e0,
        -0.4064465721283450e0,
        -0.4039455665149794e0,
        0.2607966765422943e0,
        0.1106761861269975e0,
        0.2939904342435596e-6,
        -0.2840029933642329e-7,
        0.7267198267264553e-3,
        0.7929487196960840e-3,
        -0.7255283495698965e-3,
        -0.7941401968526521e-3,
        0.7088495416976114e-4,
        0.2390059075236570e-4,
    ],
)
def ring_modulator(t, y):
    c, cs, cp, lh, ls1, ls2, ls3 = 1.6e-8, 2e-12, 1e-8, 4.45, 2e-3, 5e-4, 5e-4
    gamma, delta, r, rp, ri, rc = 40.67286402e-9, 17.7493332, 25e3, 50.0, 50.0, 600.0
    rg1, rg2, rg3 = 36.3, 17.3, 17.3
    uin1, uin2 = 0.5 * np.sin(2e3 * np.pi * t), 2.0 * np.sin(2e4 * np.pi * t)
    q1 = gamma * (np.exp(delta * (y[2] - y[4] - y[6] - uin2)) - 1.0)
    q2 = gamma * (np.exp(delta * (-y[3] + y[5] - y[6] - uin2)) - 1.0)
    q3 = gamma * (np.exp(delta * (y[3] + y[4] + y[6] + uin2)) - 1.0)
    q4 = gamma * (np.exp(delta * (-y[2] - y[5] + y[6] + uin2)) - 1.0)
    return np.array(
        [
            (y[7] - 0.5 * y[9] + 0.5 * y[10] + y[13] - y[0] / r) / c,
            (y[8] - 0.5 * y[11] + 0.5 * y[12] + y[14] - y[1] / r) / c,
            (y[9] - q1 + q4) / cs,
            (-y[10] + q2 - q3) / cs,
            (y[11] + q1 - q3) / cs,
            (-y[12] - q2 + q4) / cs,
            (-y[6] / rp + q1 + q2 - q3 - q4) / cp,
            -y[0] / lh,
            -y[1] / lh,
            (0.5 * y[0] - y[2] - rg2 * y[9]) / ls2,
            (-0.5 * y[0] + y[3] - rg3 * y[10]) / ls3,
            (0.5 * y[1] - y[4] - rg2 * y[11]) / ls2,
            (-0.5 * y[1] + y[5] - rg3 * y[12]) / ls3,
            (-y[0] + uin1 - (ri + rg1) * y[13]) / ls1,
            (-y[1] - (rc + rg1) * y[14]) / ls1,
        ]
    )


@problem(
    "chemical Akzo Nobel",
    180.0,
    [0.437, 0.00123, 0, 0, 0, 0.367],
    [
        0.1161602274780192,
        0.1119418166040848e-2,
        0.1621261719785814,
        0.3396981299297459e-2,
        0.1646185108335055,
        0.1989533275954281,
    ],
)
def akzo_nobel(t, y):
    r1, r2 = 18.7 * y[0] ** 4 * np.sqrt(y[1]), 0.58 * y[2] * y[3]
    r3, r4 = 0.58 / 34.4 * y[0] * y[4], 0.09 * y[0] * y[3] ** 2
    r5, inflow = 0.42 * y[5] ** 2 * np.sqrt(y[1]), 3.3 * (0.9 / 737.0 - y[1])
    return np.array(
        [
            -2.0 * r1 + r2 - r3 - r4,
            -0.5 * r1 - r4 - 0.5 * r5 + inflow,
            r1 - r2 + r3,
            -r2 + r3 - 2.0 * r4,
            r2 - r3 + r5,
            -r5,
        ]
    )


@problem(
    "beam",
    5.0,
    [0.0] * 80,
    {
        0: -0.5792366591285007e-02,
        9: -0.9119134654647947e-01,
        19: -0.1483595472463012e00,
        39: -0.1767201761075488e00,
        40: 0.3747362681329794e-01,
        49: 0.5987609702624270e00,
        59: 0.9868747821728363e00,
        79: 0.1186724615113034e01,
    },
    jumps=(np.pi,),
)
def beam(t, y):
    n = 40
    x, v = y[:n], y[n:]
    sine, cosine = np.sin(x[1:] - x[:-1]), np.cos(x[1:] - x[:-1])
    before = np.concatenate([-x[:1], x[:-1]])
    after = np.concatenate([x[1:], x[-1:]])
    force = np.where(t < np.pi, 1.5 * np.sin(t) ** 2, 0.0)
    g = n**4 * (before - 2.0 * x + after) + n**2 * force * (np.cos(x) + np.sin(x))
    none = np.zeros(1)
    w = np.concatenate([sine * g[1:], none]) - np.concatenate([none, sine * g[:-1]]) + v**2
    diagonal = np.array([1.0] + [2.0] * (n - 2) + [3.0])
    matrix = np.diag(diagonal) - np.diag(cosine, 1) - np.diag(cosine, -1)
    w = np.linalg.solve(matrix, w)
    u = (
        diagonal * g
        - np.concatenate([cosine * g[1:], none])
        - np.concatenate([none, cosine * g[:-1]])
    )
    u = u + np.concatenate([sine * w[1:], none]) - np.concatenate([none, sine * w[:-1]])
    return np.concatenate([v, u])


@problem(
    "Pleiades",
    3.0,
    [
        3,
        3,
        -1,
        -3,
        2,
        -2,
        2,
        3,
        -3,
        2,
        0,
        0,
        -4,
        4,
        0,
        0,
        0,
        0,
        0,
        1.75,
        -1.5,
        0,
        0,
        0,
        -1.25,
        1,
        0,
        0,
    ],
    [
        0.3706139143970502e00,
        0.3237284092057233e01,
        -0.3222559032418324e01,
        0.6597091455775310e00,
        0.3425581707156584e00,
        0.1562172101400631e01,
        -0.7003092922212495e00,
        -0.3943437585517392e01,
        -0.3271380973972550e01,
        0.5225081843456543e01,
        -0.2590612434977470e01,
        0.1198213693392275e01,
        -0.2429682344935824e00,
        0.1091449240428980e01,
        0.3417003806314313e01,
        0.1354584501625501e01,
        -0.2590065597810775e01,
        0.2025053734714242e01,
        -0.1155815100160448e01,
        -0.8072988170223021e00,
        0.5952396354208710e00,
        -0.3741244961234010e01,
        0.3773459685750630e00,
        0.9386858869551073e00,
        0.3667922227200571e00,
        -0.3474046353808490e00,
        0.2344915448180937e01,
        -0.1947020434263292e01,
    ],
)
def pleiades(t, y):
    x, z = y[:7], y[7:14]
    dx, dz = x[None, :] - x[:, None], z[None, :] - z[:, None]
    cubes = (dx**2 + dz**2 + np.eye(7)) ** 1.5
    masses = np.arange(1.0, 8.0)
    return np.concatenate([y[14:], (dx / cubes) @ masses, (dz / cubes) @ masses])


@problem("Van der Pol", 2e3, [2, 0], [0.1706167732170469e1, -0.8928097010248125e-3])
def van_der_pol(t, y):
    return np.array([y[1], 1e3 * (1.0 - y[0] ** 2) * y[1] - y[0]])


@problem("Van der Pol, scaled", 2.0, [2, 0], [0.1706167732170483e1, -0.8928097010247975e0])
def van_der_pol_scaled(t, y):
    return np.array([y[1], ((1.0 - y[0] ** 2) * y[1] - y[0]) / 1e-6])


@problem(
    "Oregonator",
    360.0,
    [1, 2, 3],
    [0.1000814870318523e1, 0.1228178521549917e4, 0.1320554942846706e3],
)
def oregonator(t, y):
    return np.array(
        [
            77.27 * (y[1] + y[0] * (1.0 - 8.375e-6 * y[0] - y[1])),
            (y[2] - (1.0 + y[0]) * y[1]) / 77.27,
            0.161 * (y[0] - y[2]),
        ]
    )


@problem(
    "Robertson",
    1e11,
    [1, 0, 0],
    [0.2083340149701255e-7, 0.8333360770334713e-13, 0.9999999791665050e0],
)
def robertson(t, y):
    slow, fast = -0.04 * y[0] + 1e4 * y[1] * y[2], 3e7 * y[1] ** 2
    return np.array([slow, -slow - fast, fast])


def _e5(t, y):
    p1, p2 = 7.89e-10 * y[0], 1.1e7 * y[0] * y[2]
    p3, p4 = 1.13e9 * y[1] * y[2], 1.13e3 * y[3]
    return np.array([-p1 - p2, p1 - p3, p1 - p3 - p2 + p4, p2 - p4])


problem(
    "E5",
    1e13,
    [1.76e-3, 0, 0, 0],
    [0.1152903278711829e-290, 0.8867655517642120e-22, 0.8854814626268838e-22, 0.0],
)(_e5)


def _linear(matrix, inflow=0.0):
    return lambda t, y: matrix @ y + inflow


problem("DETEST A1", 20.0, [1] * 4)(_linear(np.diag([-0.5, -1.0, -100.0, -90.0])))
_CHAIN = np.diag(np.ones(8), 1) + np.diag(np.ones(8), -1) - 2.0 * np.eye(9)
_CHAIN[0, :2], _CHAIN[8, 7:] = (-1800.0, 900.0), (1000.0, -2000.0)
problem("DETEST A2", 120.0, [0] * 9)(_linear(_CHAIN, np.append(np.zeros(8), 1000.0)))
problem("DETEST A3", 20.0, [1] * 4)(
    _linear(np.array([[-1e4, 100, -10, 1], [0, -1e3, 10, -10], [0, 0, -1, 10], [0, 0, 0, -0.1]]))
)
problem("DETEST A4", 1.0, [1] * 10)(_linear(np.diag(-(np.arange(1.0, 11.0) ** 5))))
problem("DETEST B1", 20.0, [1, 0, 1, 0])(
    _linear(np.array([[-1.0, 1, 0, 0], [-100, -1, 0, 0], [0, 0, -100, 1], [0, 0, -10000, -100]]))
)
for _name, _alpha in (("B2", 3.0), ("B3", 8.0), ("B4", 25.0), ("B5", 100.0)):
    _rates = np.diag([-10.0, -10.0, -4.0, -1.0, -0.5, -0.1])
    _rates[0, 1], _rates[1, 0] = _alpha, -_alpha
    problem(f"DETEST {_name}", 20.0, [1] * 6)(_linear(_rates))


@problem("DETEST C1", 20.0, [1] * 4)
def c1(t, y):
    return np.array(
        [
            -y[0] + y[1] ** 2 + y[2] ** 2 + y[3] ** 2,
            -10.0 * y[1] + 10.0 * (y[2] ** 2 + y[3] ** 2),
            -40.0 * y[2] + 40.0 * y[3] ** 2,
            -100.0 * y[3] + 2.0,
        ]
    )


def _c(beta, t, y):
    return np.array(
        [
            -y[0] + 2.0,
            -10.0 * y[1] + beta * y[0] ** 2,
            -40.0 * y[2] + 4.0 * beta * (y[0] ** 2 + y[1] ** 2),
            -100.0 * y[3] + 10.0 * beta * (y[0] ** 2 + y[1] ** 2 + y[2] ** 2),
        ]
    )


for _name, _beta in (("C2", 0.1), ("C3", 1.0), ("C4", 10.0), ("C5", 20.0)):
    problem(f"DETEST {_name}", 20.0, [1] * 4)(functools.partial(_c, _beta))


@problem("DETEST D1", 400.0, [0, 0, 0])
def d1(t, y):
    return np.array(
        [
            0.2 * (y[1] - y[0]),
            10.0 * y[0] - (60.0 - 0.125 * y[2]) * y[1] + 0.125 * y[2],
            1.0 + 0.0 * y[2],
        ]
    )


@problem("DETEST D2", 40.0, [1, 0, 0])
def d2(t, y):
    return np.array(
        [
            -0.04 * y[0] + 0.01 * y[1] * y[2],
            400.0 * y[0] - 100.0 * y[1] * y[2] - 3000.0 * y[1] ** 2,
            30.0 * y[1] ** 2,
        ]
    )


@problem("DETEST D3", 20.0, [1, 1, 0, 0])
def d3(t, y):
    return np.array(
        [
            y[2] - 100.0 * y[0] * y[1],
            y[2] + 2.0 * y[3] - 100.0 * y[0] * y[1] - 2e4 * y[1] ** 2,
            -y[2] + 100.0 * y[0] * y[1],
            -y[3] + 1e4 * y[1] ** 2,
        ]
    )


@problem("DETEST D4", 50.0, [1, 1, 0])
def d4(t, y):
    first, second = -0.013 * y[0] - 1000.0 * y[0] * y[2], -2500.0 * y[1] * y[2]
    return np.array([first, second, first + second])


@problem("DETEST D5", 100.0, [0, 0])
def d5(t, y):
    whole = 0.01 + y[0] + y[1]
    return np.array(
        [
            0.01 - (1.0 + (y[0] + 1000.0) * (y[0] + 1.0)) * whole,
            0.01 - (1.0 + y[1] ** 2) * whole,
        ]
    )


@problem("DETEST D6", 1.0, [1, 0, 0])
def d6(t, y):
    first = -y[0] + 1e8 * y[2] * (1.0 - y[0])
    second = -10.0 * y[1] + 3e7 * y[2] * (1.0 - y[1])
    return np.array([first, second, -first - second])


@problem("DETEST E1", 1.0, [0] * 4)
def e1(t, y):
    g = 100.0
    return np.array(
        [
            y[1],
            y[2],
            y[3],
            (y[0] ** 2 - np.sin(y[0]) - g**4) * y[0]
            + (y[1] * y[2] / (y[0] ** 2 + 1.0) - 4.0 * g**3) * y[1]
            + (1.0 - 6.0 * g**2) * y[2]
            + (10.0 * np.exp(-(y[3] ** 2)) - 4.0 * g) * y[3]
            + 1.0,
        ]
    )


@problem("DETEST E2", 1.0, [2, 0])
def e2(t, y):
    return np.array([y[1], 5.0 * (1.0 - y[0] ** 2) * y[1] - y[0]])


@problem("DETEST E3", 500.0, [1, 1, 0])
def e3(t, y):
    return np.array([-(55.0 + y[2]) * y[0] + 65.0 * y[1], 0.0785 * (y[0] - y[1]), 0.1 * y[0]])


problem("DETEST E5", 1000.0, [1.76e-3, 0, 0, 0])(_e5)


@problem("DETEST F1", 1000.0, [761, 0, 600, 0.1])
def f1(t, y):
    k = np.exp(20.7 - 1500.0 / y[0])
    return np.array(
        [
            1.3 * (y[2] - y[0]) + 10400.0 * k * y[1],
            1880.0 * (y[3] - y[1] * (1.0 + k)),
            1752.0 - 269.0 * y[2] + 267.0 * y[0],
            0.1 + 320.0 * y[1] - 321.0 * y[3],
        ]
    )


@problem("DETEST F2", 240.0, [1, 0])
def f2(t, y):
    return np.array([-y[0] - y[0] * y[1] + 294.0 * y[1], y[0] * (1.0 - y[1]) / 98.0 - 3.0 * y[1]])


@problem("DETEST F4", 300.0, [4, 1.1, 4])
def f4(t, y):
    return np.array(
        [
            77.27 * (y[1] - y[0] * y[1] + y[0] - 8.375e-6 * y[0] ** 2),
            (-y[1] - y[0] * y[1] + y[2]) / 77.27,
            0.161 * (y[0] - y[2]),
        ]
    )


_MOON = 0.012277471


@problem(
    "Arenstorf",
    17.0652165601579625588917206249,
    [0.994, 0, 0, -2.00158510637908252240537862224],
    [0.994, 0, 0, -2.00158510637908252240537862224],
)
def arenstorf(t, y):
    earth = 1.0 - _MOON
    first = ((y[0] + _MOON) ** 2 + y[1] ** 2) ** 1.5
    second = ((y[0] - earth) ** 2 + y[1] ** 2) ** 1.5
    return np.array(
        [
            y[2],
            y[3],
            y[0] + 2.0 * y[3] - earth * (y[0] + _MOON) / first - _MOON * (y[0] - earth) / second,
            y[1] - 2.0 * y[2] - earth * y[1] / first - _MOON * y[1] / second,
        ]
    )


@problem("Brusselator", 20.0, [1.5, 3])
def brusselator(t, y):
    return np.array([1.0 + y[0] ** 2 * y[1] - 4.0 * y[0], 3.0 * y[0] - y[0] ** 2 * y[1]])


@problem("Lorenz", 16.0, [-8, 8, 27])
def lorenz(t, y):
    return np.array(
        [10.0 * (y[1] - y[0]), 28.0 * y[0] - y[1] - y[0] * y[2], y[0] * y[1] - 8.0 / 3.0 * y[2]]
    )


_N = 20


@problem(
    "Brusselator with diffusion",
    10.0,
    np.stack(
        [1.0 + np.sin(2.0 * np.pi * np.arange(1, _N + 1) / (_N + 1)), np.full(_N, 3.0)], 1
    ).reshape(-1),
)
def diffusing_brusselator(t, y):
    u, v = y[::2], y[1::2]
    rate = 0.02 * (_N + 1) ** 2

    def spread(w, edge):
        sides = np.concatenate([edge, w[:-1]]), np.concatenate([w[1:], edge])
        return rate * (sides[0] - 2.0 * w + sides[1])

    one = np.ones(1)
    du = 1.0 + u**2 * v - 4.0 * u + spread(u, one)
    dv = 3.0 * u - u**2 * v + spread(v, 3.0 * one)
    return np.stack([du, dv], axis=1).reshape(-1)


def in_own_units(fun, units, t, y):
    return fun(t, y * units) / units


def measured(name):
    """A row: the accuracy reached, the bound, the true error, and the seconds."""
    fun, span, y0, values, jumps = PROBLEMS[name]
    rough = solve_ivp(fun, span, y0, "Radau", rtol=1e-4, atol=1e-30 + 1e-9 * np.max(np.abs(y0)))
    sizes = np.max(np.abs(rough.y), axis=1)
    units = 10.0 ** np.round(np.log10(np.where(sizes > 0.0, sizes, 1.0)))
    row = {"name": name, "unknowns": len(y0), "end": span[1], "published": bool(values)}
    began = time.perf_counter()
    stated = Problem.from_scipy(
        functools.partial(in_own_units, fun, units),
        span,
        y0 / units,
        frames=FRAMES,
        jump_times=jumps,
        name=name,
    )
    for accuracy in ACCURACIES:
        try:
            known = reference(stated, accuracy=accuracy)
        except ReferenceRefused as refusal:
            row |= {"accuracy": None, "why": str(refusal)}
            continue
        certificate = known.certificate
        row |= {
            "accuracy": accuracy if certificate.horizon is None else None,
            "why": certificate.horizon_reason,
            "solver": str(certificate.solver),
            "bound": float(certificate.bounds[stated.quantities[0]][-1]),
            "runs": certificate.seconds,
            "compiling": certificate.compile_seconds,
            "witnesses": {
                f"{w.role} {w.solver} {w.tolerance:.0e}": w.difference
                for w in certificate.witnesses
            },
        }
        if row["accuracy"]:
            break
    row["seconds"] = time.perf_counter() - began
    if row["accuracy"]:
        if not values:
            values, row["agreed"] = computed(stated)
        row["error"] = max(
            abs(known.states[-1, i] - v / (units[i] if row["published"] else 1.0))
            for i, v in values.items()
        )
    return row


def computed(stated):
    """End values by SciPy's Radau, and how far those of LSODA are from them."""
    scipy = stated.to_scipy()
    scipy.pop("t_eval")
    jac = scipy["fun"].jac
    ends = [
        solve_ivp(**scipy, method=method, jac=jac, rtol=1e-12, atol=1e-14).y[:, -1]
        for method in ("Radau", "LSODA")
    ]
    return dict(enumerate(ends[0])), float(np.max(np.abs(ends[0] - ends[1])))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--only", nargs="*", default=list(PROBLEMS), choices=list(PROBLEMS))
    options = parser.parse_args()
    rows = json.loads(options.out.read_text()) if options.out.exists() else []
    for name in options.only:
        if name in {row["name"] for row in rows}:
            continue
        rows.append(measured(name))
        print(rows[-1], flush=True)
        options.out.parent.mkdir(parents=True, exist_ok=True)
        options.out.write_text(json.dumps(rows, indent=1) + "\n")


if __name__ == "__main__":
    main()
