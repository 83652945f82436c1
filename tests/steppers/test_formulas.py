"""Each stepper against its formula, written out again in plain NumPy."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.integrate import DOP853, RK45

from ropeode.problems import InextensibleRope, Rope
from ropeode.simulation import simulate
from tests.links import stretching
from tests.steppers.every_variant import EVERY_PARAMETER
from tests.steppers.ropes import in_space, sweep_links
from tests.verification.extrapolation import rope_rhs

ROPE = in_space(Rope, stiffness=(30.0, 20.0, 45.0, 10.0))
PROBLEM = ROPE.problem(frames=3)
STEPS = 7
DT = 1.0 / STEPS
START = PROBLEM.positions(PROBLEM.y0[None])[0]
REST = np.linalg.norm(np.diff(START, axis=0), axis=1)

# What holds for each node; positions and velocities are (nodes, dim).
FREE = np.array([[0.0 if i in ROPE.pinned else 1.0] for i in range(5)])
MASS, DAMPING = (np.array(each)[:, None] for each in (ROPE.node_mass, ROPE.damping))
INVERSE_MASS, RATE = FREE / MASS, FREE * DAMPING / MASS
GRAVITY = FREE * np.array(ROPE.gravity)


def slope_of(problem):
    """Of positions and velocities as one array; also of complex ones, for derivatives."""
    rhs = rope_rhs(problem.args)

    def slope(x, v):
        y = np.swapaxes([x, v], 1, 2)
        return np.swapaxes(rhs(0.0, y[None])[0], 1, 2).astype(y.dtype)

    return slope


slope, rigid_slope = slope_of(PROBLEM), slope_of(in_space(InextensibleRope).problem(1))


def acceleration(x, v):
    return slope(x, v)[1]


def undamped(x):
    return acceleration(x, np.zeros_like(x))


def repeated(step):
    """So many steps from positions and velocities to the next ones."""

    def run(x, v, steps):
        for _ in range(steps):
            x, v = step(x, v)
        return x, v

    return run


@repeated
def velocity_verlet(x, v):
    middle = v + DT / 2 * (undamped(x) - RATE * v)
    x = x + DT * middle
    return x, (middle + DT / 2 * undamped(x)) / (1 + RATE * DT / 2)


def runge_kutta(*rows):
    """By the definition: the rows from the second on, and the weights; without times."""

    def run(x, v, steps, dt=DT):
        y = np.stack([x, v])
        for _ in range(steps):
            k, state = [], y
            for row in rows:
                k.append(slope(*state))
                state = y + dt * sum(a * each for a, each in zip(row, k, strict=True))
            y = state
        return y

    return run


rk4 = runge_kutta([1 / 2], [0, 1 / 2], [0, 0, 1], [1 / 6, 1 / 3, 1 / 3, 1 / 6])


def of_scipy(method):
    return runge_kutta(*(method.A[i, :i] for i in range(1, method.n_stages)), method.B)


@repeated
def nystrom4(x, v):
    """Its four accelerations, each with its own velocity."""
    k1 = acceleration(x, v)
    middle = x + DT / 2 * v + DT**2 / 8 * k1
    k2 = acceleration(middle, v + DT / 2 * k1)
    k3 = acceleration(middle, v + DT / 2 * k2)
    k4 = acceleration(x + DT * v + DT**2 / 2 * k3, v + DT * k3)
    x = x + DT * v + DT**2 / 6 * (k1 + k2 + k3)
    return x, v + DT / 6 * (k1 + 2 * k2 + 2 * k3 + k4)


def adams(start, predictor, corrector=None):
    """In multiples of the slopes, the latest first: of the old ones, and with the new one."""

    def run(x, v, steps):
        y = np.stack([x, v])
        known = [slope(*y)]
        for i in range(1, len(predictor)):
            known.append(known[0] if start == "euler" else slope(*rk4(x, v, i, -DT)))
        for _ in range(steps):
            new = y + DT * sum(b * each for b, each in zip(predictor, known, strict=True))
            if corrector is not None:
                known_then = [slope(*new), *known[:-1]]
                new = y + DT * sum(b * f for b, f in zip(corrector, known_then, strict=True))
            y, known = new, [slope(*new), *known[:-1]]
        return y

    return run


ADAMS = {
    2: ([3 / 2, -1 / 2], [1 / 2, 1 / 2]),
    3: ([23 / 12, -4 / 3, 5 / 12], [5 / 12, 2 / 3, -1 / 12]),
    4: ([55 / 24, -59 / 24, 37 / 24, -3 / 8], [3 / 8, 19 / 24, -5 / 24, 1 / 24]),
}


def beeman(x, v, steps):
    a = acceleration(x, v)
    a_before = acceleration(x - DT * v + DT**2 / 2 * a, v - DT * a)
    for _ in range(steps):
        x = x + DT * v + DT**2 * (2 / 3 * a - a_before / 6)
        a_new = acceleration(x, v + DT * (3 / 2 * a - a_before / 2))
        v = v + DT * (a_new / 3 + 5 / 6 * a - a_before / 6)
        a, a_before = a_new, a
    return x, v


def after_two(x, before, a, damping):
    """The next positions, from the implicit equation with the damping that is meant."""
    if damping == "lagged":
        return 2 * x - before + DT**2 * (a - RATE * (x - before) / DT)
    if damping == "per-step":
        return x + (1 - FREE * DAMPING) * (x - before) + DT**2 * a
    after = x
    for _ in range(60):
        after = 2 * x - before + DT**2 * (a - RATE * (after - before) / (2 * DT))
    return after


def squares(x):
    return np.sum(np.diff(x, axis=0) ** 2, axis=1)


def pulls(x, needed, inverse_mass, along):
    """The smallest change of node vectors, by pulls along the links, that stretches as needed."""
    weighted = np.broadcast_to(inverse_mass, x.shape).ravel()[:, None] * stretching(x).T
    return (weighted @ np.linalg.solve(stretching(along) @ weighted, needed)).reshape(x.shape)


def swept(x, sweeps):
    x = x.copy()
    for _ in range(sweeps):
        sweep_links(x, REST, INVERSE_MASS[:, 0])
    return x


def two_step(own, forces, slope, sweeps=0):
    """Positions from the two before, which are swept first; velocities are their differences."""

    def run(x, v, steps):
        taylor = x - DT * v + DT**2 / 2 * slope(x, v)[1]
        used, made = [taylor if own.start == "taylor" else x], [x]
        for _ in range(steps + 1):
            used.append(swept(made[-1], sweeps))
            made.append(after_two(used[-1], used[-2], forces(used[-1]), own.damping))
        used.append(swept(made[-1], sweeps))
        return made[steps], (used[steps + 2] - used[steps]) / (2 * DT)

    return run


@repeated
def rattle(x, v):
    middle = v + DT / 2 * (GRAVITY - RATE * v)
    for _ in range(60):
        ahead = x + DT * middle
        wrong = squares(START) - squares(ahead)
        middle = middle + pulls(x, wrong / (2 * DT), INVERSE_MASS, ahead)
    x = x + DT * middle
    v = (middle + DT / 2 * GRAVITY) / (1 + RATE * DT / 2)
    # The pulls act on the new velocity, which its own damping already brakes.
    return x, v + pulls(x, -stretching(x) @ v.ravel(), INVERSE_MASS / (1 + RATE * DT / 2), x)


def kicked(damping, v, a, h):
    """What solves v' = a - r v after the time h, or a step of explicit Euler for it."""
    if damping == "explicit":
        return v + h * (a - RATE * v)
    ends = a / np.where(RATE > 0, RATE, 1)
    return np.where(RATE > 0, ends + np.exp(-RATE * h) * (v - ends), v + h * a)


