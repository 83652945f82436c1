"""The lab as a value of a notebook: what it takes, what it holds, and what it refuses."""

from __future__ import annotations

import html
import re
from typing import Any

import numpy as np
import pytest

from ropeode import InputError, Rope, RopeodeError, accuracy_table, as_stepper, lab
from ropeode.laboratory import answers_in
from ropeode.laboratory.messages import Run
from ropeode.progress import silent
from ropeode.render import format_table
from tests.exact_reference import rope_reference

ROPE = Rope(num_nodes=4, node_mass=2.0, initial_velocity=(3.0, 1.0))
STEPS = (16, 64, 96, 128, 192)


def halves(rhs, t, y, dt, args):
    """Explicit Euler with half the slope."""
    return y + 0.5 * dt * rhs(t, y, args)


def raises(rhs, t, y, dt, args):
    raise ValueError("of mine")


@pytest.fixture(scope="module")
def table():
    known = rope_reference(ROPE.problem(frames=3))
    return accuracy_table(known, ["rk4", "explicit-euler"], STEPS, predict=True)


@pytest.fixture(scope="module")
def shown(table):
    return lab(table, progress=silent)


def answers(page, kind) -> list[tuple[Any, Any, Any]]:
    text = re.search(r'id="recordings/default.json">(.*?)</script>', page, re.DOTALL)
    assert text is not None
    return [each for each in answers_in(text[1]) if each[0].kind == kind]


def test_its_numbers_are_those_of_the_table(shown, table):
    runs = {
        (ask.stepper, ask.steps_per_frame): (head, arrays)
        for ask, head, arrays in answers(shown.page, "run")
    }
    ((_, truth, of_truth),) = answers(shown.page, "truth")
    samples = truth["samples_per_frame"]
    for row in table.rows:
        head, arrays = runs[row.stepper, row.steps_per_frame]
        for name in Run.model_fields.keys() - {"kind", "every", "seconds"}:
            assert head[name] == getattr(row, name), name
        at_frames = arrays["errors"][:: samples // head["every"]][1:]
        assert at_frames.max() == pytest.approx(row.error_max)
    # Its keys go on from the first of the table's step sizes.
    assert {steps for _, steps in runs} == {4, 8, *STEPS, 32, 256, 512}
    at_frames = of_truth["points"][::samples]
    np.testing.assert_allclose(at_frames, table.reference.positions, rtol=1e-6, atol=1e-6)
    orders = {
        ask.stepper: head
        for ask, head, _ in answers(shown.page, "order")
        if ask.steps_per_frame == STEPS
    }
    predicted = {ask.stepper: head for ask, head, _ in answers(shown.page, "theory")}
    for each in table.orders:
        head, order = orders[each.stepper], each.order
        assert (head["observed"], head["verdict"]) == (order.observed, order.verdict)
        assert (head["low"], head["high"]) == (order.ci95 or (None, None))
        assert f"expected {each.expected}" in head["words"]
        left_out = [run["steps_per_frame"] for run in head["left_out"]]
        assert {*head["used"], *left_out} == {*STEPS}
        head, constant = predicted[each.stepper], each.constant
        assert (head["order"], head["constant"]) == (constant.order, constant.predicted)
        assert head["words"] in " ".join(format_table(table).split())


def test_a_cell_holds_the_page_also_where_there_are_no_widgets(shown):
    data, _ = shown._repr_mimebundle_()
    assert data["application/vnd.jupyter.widget-view+json"]["model_id"] == shown.model_id
    assert data["text/plain"] == repr(shown) == "<Lab: rope (given); rk4, explicit-euler>"
    inside = re.search(r'srcdoc="([^"]*)"', data["text/html"])
    assert inside is not None
    assert html.unescape(inside[1]) == shown.page


@pytest.mark.slow
def test_a_stepper_of_the_users_own_stands_where_it_was_named(table):
    own = accuracy_table(table.reference, [halves], STEPS)
    with pytest.raises(InputError, match="pass your steppers"):
        lab(own)
    shown = lab(own, [halves], progress=silent)
    ((_, library, _),) = answers(shown.page, "library")
    assert [each["name"] for each in library["own"]] == ["halves"]
    commands = {ask.steppers for ask, _, _ in answers(shown.page, "command")}
    assert commands == {("halves",)}
    # Half the slope is half the pace: the error does not go to zero.
    assert min(head["error_max"] for _, head, _ in answers(shown.page, "run")) > 2.0
    # A check takes long; the kernel makes it when the page asks.
    assert not answers(shown.page, "check")


def test_export_writes_the_file_or_nothing(tmp_path, shown):
    with pytest.raises(InputError, match="a file name that ends in .html"):
        shown.export(tmp_path / "lab.pdf")
    shown.export(tmp_path / "lab.html", progress=silent)
    assert [each.name for each in tmp_path.iterdir()] == ["lab.html"]
    # Without steppers of the user's own there is nothing to check, and so it is the same page.
    assert (tmp_path / "lab.html").read_text() == shown.page


SIX = [as_stepper(halves, label=f"s{k}") for k in range(6)]


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"problem": 3}, "problem: 3 given; allowed: a Problem"),
        ({"steppers": []}, "at least one stepper"),
        ({"steppers": SIX}, "steppers: '6 steppers' given; allowed: at most 5"),
        ({"steps_per_frame": [2**17]}, "at most 32 numbers of at most 65536"),
        ({"steps_per_frame": range(1, 40)}, "at most 32 numbers"),
        ({"problem": "van-der-pol", "steppers": ["rattle", "velocity-verlet"]}, "rattle"),
        ({"problem": "kepler", "steppers": [raises]}, "ValueError: of mine"),
        ({"height": 20}, "height: 20 given; allowed: a whole number >= 200"),
    ],
)
def test_what_it_cannot_show_is_refused_before_anything_is_computed(given, said):
    with pytest.raises(RopeodeError) as caught:
        lab(**given, progress=silent)
    assert said in str(caught.value)


def test_a_table_in_another_norm_is_refused(table):
    final = accuracy_table(table.reference, ["rk4"], STEPS, norm="position-rms")
    with pytest.raises(InputError, match="a table in the norm 'position-max'"):
        lab(final)
