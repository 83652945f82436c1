"""The page of a lab that runs as a user's does, and computes what is not recorded."""

from __future__ import annotations

import re

import pytest

from tests.browser import LONGEST
from tests.laboratory.browser.recorded_page import EXAMPLE, POINTS, link, picture, tab
from tests.time_limit import HANGS_AFTER_S

expect = pytest.importorskip("playwright.sync_api").expect

# Its reference takes a fraction of the time of the default rope's.
ROPE = link(
    problem={"name": "rope", "parameters": {"num_nodes": 4}, "frames": 3},
    playing=False,
    steppers=["rk4"],
    steps=32,
    ladder=[32],
)

pytestmark = pytest.mark.slow


@pytest.fixture(autouse=True)
def patient(chromium):
    """What is computed is waited for, however busy the machine is."""
    expect.set_options(timeout=1000 * HANGS_AFTER_S)
    yield
    expect.set_options(timeout=LONGEST)


def test_what_is_not_recorded_is_computed(page, start_lab):
    page.goto(start_lab() + ROPE)
    expect(page.locator(POINTS)).to_have_count(1)
    page.keyboard.press("=")
    expect(page.locator(POINTS)).to_have_count(2)
    tab(page, "phase")
    group = page.locator(".tab-group").first
    paths, named = group.locator(".plot-line"), group.locator(".plot-label").last
    # A free end, if none is chosen.
    expect(named).to_have_text("x of node 3")
    # As smooth as the motion.
    assert "C" in paths.first.get_attribute("d")
    group.locator("select").select_option("mode 0")
    expect(named).to_have_text(re.compile("mode 0, .* rad"))
    expect(paths).to_have_count(2)


def test_problems_are_drawn_as_what_they_are(page, start_lab):
    address = start_lab()
    # What moves, and what is fixed.
    for name, moves, fixed in (("double-pendulum", 2, 1), ("kepler", 1, 1), ("lorenz", 1, 0)):
        problem = {"name": name, "parameters": {}, "frames": 3}
        page.goto(address + link(problem=problem, steppers=[], playing=False))
        words = page.locator("#problem-words")
        expect(words).to_contain_text(name.replace("-", " "), ignore_case=True)
        svg = picture(page)
        # One rectangle is the ground, and each clip has one.
        assert (svg.count("<circle"), svg.count("<rect") - 2) == (moves, fixed), name


def test_a_stepper_of_ones_own_reloads_on_save(page, start_lab, tmp_path):
    file = tmp_path / "steps.py"
    right = EXAMPLE.read_text()
    file.write_text(right)
    requests = []
    page.on("request", lambda each: requests.append(each.url))
    page.goto(start_lab(f"{file}:velocity_verlet") + ROPE)
    own, fault = page.locator("#own"), page.locator("#own .fault")
    expect(page.locator("#stepper-0")).to_have_value(re.compile("velocity_verlet"))
    expect(own).to_contain_text("all checks passed")
    file.write_text(right.replace("return x_new,", "return x_new x_new,"))
    expect(fault).to_contain_text("Line 9:")
    expect(fault).to_contain_text("The version before it stays.")
    expect(page.locator(POINTS)).to_have_count(2)
    # It falls too fast: the verdict changes with the file.
    file.write_text(right.replace("dt / 2 * (a", "dt * (a"))
    expect(fault).to_have_count(0)
    expect(own).to_contain_text("a check failed")
    assert all(each.startswith(("http://127.0.0.1:", "ws://127.0.0.1:")) for each in requests)