# Kicks k and drifts d of parts of dt. test_tableaus.py has the order conditions of longer ones.
COMPOSITIONS = {
    "semi-implicit-euler": [("k", 1), ("d", 1)],
    "kick-drift-kick": [("k", 1 / 2), ("d", 1), ("k", 1 / 2)],
    "drift-kick-drift": [("d", 1 / 2), ("k", 1), ("d", 1 / 2)],
}


def composition(parts, damping="explicit"):
    @repeated
    def run(x, v):
        for kind, part in parts:
            if kind == "d":
                x = x + part * DT * v
            else:
                v = kicked(damping, v, undamped(x), part * DT)
        return x, v

    return run


def leapfrog(form, damping):
    if form in COMPOSITIONS:
        return composition(COMPOSITIONS[form], damping)
    back, forth = (composition([("k", part)], damping) for part in (-1 / 2, 1 / 2))
    whole = composition(COMPOSITIONS["semi-implicit-euler"], damping)
    return lambda x, v, steps: forth(*whole(*back(x, v, 1), steps), 1)


def position_based(iterations, sweep, substeps=1, springs=True):
    """Each link in turn, node by node: XPBD with its multiplier, PBD where there are no springs."""
    h = DT / substeps
    weight = (INVERSE_MASS / (1 + h * RATE))[:, 0]
    alpha = [1 / k / h**2 if springs else 0.0 for k in ROPE.stiffness]
    parts = [1, 2, 2, 2, 1] if sweep == "averaged" else [1] * 5

    def project(p, multiplier):
        moved = p.copy()
        for j in range(4):
            a, b = (moved if sweep == "gauss-seidel" else p)[[j, j + 1]]
            apart = np.linalg.norm(a - b)
            change = REST[j] - apart - alpha[j] * multiplier[j]
            change /= weight[j] + weight[j + 1] + alpha[j]
            multiplier[j] += change
            moved[j] += weight[j] / parts[j] * change * (a - b) / apart
            moved[j + 1] += weight[j + 1] / parts[j + 1] * change * (b - a) / apart
        return moved

    @repeated
    def substep(x, v):
        p = x + h * (v + h * GRAVITY) / (1 + h * RATE)
        multiplier = [0.0] * 4
        for _ in range(iterations):
            p = project(p, multiplier)
        return p, (p - x) / h

    return lambda x, v, steps: substep(x, v, steps * substeps)


