"""The study of small steps agrees with runs written out, with theory, and with its page."""

from __future__ import annotations

import math
import sys
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from docs.studies import small_steps
from docs.studies.small_step_plots import plot_cheapest, plot_damping, plot_splits
from docs.studies.small_steps import (
    Cheapest,
    Damped,
    Splits,
    cheapest,
    damping_rates,
    fewest_steps,
    rope_of,
    splits,
    tip_errors,
    truth_of,
)
from ropeode import Rope, hanging_equilibrium, reference, simulate
from ropeode.analysis import frequencies
from ropeode.theory import stability_function_of

DOCS = Path(__file__).parents[2] / "docs"
MASS, STIFFNESS = np.array([1.0, 2.0, 0.7, 1.5, 1.2]), np.array([300.0, 900.0, 500.0, 700.0])
GRAVITY, FRAMES = np.array([0.0, -1.0]), 8
UNEQUAL = Rope(
    end=(-40.0, 190.0),
    num_nodes=5,
    node_mass=tuple(MASS),
    stiffness=tuple(STIFFNESS),
    damping=0.0,
    initial_velocity=(0.3, -0.6),
)
START = np.linspace((0.0, 200.0), (-40.0, 190.0), 5)
LENGTHS = np.linalg.norm(np.diff(START, axis=0), axis=1)


@pytest.fixture(scope="module")
def truth():
    return reference(UNEQUAL.problem(FRAMES), rtol=1e-10, accuracy=1e-3)


@pytest.fixture(scope="module")
def found(truth):
    return splits(truth, (1, 2, 6))


