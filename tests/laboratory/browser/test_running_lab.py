"""Labs that run as a user's do: in a browser, in JupyterLab and in marimo."""

from __future__ import annotations

import contextlib
import os
import re
import socket
import subprocess
import sys
import time

import pytest

from tests.browser import LONGEST
from tests.laboratory.browser.recorded_page import POINTS, STEPS, link, tab
from tests.time_limit import HANGS_AFTER_S

expect = pytest.importorskip("playwright.sync_api").expect

# Its reference takes a fraction of the time of the default rope's.
SMALL = {"name": "rope", "parameters": {"num_nodes": 4}, "frames": 3}
ROPE = link(problem=SMALL, playing=False, steppers=["rk4"], steps=32, ladder=[32])

CELL = """
from ropeode import Rope, lab
lab(Rope(num_nodes=4, node_mass=2.0).problem(frames=6), ["rk4", "explicit-euler"])
"""
MARIMO = f"""
import marimo

app = marimo.App()


@app.cell
def _():
    {CELL.strip().replace(chr(10), chr(10) + "    ")}
"""
FRAME = "iframe[title='ropeode lab']"
STARTS_IN_S = 120.0

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


@contextlib.contextmanager
def server(package, folder, *words):
    """A server of notebooks, by its address."""
    pytest.importorskip(package)
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    command = [sys.executable, "-m", package, *words, f"--port={port}"]
    # Not with the settings of whoever runs the tests.
    homes = ("HOME", "JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR")
    environment = os.environ | dict.fromkeys(homes, str(folder / "home"))
    with (folder / "log").open("wb") as log:
        process = subprocess.Popen(command, cwd=folder, env=environment, stdout=log, stderr=log)
    try:
        until(lambda: process.poll() is not None or is_served(port))
        assert process.poll() is None, (folder / "log").read_text()
        yield f"http://127.0.0.1:{port}"
    finally:
        process.terminate()
        process.wait()


def is_served(port):
    with socket.socket() as page:
        return page.connect_ex(("127.0.0.1", port)) == 0


def until(done):
    end = time.monotonic() + STARTS_IN_S
    while not done() and time.monotonic() < end:
        time.sleep(0.2)


@pytest.fixture
def opened(chromium):
    # Not `page`: what these programs write to the console is not ours.
    with chromium.new_page(viewport={"width": 1400, "height": 1000}) as page:
        page.set_default_timeout(1000 * STARTS_IN_S)
        yield page


def use(opened):
    """Press keys, and ask for what only Python knows."""
    frame = opened.frame_locator(FRAME)
    expect(frame.locator(POINTS)).to_have_count(2, timeout=1000 * STARTS_IN_S)
    frame.locator("#picture").click()
    opened.keyboard.press("=")
    expect(frame.locator(POINTS)).to_have_count(4)
    frame.locator("#stepper-add").select_option("velocity-verlet")
    expect(frame.locator(POINTS)).to_have_count(6)
    expect(frame.locator("#connection")).to_have_text("")


def test_jupyterlab_shows_it_saves_it_and_exports_it(opened, tmp_path):
    import nbformat  # Slow to import.

    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(CELL)])
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3"}
    path = tmp_path / "lab.ipynb"
    nbformat.write(notebook, path)
    words = ("--no-browser", "--allow-root", "--IdentityProvider.token=", "--LabApp.news_url=")
    with server("jupyterlab", tmp_path, *words) as address:
        opened.goto(f"{address}/lab/tree/lab.ipynb")
        opened.locator(".jp-CodeCell .cm-content").first.click()
        opened.keyboard.press("Shift+Enter")
        use(opened)
        opened.locator("jp-button[data-command='docmanager:save']").first.click()
        until(lambda: "srcdoc" in path.read_text())
    command = [sys.executable, "-m", "nbconvert", "--to", "html", str(path)]
    subprocess.run(command, check=True, capture_output=True, cwd=tmp_path)
    opened.context.set_offline(True)
    opened.goto(path.with_suffix(".html").as_uri())
    frame = opened.frame_locator(FRAME)
    for pressed in range(3):
        expect(frame.locator(POINTS)).to_have_count(2 + 2 * pressed)
        frame.locator("#more").click()
    expect(frame.locator(f"{STEPS} .plot-more").first).to_contain_text("order 3.9")


def test_marimo_shows_it(opened, tmp_path):
    (tmp_path / "app.py").write_text(MARIMO)
    words = ("--yes", "run", "app.py", "--headless", "--no-token")
    with server("marimo", tmp_path, *words) as address:
        opened.goto(address)
        use(opened)
