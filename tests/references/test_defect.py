"""What a right-hand side does between the steps of the solvers."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from ropeode import Problem, ReferenceRefused, reference
from ropeode.problems import Ensemble
from ropeode.references import SCIPY_DOP853, solve
from ropeode.references.defect import look_between
from tests.references.covered import assert_covered, covered

as_for_users = pytest.mark.usefixtures("looked_at_as_for_users")

TS = np.linspace(0.0, 10.0, 6)
# Of a state that is found to be right to some units of rounding.
BOUNDS = {"state": np.full(len(TS), 1e-15)}


def _pulses(t, y, args):
    """A turn of two numbers; a rectangular pulse in time, and one in the second number."""
    height, start, end, level, width = args
    kick = jnp.where((t > start) & (t < end), height, 0.0)
    there = jnp.where(jnp.abs(y[1] - level) < width, 1.0, 0.0)
    return jnp.stack([y[1] + there, -y[0] + kick])


def _roots(t, y, args):
    return -jnp.sqrt(y)


def _holes(t, y, args):
    _, start, end, *_ = args
    return jnp.where((t == start) | (t == end), jnp.nan, jnp.where(t < start, -y, y))


def _grows(t, y, args):
    """A window in the first number, through which it grows."""
    height, low, high, rate, own = args
    pushed = jnp.where((y[0] > low) & (y[0] < high), height, 0.0)
    return jnp.stack([rate * y[0], own * y[1] + pushed])


def _needles(t, y, args):
    """A needle of a tenth of the spacing in each hundredth, at places without order."""
    height, *_ = args
    which = jnp.floor(t * 100.0)
    place = 0.01 * (which + jnp.abs(jnp.sin(12345.678 * which)) % 0.9)
    return jnp.stack([y[1], -y[0] + jnp.where((t > place) & (t < place + 2e-7), height, 0.0)])


EQUATIONS = {each.__name__: each for each in (_pulses, _needles, _roots, _holes, _grows)}


def rhs(t, y, args):
    """One of `EQUATIONS`, so that one compilation serves all."""
    which, numbers = args
    return jax.lax.switch(which, list(EQUATIONS.values()), t, y, numbers)


def turn(height=0.0, start=0.0, end=0.0, level=9.0, width=0.0, equation=_pulses, **more):
    which = np.int64(list(EQUATIONS.values()).index(equation))
    args = which, (height, start, end, level, width)
    return Problem(**{"rhs": rhs, "y0": [1.0, 0.5], "ts": TS, "args": args, **more})


@pytest.fixture(scope="module")
def path():
    """The steps of a solver that has seen no pulse."""
    run = solve(turn(), SCIPY_DOP853, 1e-13, 1e-13, max_steps=1000)
    assert run.path is not None
    np.testing.assert_array_equal(run.path.states[-1], run.states[-1])
    return run.path


@as_for_users
def test_what_lasts_longer_than_the_spacing_is_found_wherever_it_is_and_nothing_else(path):
    smooth = look_between(turn(), path, BOUNDS)
    assert smooth.sampling.times >= 2**20
    assert smooth.sampling.spacing <= 10.0 / 2**20
    assert len(smooth.times) == len(smooth.stops) == 0
    width = 1.001 * smooth.sampling.spacing
    random = np.random.default_rng(3)
    places = [*random.uniform(0.0, 10.0 - width, 3), 1e-9, 10.0 - 1.001 * width, TS[2] - width / 2]
    for start in places:
        found = look_between(turn(1e-3, start, start + width), path, BOUNDS)
        # Two, where it is in two steps.
        assert 1 <= len(found.times) <= 2
        for at, lasting in zip(found.times, found.widths, strict=True):
            assert start < at < start + width
            assert lasting < 2 * width
            # A run that stops there, and closer and closer to it, sees it.
            assert np.sum(np.abs(found.stops - at) < width) > 3


def test_what_is_small_is_found_too_but_what_the_bound_covers_is_left_alone(path):
    """Far above rounding, and adding a thousand times what is negligible."""
    found = look_between(turn(1e-9, 3.3, 3.301), path, BOUNDS)
    assert 1 <= len(found.times) <= 2
    assert np.all((found.times > 3.3) & (found.times < 3.301))
    covering = {"state": np.full(len(TS), 1e-9)}
    assert len(look_between(turn(1e-9, 3.3, 3.301), path, covering).times) == 0


@as_for_users
def test_what_is_negligible_in_each_step_may_not_be_together(path):
    """Three crossings of a level, each of which adds the same."""
    crossed, bound = turn(level=0.3, width=1e-3), 1e-6
    whole = np.sum(look_between(crossed, path, {"state": np.full(len(TS), bound)}).shares)
    for share, many in ((0.3, 0), (0.4, 1), (0.6, 2), (1.2, 3)):
        larger = {"state": np.full(len(TS), bound * whole / (3 * share))}
        assert len(look_between(crossed, path, larger).times) == many


def test_a_run_stops_at_a_node_that_was_hit(path):
    """All of the step is off its polynomial then, but for the needle itself."""
    for at in (2.2, 7.7):
        # Where something is found in a step, runs stop at each of its nodes.
        nodes = look_between(turn(1.0, at, at + 1e-3), path, BOUNDS).stops
        node = nodes[np.argmin(np.abs(nodes - at - 0.05))]
        found = look_between(turn(1.0, node - 1e-9, node + 1e-9), path, BOUNDS)
        assert np.any(np.abs(found.stops - node) < 1e-9)


def test_what_depends_on_the_state_is_found(path):
    for level in (0.3, -0.8, 1.0):
        found = look_between(turn(level=level, width=2e-4), path, BOUNDS)
        crossings = np.sum(np.diff(np.sign(path.states[:, 1] - level)) != 0)
        assert len(found.times) == crossings > 0


def pushed(start, end):
    """`turn` with a pulse of height 1, which all samples lie before or after."""
    t = TS
    free = [np.cos(t) + 0.5 * np.sin(t), 0.5 * np.cos(t) - np.sin(t)]
    pulse = [np.cos(t - end) - np.cos(t - start), np.sin(t - start) - np.sin(t - end)]
    return np.stack(free, axis=1) + np.where(t[:, None] > end, np.stack(pulse, axis=1), 0.0)


@as_for_users
def test_the_certificate_says_what_was_seen():
    start, width = 5.3, 2e-5
    kicked = turn(1.0, start, start + width)
    known, *members = reference(kicked), *reference(Ensemble.of([kicked, turn()]))
    assert [each.horizon for each in (known, *members)] == [6.0, 6.0, None]
    assert all(each.certificate.sampling.times > 2**20 for each in members)
    assert "near t = 5.300" in known.certificate.horizon_reason
    assert known.certificate.sampling.times > 2**20
    assert known.certificate.witnesses[-1].role == "close look"
    assert_covered(known, pushed(start, start + width))
    with pytest.raises(ReferenceRefused, match=r"near t = 1\.300.* declare jump_times"):
        reference(turn(1.0, 1.3, 1.3 + width))
    # What changes the solution by less than the accuracy widens the bound instead.
    width *= 10
    told = reference(turn(1.0, start, start + width), accuracy=1e-2)
    assert told.horizon is None
    missed = np.max(np.abs(told.states - pushed(start, start + width)), axis=1)
    assert 0.5 * width < missed[-1] <= told.bound()[-1] < 5 * width


@as_for_users
def test_a_hole_in_the_right_hand_side_is_not_trusted():
    known = reference(turn(np.nan, 5.3, 5.3 + 2e-5))
    assert known.horizon == 6.0
    # Close to zero a root may be asked for less than nothing, off the solution only.
    ts = np.linspace(0.0, 1.99999, 6)
    assert reference(turn(equation=_roots, y0=[1.0, 1.5], ts=ts)).horizon is None


def test_times_are_never_on_a_jump():
    holes = turn(0.0, 2.5, 6.0, equation=_holes, jump_times=[2.5, 6.0])
    run = solve(holes, SCIPY_DOP853, 1e-13, 1e-13, max_steps=1000)
    assert run.failure is None
    assert len(look_between(holes, run.path, BOUNDS).times) == 0


@pytest.mark.slow
@as_for_users
def test_where_one_needle_was_hit_there_may_be_others():
    """Of many needles a tenth is hit; what they do together is not what was seen."""
    ts = np.linspace(0.0, 2.5, 6)
    with pytest.raises(ReferenceRefused, match="solvers step over it"):
        reference(turn(1e-3, equation=_needles, ts=ts), accuracy=1e-3)


# A node hits it, and spoils the polynomial of its step: all is off it but the window itself.
WINDOW, RATES = (1.2089052726877827, 1.2089872370944925), (0.44646090280592166, 0.807577811618335)
AT_A_NODE = (61286.55863275827, *WINDOW, *RATES)


@as_for_users
@pytest.mark.parametrize(
    ("numbers", "span", "y0", "rtol"),
    [
        # Of a few thousandths of the state: where tolerances are loose, the path must be nearer.
        ((-345.0, 3.9357, 3.9367, 2.5, 1.0), 0.74, -0.4, 1e-6),
        ((90.0, 2.2, 2.204, 2.5, 1.0), 0.74, -0.4, 1e-4),
        (AT_A_NODE, 2.0084368246778497, -1.0793797669842606, None),
    ],
)
def test_windows_in_the_state_are_found(numbers, span, y0, rtol):
    """The bound covers what `_grows` does to both numbers, or there is none."""
    height, low, high, rate, own = numbers
    late = np.exp(own * (span - np.log([low, high]) / rate))
    end = y0 * np.exp(own * span) + height / own * (late[0] - late[1])
    problem = turn(*numbers, equation=_grows, y0=[1.0, y0], ts=[0.0, span])
    covered(problem, np.array([[1.0, y0], [np.exp(rate * span), end]]), rtol=rtol)


def test_motion_between_the_samples_counts():
    """Whole turns between the samples: seen there only, nothing moves at all."""
    known = reference(turn(ts=2.0 * np.pi * np.arange(6)))
    assert known.horizon is None
    assert known.certificate.accuracy == pytest.approx(2.118e-8, rel=0.01)


def _clock(t, y, args):
    rate, start = args
    return jnp.stack([jnp.ones(()), rate * jnp.cos(rate * (y[0] - start))])


@as_for_users
@pytest.mark.parametrize(
    ("clock", "rate", "span", "rtol"),
    [
        (1385171085775.8655, 1184138.80307, 9.737e-6, 1.3e-10),
        (37684936176977.78, 62719.552039613, 1.383e-4, None),
    ],
)
def test_what_changes_between_two_numbers_of_the_state_is_not_known(clock, rate, span, rtol):
    """The clock stands still: its last place is many turns, or nearly whole ones."""
    problem = Problem(_clock, [clock, 0.1], np.linspace(0.0, span, 17), (rate, clock))
    exact = [np.longdouble(clock) + problem.ts, 0.1 + np.sin(rate * problem.ts)]
    covered(problem, np.stack(exact, axis=1), rtol=rtol)


@pytest.mark.slow
def test_a_body_on_a_curved_path_is_met():
    """Steps are so long that a cubic between their ends is a hundred radii beside the disc."""

    def disc_on_the_way(t, x, v, radius):
        # The path is (t, t^4), and a soft disc lies on it.
        away = jnp.sum((x - jnp.array([at, at**4])) ** 2)
        push = jnp.maximum(0.0, 1.0 - away / radius**2)
        return jnp.stack([jnp.zeros(()), 12.0 * t**2 + 1e4 * push])[None]

    at = 0.3871
    start = [[0.0, 0.0]], [[1.0, 0.0]]
    with pytest.raises(ReferenceRefused, match="near t = 0.387"):
        reference(Problem.second_order(disc_on_the_way, *start, [0.0, 1.0], 1e-5))
