"""Results in the REPL and in notebooks: a line, and a page."""

from __future__ import annotations

import copy
import dataclasses
import inspect
import math
import pickle

import diffrax
import numpy as np
import pytest

import ropeode
from ropeode import Ensemble, Film, Problem, Rope, animate, plot_convergence, trajectory_errors
from ropeode.analysis import ObservedOrder, Thresholds, classify_motion, error_series
from ropeode.display import Displayed, Sampled, Tabular
from ropeode.equality import ByContent
from ropeode.errors import InputError, UserCodeError, call_user_code, full_tracebacks
from ropeode.problems import PROBLEMS
from ropeode.simulation import JaxStepper, simulate, simulate_chunks
from ropeode.simulation.jax_stepper import jax_stepper
from ropeode.steppers import Phase, System, as_stepper
from ropeode.study import NodePath
from ropeode.theory import Growth
from tests.render.made_up import MADE_UP, problem, reference
from tests.render.plots import studies
from tests.results import check_result, kinds

# Short enough as they are; a film shows its pictures.
PLAIN = {Film, Growth, ObservedOrder, Phase, System, Thresholds}
NO_TABLES = {Ensemble, JaxStepper, NodePath, Problem}
# `check_result` is called where they are tested.
ELSEWHERE = {"Horizon", "Report"}


@pytest.fixture(scope="module")
def results(tmp_path_factory):
    ensemble = Rope(num_nodes=4).ensemble(frames=3, damping=[0.0, 0.01])
    run = simulate(problem(), "rk4", 16)
    file = tmp_path_factory.mktemp("runs") / "16.npz"
    np.savez(file, dt=run.dt, t=run.times, positions=run.positions)
    errors, paths = studies.named("errors"), studies.paths()
    return [
        *(make() for name, make in MADE_UP.items() if name not in ("horizon", "report")),
        *(problem(), reference(), reference().certificate, MADE_UP["horizon"]().exponent),
        *(errors, errors.curves[0], studies.named("energies"), paths, paths.paths[0]),
        *(run, classify_motion(run), error_series(run, reference())),
        trajectory_errors([file], reference()),
        ensemble,
        next(iter(simulate_chunks(ensemble, "rk4", 16))),
        jax_stepper(problem(), "rk4"),
    ]


def test_public_results_are_displayed(results):
    """Which a new one cannot forget."""
    named = [getattr(ropeode, name) for name in ropeode.__all__]
    functions = map(inspect.unwrap, filter(inspect.isfunction, named))
    returned = [each.__globals__.get(each.__annotations__.get("return")) for each in functions]
    classes = (each for each in [*named, *returned] if isinstance(each, type))
    public = {each for each in classes if dataclasses.is_dataclass(each)} - PLAIN
    assert public <= set(kinds())
    assert all(each.__repr__ is Displayed.__repr__ for each in kinds())
    assert all(each.__eq__ is ByContent.__eq__ for each in kinds())
    checked = {type(each).__name__ for each in results} | ELSEWHERE
    assert checked == {each.__name__ for each in kinds()}
    # What has no numbers in rows.
    assert set(kinds()) - {*kinds(Tabular), *kinds(Sampled)} == NO_TABLES


def test_a_result_is_a_line_a_page_a_table_and_a_value(results):
    for each in results:
        check_result(each)


def test_equality_is_that_of_the_content():
    """Not that of the object, and no question of the truth of an array."""
    first, again = (Rope(num_nodes=4).problem(frames=3) for _ in range(2))
    assert first == again
    assert len({first, again, problem()}) == 1
    assert first != Rope(num_nodes=4, damping=0.02).problem(frames=3)
    assert first != first.until(3)
    # Exact solutions and energies are known of a problem, and are no part of it.
    assert first == dataclasses.replace(first, energy=None)
    run = simulate(first, "rk4", 16)
    assert run == simulate(again, "rk4", 16)
    assert run != simulate(first, "rk4", 17)
    assert run != dataclasses.replace(run, states=np.nextafter(run.states, 1.0))
    nothing = dataclasses.replace(run, states=np.full_like(run.states, np.nan))
    assert nothing == dataclasses.replace(run, states=np.full_like(run.states, np.nan))
    for name in ("diffrax:Heun", "rk4", "scipy:RK45"):
        assert pickle.loads(pickle.dumps(as_stepper(name))) == as_stepper(name)
    assert as_stepper("diffrax:Heun") != as_stepper("diffrax:Tsit5")
    assert as_stepper(diffrax.Kvaerno3()) == as_stepper("diffrax:Kvaerno3")
    film = animate(studies.paths())
    for each in (copy.deepcopy(first), pickle.loads(pickle.dumps(first))):
        with pytest.raises(ValueError, match="read-only"):
            each.y0[0] = 1.0
    assert film == pickle.loads(pickle.dumps(film)) != animate(studies.paths(), fps=10)


@pytest.mark.parametrize("name", PROBLEMS)
def test_every_problem_of_the_library_is_a_value(name):
    check_result(PROBLEMS[name](frames=2))


def a_tree(t, y, args):
    return {"a": -args * y["a"]}


def in_jax(t, y, rate):
    return -rate * y


def in_python(t, y):
    return [-math.sin(y[0])]


def test_problems_of_ones_own_are_values():
    """They are sent by the names of their functions, which are traced anew."""
    for each in (
        Problem(a_tree, {"a": np.ones(3)}, range(3), 0.1, exact=in_python),
        Problem.from_scipy(in_jax, (0, 1), [1.0], args=(0.1,)),
        Problem.from_scipy(in_python, (0, 1), [1.0]),
    ):
        check_result(each)
        check_result(Ensemble.of([each, each]))


def test_a_page_has_marks_in_colour_lines_of_blocks_and_pictures():
    assert 'font-weight: bold">WRONG</td>' in MADE_UP["check"]()._repr_html_()
    assert any(block in reference()._repr_html_() for block in "▁▂▃▄▅▆▇█")
    assert plot_convergence(MADE_UP["accuracy-table"]())._repr_png_().startswith(b"\x89PNG")


def wrong(x):
    return x + unknown  # type: ignore[name-defined]  # noqa: F821


def test_an_exception_says_what_its_reader_can_mend():
    with pytest.raises(InputError) as raised:
        Rope(num_nodes=-1)
    (text,) = raised.value._render_traceback_()
    assert text.startswith("InputError: num_nodes: ")
    with pytest.raises(UserCodeError) as raised:
        call_user_code("step", wrong, np.ones(1))
    text = "\n".join(raised.value._render_traceback_())
    assert "return x + unknown" in text
    assert "call_user_code" not in text
    full_tracebacks()
    try:
        assert "call_user_code" in "\n".join(raised.value._render_traceback_())
    finally:
        full_tracebacks(False)
