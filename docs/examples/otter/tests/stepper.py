"""Points for the function `step` of a notebook or a script, by ropeode.

In otter-grader's exception-based form: a case passes if it raises nothing.
"""

import functools

from otter.test_files import test_case

from ropeode import check_stepper

OK_FORMAT = False

name = "stepper"


@functools.cache
def report(step):
    """Of all checks, which are made once."""
    if not callable(step):
        raise AssertionError("there is no function step(acceleration, t, x, v, dt, args)")
    return check_stepper(step, expected_order=2, progress=lambda text, fraction: None)


def require(step, *names):
    """Raise if one of these checks does not pass; checks that do not apply do not count."""
    lines = [
        f"{each.check}: {each.line}"
        for each in report(step).findings
        if each.check.startswith(names) and each.status in ("fail", "undetermined")
    ]
    lines += [each.line for each in report(step).diagnosis] if lines else []
    assert not lines, "\n".join(lines)


@test_case(points=2, name="it runs")
def test_runs(step):
    """No exception, no loop without an end, and states of the right shape."""
    report(step)


@test_case(points=5, name="it is of order 2")
def test_order(step):
    """On every rope of the checks."""
    require(step, "order-")


@test_case(points=3, name="all checks", hidden=True)
def test_all(step):
    """That apply: momentum, symmetries, rounding ..."""
    require(step, "")