def projective_dynamics(iterations):
    """The smallest value over positions, then over directions, with full matrices."""
    free = [i for i in range(5) if i not in ROPE.pinned]
    mass = np.diag((MASS * (1 + DT * RATE))[:, 0]) / DT**2
    differences = np.diff(np.eye(5), axis=0)
    matrix = mass + differences.T @ np.diag(ROPE.stiffness) @ differences

    @repeated
    def run(x, v):
        p = x + DT * (v + DT * GRAVITY) / (1 + DT * RATE)
        new = p
        for _ in range(iterations):
            gaps = differences @ new
            ideal = (REST / np.linalg.norm(gaps, axis=1))[:, None] * gaps
            right = mass @ p + differences.T @ (np.array(ROPE.stiffness)[:, None] * ideal)
            right -= matrix[:, ROPE.pinned] @ x[list(ROPE.pinned)]
            new = x.copy()
            new[free] = np.linalg.solve(matrix[np.ix_(free, free)], right[free])
        return new, (new - x) / DT

    return run


def flat_slope(y):
    return slope(*y.reshape(2, 5, 3)).reshape(-1)


def derivative(function, y):
    """The Jacobian, by complex steps: exact up to rounding."""
    columns = [function(y + 1e-30j * unit).imag / 1e-30 for unit in np.eye(len(y))]
    return np.stack(columns, axis=1)


def root(function, guess, newton):
    """Where a function is zero; or where it is, linearised at the guess."""
    inverse = np.linalg.inv(derivative(function, guess))
    for _ in range(40 if newton == "converged" else 1):
        guess = guess - inverse @ function(guess)
    return guess


R = np.sqrt(3.0) / 6
# Of methods whose weights are equal.
MATRICES = {
    "implicit-euler": np.array([[1]]),
    "implicit-midpoint": np.array([[1 / 2]]),
    "trapezium": np.array([[0, 0], [1 / 2, 1 / 2]]),
    "gauss4": np.array([[1 / 4, 1 / 4 - R], [1 / 4 + R, 1 / 4]]),
}


