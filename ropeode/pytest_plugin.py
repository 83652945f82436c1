"""The pytest plugin: steppers are guarded by tests, in projects that know nothing else of ropeode.

pytest finds it by its entry point. Importing it imports neither JAX nor the rest of ropeode.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

if TYPE_CHECKING:
    from ropeode.checking import CheckReport

MARKER = (
    "ropeode(quick=..., only=..., skip=..., time_limit=...): how the fixture `ropeode` checks "
    "steppers in this test; as for ropeode.check_stepper"
)
_FORMATS = ("text", "markdown", "json")


def pytest_addoption(parser: pytest.Parser) -> None:
    """The options of the command line."""
    group = parser.getgroup("ropeode", "steppers checked by ropeode")
    group.addoption(
        "--ropeode-quick",
        action="store_true",
        help="leave out the checks of ropeode.check_stepper that take long",
    )
    group.addoption(
        "--ropeode-skip",
        metavar="CHECK[,...]",
        default="",
        help="leave these checks out, as in float32,zero-length",
    )
    group.addoption(
        "--ropeode-format",
        choices=_FORMATS,
        default="text",
        help="of the report on a stepper that fails. Default: text",
    )


def pytest_configure(config: pytest.Config) -> None:
    """Make the marker known."""
    config.addinivalue_line("markers", MARKER)


@pytest.fixture
def ropeode(request: pytest.FixtureRequest) -> Guard:
    """Assertions about steppers; see `ropeode.pytest_plugin.Guard`."""
    settings: dict[str, Any] = {}
    for marker in reversed(list(request.node.iter_markers("ropeode"))):
        settings |= marker.kwargs
    config = request.config
    if config.getoption("--ropeode-quick"):
        settings.setdefault("quick", True)
    if given := config.getoption("--ropeode-skip"):
        more = [part.strip() for part in given.split(",") if part.strip()]
        settings["skip"] = [*settings.get("skip", ()), *more]
    # Not by the fixture `record_property`, which warns of the usual kind of JUnit file.
    noted = request.node.user_properties
    return Guard(
        settings,
        lambda name, value: noted.append((name, value)),
        str(config.getoption("--ropeode-format")),
    )


class Guard:
    """What a test says of a stepper; the test fails, with the report, where it is not so.

    A step, its expected order and claims are whatever `ropeode.check_stepper` takes. Observed
    orders become properties of the test, which pytest writes into its JUnit file.

    Arguments:
        settings: for `check_stepper`, from the marker and the command line.
        record: takes the name and the value of a property of the test.
        form: of the report.
    """

    def __init__(self, settings: dict[str, Any], record: Callable[[str, Any], None], form: str):
        self._settings, self._record, self._form = settings, record, form

    def check(self, step: Any, expected_order: int | None = None, **claims: Any) -> CheckReport:
        """Every check that applies passes."""
        __tracebackhide__ = True
        return self._checked(step, {"expected_order": expected_order, **claims})

    def assert_order(self, step: Any, order: int, **claims: Any) -> CheckReport:
        """Positions and velocities converge to the right solutions, with at least this order."""
        __tracebackhide__ = True
        return self._checked(step, {"expected_order": order, **claims}, "order-")

    def assert_converges(self, step: Any, **claims: Any) -> CheckReport:
        """Positions and velocities converge to the right solutions, with any order."""
        __tracebackhide__ = True
        return self._checked(step, {"expected_order": 1, **claims}, "order-")

    def assert_conserves_energy(self, step: Any, **claims: Any) -> CheckReport:
        """Without damping its energy stays bounded in the long run, without drift."""
        __tracebackhide__ = True
        return self._checked(step, {"conserves_energy": True, **claims}, "energy")

    def _checked(self, step: Any, claims: dict[str, Any], prefix: str = "") -> CheckReport:
        __tracebackhide__ = True
        # Not above: pytest imports this module whether a test needs it or not.
        from ropeode.checking import CHECKS, check_stepper
        from ropeode.errors import InputError, users_traceback
        from ropeode.render import format_check

        settings = {**self._settings, **claims}
        if prefix:
            settings.setdefault("only", [name for name in CHECKS if name.startswith(prefix)])
        refused = None
        try:
            report = check_stepper(step, **settings)
        except InputError as error:
            above = [] if error.__cause__ is None else [users_traceback(error.__cause__)]
            refused = "\n".join([*above, *error.problems])
        # Not inside: pytest would print the chain of exceptions.
        if refused is not None:
            pytest.fail(refused, pytrace=False)
        self._note(report)
        if not report.passed:
            pytest.fail(format_check(report, self._form), pytrace=False)
        return report

    def _note(self, report: CheckReport) -> None:
        for finding in report.findings:
            found = finding.convergence
            for quantity, order in found.orders.items() if found else ():
                name = f"ropeode.{report.label}.{finding.check}.{quantity}"
                value = order.verdict if order.observed is None else f"{order.observed:.3f}"
                self._record(name, value)