def xpbd(steps: int, iterations: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities of all frames by XPBD, link by link, ``(frames, nodes, 2)``."""
    dt = 1.0 / steps
    weight = np.array([0.0, *(1.0 / MASS[1:])])
    x, v = START.copy(), np.array([(0.0, 0.0)] + [(0.3, -0.6)] * 4)
    kept = [(x, v)]
    for step in range(steps * FRAMES):
        p = x + dt * (v + dt * GRAVITY) * (weight > 0)[:, None]
        total = np.zeros(4)
        for _ in range(iterations):
            for j in range(4):
                gap = p[j + 1] - p[j]
                apart, soft = np.linalg.norm(gap), 1.0 / STIFFNESS[j] / dt**2
                more = (apart - LENGTHS[j] - soft * total[j]) / (weight[j] + weight[j + 1] + soft)
                total[j] += more
                p[j] += weight[j] * more * gap / apart
                p[j + 1] -= weight[j + 1] * more * gap / apart
        x, v = p, (p - x) / dt
        if (step + 1) % steps == 0:
            kept.append((x, v))
    return np.array([x for x, _ in kept]), np.array([v for _, v in kept])


def energy(x: np.ndarray, v: np.ndarray) -> float:
    stretch = np.linalg.norm(np.diff(x, axis=0), axis=1) - LENGTHS
    moving = 0.5 * MASS @ np.sum(v**2, axis=1) + MASS @ x[:, 1]
    return float(moving + 0.5 * STIFFNESS @ stretch**2)


def solved() -> tuple[np.ndarray, np.ndarray]:
    """The same rope by SciPy, from forces written out."""

    def slope(t: float, y: np.ndarray) -> np.ndarray:
        x, v = y.reshape(2, 5, 2)
        gaps = np.diff(x, axis=0)
        apart = np.linalg.norm(gaps, axis=1)
        pull = (STIFFNESS * (apart - LENGTHS) / apart)[:, None] * gaps
        force = np.pad(pull, ((0, 1), (0, 0))) - np.pad(pull, ((1, 0), (0, 0)))
        a = GRAVITY + force / MASS[:, None]
        a[0] = 0.0
        return np.concatenate([v.ravel(), a.ravel()])

    v = np.array([(0.0, 0.0)] + [(0.3, -0.6)] * 4)
    y0 = np.concatenate([START.ravel(), v.ravel()])
    ts = np.arange(FRAMES + 1.0)
    y = solve_ivp(slope, (0.0, FRAMES), y0, "DOP853", ts, rtol=1e-12, atol=1e-10).y.T
    states = y.reshape(-1, 2, 5, 2)
    return states[:, 0], states[:, 1]


@pytest.mark.slow
@pytest.mark.parametrize(("steps", "iterations"), [(6, 1), (1, 6)])
def test_a_run_is_what_comes_out_link_by_link(found, steps, iterations):
    run, (x, v), (true_x, true_v) = found.run(steps, iterations), xpbd(steps, iterations), solved()
    length = LENGTHS.sum()
    apart = np.linalg.norm(x - true_x, axis=2)[1:] / length
    assert run.status == "ok"
    assert run.final == pytest.approx(apart[-1, -1], rel=1e-6)
    assert run.max == pytest.approx(apart[:, -1].max(), rel=1e-6)
    assert run.rms == pytest.approx(np.sqrt(np.mean(apart[:, -1] ** 2)), rel=1e-6)
    assert run.worst == pytest.approx(apart.max(), rel=1e-6)
    lost = energy(x[0], v[0]) - energy(x[-1], v[-1])
    kinetic = 0.5 * MASS @ np.sum(true_v[-1] ** 2, axis=1)
    assert run.energy == pytest.approx(lost / kinetic, rel=1e-6)
    longest = np.max(np.linalg.norm(np.diff(x, axis=1), axis=2) / LENGTHS) - 1.0
    assert run.stretch == pytest.approx(longest, rel=1e-6)
    true_longest = np.max(np.linalg.norm(np.diff(true_x, axis=1), axis=2) / LENGTHS) - 1.0
    assert found.stretch == pytest.approx(true_longest, rel=1e-5)


def test_all_splits_of_each_budget_are_run(found):
    each = [(run.steps, run.iterations) for run in found.runs]
    assert sorted(each) == [(1, 1), (1, 2), (1, 6), (2, 1), (3, 2), (6, 1)]


def test_an_error_that_the_reference_cannot_tell_is_left_out(truth):
    exact = simulate(truth.problem, "diffrax:Dopri8", 64)
    assert tip_errors(exact, truth).max is None


def test_the_fewest_steps_are_enough_and_one_less_is_not(truth):
    limit = 0.01 * LENGTHS.sum()
    for row in cheapest(truth, ["implicit-euler:newton=1", "xpbd", "velocity-verlet"], rounds=0):
        assert row.steps == fewest_steps(truth, row.method)
        assert row.seconds is None
        run = simulate(truth.problem, row.method, row.steps)
        tips = np.linalg.norm(run.positions - truth.positions, axis=2)[:, -1]
        assert row.error * LENGTHS.sum() == pytest.approx(tips.max())
        assert tips.max() <= limit
        less = simulate(truth.problem, row.method, row.steps - 1)
        assert less.status != "ok" or (
            np.linalg.norm(less.positions - truth.positions, axis=2)[:, -1].max() > limit
        )
        # Verlet evaluates the forces once at the start as well.
        once = 1 / FRAMES if row.method == "velocity-verlet" else 0
        assert row.units == pytest.approx(row.steps + once)


@pytest.mark.slow
def test_damping_is_that_of_theory_and_of_runs():
    """For a pendulum of one spring XPBD damps as implicit Euler does; Verlet does not damp."""
    pendulum = Rope(end=(-3.0, 200.0), num_nodes=2, node_mass=1.7, stiffness=40.0, damping=0.0)
    problem = pendulum.problem(1)
    omega = frequencies(problem, hanging_equilibrium(problem))[0]
    methods = ["implicit-euler", "xpbd", "velocity-verlet"]
    rows = damping_rates(methods, (6, 20), problem)
    assert [(row.method, row.steps) for row in rows] == [(m, n) for m in methods for n in (6, 20)]
    for row in rows:
        theory = stability_function_of(problem, row.method if row.method != "xpbd" else methods[0])
        factor = theory.factors(np.array([1j * omega / row.steps]))[0]
        rate = -row.steps * math.log(abs(factor))
        assert row.of_step == pytest.approx(rate, rel=1e-7, abs=1e-12)
        assert row.measured == pytest.approx(rate, rel=1e-5, abs=1e-8)
        if row.method != "velocity-verlet":
            assert row.implicit_euler == pytest.approx(rate, rel=1e-9)
        assert abs(row.speed - 1.0) < 0.01


def test_small_steps_divide_the_damping_and_iterations_do_not():
    problem = Rope(num_nodes=4, node_mass=(1, 2, 1, 3), stiffness=70.0, damping=0.0).problem(1)
    methods = ["xpbd", "xpbd:iterations=12"]
    once, small, iterated = damping_rates(methods, (2, 24), problem)[:3]
    assert small.measured == pytest.approx(small.implicit_euler, rel=0.01)
    assert small.measured < once.measured / 10
    assert iterated.measured == pytest.approx(iterated.implicit_euler, rel=0.03)


@pytest.mark.slow
def test_steps_beat_iterations_and_direct_solves_do_not_mind_stiffness():
    for stiffness in (1e2, 1e4):
        truth = truth_of(rope_of(16, stiffness))
        of_rope = splits(truth, (1, 4, 16))
        for budget in (4, 16):
            assert of_rope.run(budget, 1).max < of_rope.run(1, budget).max / 2
            assert of_rope.run(budget, 1).stretch < of_rope.run(1, budget).stretch
        assert fewest_steps(truth, "implicit-euler") == 3
        assert fewest_steps(truth, "xpbd") == 8


@pytest.mark.slow
def test_the_page_has_the_numbers_of_the_code():
    sys.path.insert(0, str(DOCS))
    import generated

    page = (DOCS / "validation/small-steps.md").read_text()
    truth = truth_of(rope_of(16, 1e4))
    of_rope, costs = splits(truth, (1, 4, 16, 64)), cheapest(truth, rounds=0)

    def cells(line: str) -> list[str]:
        return [cell.strip() for cell in line.strip("|").split("|")]

    lines = [cells(line) for line in page.splitlines()]
    for run in of_rope.runs:
        if run.sweeps == 64:
            assert generated.split_row(16, 1e4, of_rope.stretch, run) in lines
    assert ["16", "10000", *map(generated.work_cell, costs)] in lines
    for each in damping_rates(["xpbd", "velocity-verlet"], (1, 16)):
        assert generated.damping_row(each) in lines


@pytest.mark.slow
def test_pictures_hold_the_numbers(found):
    def drawn(axes, x, y) -> bool:
        return any(
            len(line.get_xdata()) == len(x)
            and np.allclose([line.get_xdata(), line.get_ydata()], [x, y], rtol=1e-12)
            for line in axes.get_lines()
        )

    # As many sweeps in one step as in several.
    both = Splits(found.truth, found.stretch, found.runs)
    errors, stretch = plot_splits({(5, 300.0): both}).axes
    iterated = [run for run in found.runs if run.steps == 1]
    assert drawn(errors, [run.sweeps for run in iterated], [run.max for run in iterated])
    assert drawn(stretch, [run.sweeps for run in iterated], [run.stretch for run in iterated])
    costs = {
        (5, k): [Cheapest("xpbd", 3, 0.01, "sweeps", 3.0, (k * 1e-6, k * 5e-7, k * 2e-6))]
        for k in (10.0, 100.0)
    }
    (axes,) = plot_cheapest(costs).axes
    assert drawn(axes, [10.0, 100.0], [10.0, 100.0])
    assert axes.get_ylabel().endswith("[µs]")
    rates, speeds = plot_damping(
        [Damped("xpbd", 2, 0.3, 0.4, 0.5, 0.9), Damped("xpbd", 4, 0.1, 0.2, 0.3, 1.0)]
    ).axes
    assert drawn(rates, [2, 4], [0.4, 0.2])
    assert drawn(rates, [2, 4], [0.3, 0.1])
    assert drawn(speeds, [2, 4], [0.9, 1.0])


def test_a_rope_without_a_reference_has_no_numbers(monkeypatch):
    def refuse(problem):
        raise small_steps.ReferenceRefused("no reference")

    monkeypatch.setattr(small_steps, "truth_of", refuse)
    found = small_steps.every_rope((16,), (1e2,))
    assert found == ({}, {}, {(16, 1e2): "no reference"})