def implicit(name, newton):
    """The equations of the whole state, solved together."""

    def bdf2(y, before):
        return root(lambda new: 3 / 2 * new - 2 * y + before / 2 - DT * flat_slope(new), y, newton)

    def by_stages(y, before):
        matrix = MATRICES[name]

        def off(slopes):
            k = slopes.reshape(len(matrix), -1)
            return (k - [flat_slope(y + DT * row @ k) for row in matrix]).reshape(-1)

        # With slopes of zero all stages are at the old state.
        k = root(off, np.zeros(len(matrix) * len(y)), newton).reshape(len(matrix), -1)
        return y + DT * np.mean(k, axis=0)

    def run(x, v, steps):
        y = np.stack([x, v]).reshape(-1)
        before = y - DT * flat_slope(y)
        for _ in range(steps):
            y, before = (bdf2 if name == "bdf2" else by_stages)(y, before), y
        return y.reshape(2, 5, 3)

    return run


PLAIN = {
    "explicit-euler": runge_kutta([1]),
    "velocity-verlet": velocity_verlet,
    "rk4": rk4,
    "heun": runge_kutta([1], [0.5, 0.5]),
    "midpoint": runge_kutta([0.5], [0, 1]),
    "ralston2": runge_kutta([2 / 3], [0.25, 0.75]),
    "ralston3": runge_kutta([0.5], [0, 0.75], [2 / 9, 3 / 9, 4 / 9]),
    "kutta3": runge_kutta([0.5], [-1, 2], [1 / 6, 4 / 6, 1 / 6]),
    "three-eighths": runge_kutta([1 / 3], [-1 / 3, 1], [1, -1, 1], [1 / 8, 3 / 8, 3 / 8, 1 / 8]),
    "ssprk3": runge_kutta([1], [1 / 4, 1 / 4], [1 / 6, 1 / 6, 4 / 6]),
    "dormand-prince5": of_scipy(RK45),
    "dormand-prince8": of_scipy(DOP853),
    "rkn4": nystrom4,
    "beeman": beeman,
    "rattle": rattle,
}
WITH_OPTIONS = {
    "stormer-verlet": lambda own: two_step(own, undamped, slope),
    "constraint-verlet": lambda own: two_step(own, lambda x: GRAVITY, rigid_slope, own.sweeps),
    "leapfrog": lambda own: leapfrog(own.form, own.damping),
    "pbd": lambda own: position_based(own.iterations, own.sweep, springs=False),
    "xpbd": lambda own: position_based(own.iterations, own.sweep, own.substeps),
    "projective-dynamics": lambda own: projective_dynamics(own.iterations),
}


def formula_of(stepper):
    if stepper.name in WITH_OPTIONS:
        return WITH_OPTIONS[stepper.name](stepper)
    if stepper.name in COMPOSITIONS:
        return composition(COMPOSITIONS[stepper.name])
    if hasattr(stepper, "substeps"):
        parts = zip(itertools.cycle("dk"), np.ravel(stepper.substeps), strict=False)
        return composition([*parts], stepper.damping)
    if stepper.name.startswith("adams"):
        predictor, corrector = ADAMS[int(stepper.name[-1])]
        return adams(stepper.start, predictor, corrector if "pece" in stepper.name else None)
    if stepper.family == "implicit":
        return implicit(stepper.name, stepper.newton)
    return PLAIN[stepper.name]


@pytest.mark.parametrize("stepper", EVERY_PARAMETER)
def test_stepper_is_its_formula(stepper):
    """And a run repeats to the bit, without compiling anew; what is pinned stays to the bit."""
    formula = formula_of(stepper)
    run, again = (simulate(PROBLEM, stepper, STEPS) for _ in range(2))
    assert run.status == "ok"
    assert np.array_equal(run.states[0], PROBLEM.y0)
    assert np.array_equal(run.states, again.states)
    assert again.compile_seconds == 0.0
    found = np.stack([run.positions, run.velocities], axis=1)
    pinned = list(ROPE.pinned)
    assert np.all(found[:, :, pinned] == found[0][:, pinned])
    for frame in range(1, 4):
        expected = formula(*found[0], frame * STEPS)
        # For some methods the step is too long, and what is rounded grows twentyfold.
        np.testing.assert_allclose(found[frame], expected, rtol=1e-10, atol=1e-10)
