"""The lab in JupyterLab and marimo as they are, and in what JupyterLab saves and exports."""

from __future__ import annotations

import contextlib
import importlib.util
import os
import socket
import subprocess
import sys
import time

import nbformat
import pytest

from tests.laboratory.browser.recorded_page import POINTS, STEPS

expect = pytest.importorskip("playwright.sync_api").expect

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


@contextlib.contextmanager
def server(package, folder, *words):
    """A server of notebooks, by its address."""
    if importlib.util.find_spec(package) is None:
        pytest.skip(f"{package} is not installed: make test-all")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    homes = ("HOME", "JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR")
    environment = os.environ | dict.fromkeys(homes, str(folder / "home"))
    command = [sys.executable, "-m", package, *words, f"--port={port}"]
    with (folder / "log").open("wb") as log:
        process = subprocess.Popen(
            command, cwd=folder, env=environment, stdout=log, stderr=subprocess.STDOUT
        )
    try:
        end = time.monotonic() + STARTS_IN_S
        while not is_served(port):
            assert process.poll() is None, (folder / "log").read_text()
            assert time.monotonic() < end, (folder / "log").read_text()
            time.sleep(0.2)
        yield f"http://127.0.0.1:{port}"
    finally:
        process.terminate()
        process.wait()


def is_served(port):
    with socket.socket() as page:
        return page.connect_ex(("127.0.0.1", port)) == 0


@pytest.fixture
def tab(chromium):
    # Not `page`: what these programs write to the console is not ours.
    context = chromium.new_context(locale="en-GB", viewport={"width": 1400, "height": 1000})
    opened = context.new_page()
    opened.set_default_timeout(1000 * STARTS_IN_S)
    yield opened
    context.close()


def use(tab):
    """Press keys, and ask for what only Python knows."""
    frame = tab.frame_locator(FRAME)
    expect(frame.locator(POINTS)).to_have_count(2, timeout=1000 * STARTS_IN_S)
    frame.locator("#picture").click()
    tab.keyboard.press("=")
    expect(frame.locator(POINTS)).to_have_count(4)
    frame.locator("#stepper-add").select_option("velocity-verlet")
    expect(frame.locator(POINTS)).to_have_count(6)
    expect(frame.locator("#connection")).to_have_text("")


def test_jupyterlab_shows_it_saves_it_and_exports_it(tab, tmp_path):
    notebook = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(CELL)])
    notebook.metadata["kernelspec"] = {"name": "python3", "display_name": "Python 3"}
    path = tmp_path / "lab.ipynb"
    nbformat.write(notebook, path)
    words = ("--no-browser", "--allow-root", "--IdentityProvider.token=", "--LabApp.news_url=")
    with server("jupyterlab", tmp_path, *words) as address:
        tab.goto(f"{address}/lab/tree/lab.ipynb")
        tab.locator(".jp-CodeCell .cm-content").first.click()
        tab.keyboard.press("Shift+Enter")
        use(tab)
        tab.locator("jp-button[data-command='docmanager:save']").first.click()
        end = time.monotonic() + STARTS_IN_S
        while "srcdoc" not in path.read_text() and time.monotonic() < end:
            time.sleep(0.2)
    command = [sys.executable, "-m", "nbconvert", "--to", "html", str(path)]
    subprocess.run(command, check=True, capture_output=True, cwd=tmp_path)
    tab.context.set_offline(True)
    tab.goto(path.with_suffix(".html").as_uri())
    frame = tab.frame_locator(FRAME)
    for pressed in range(3):
        expect(frame.locator(POINTS)).to_have_count(2 + 2 * pressed)
        frame.locator("#more").click()
    expect(frame.locator(f"{STEPS} .plot-more").first).to_contain_text("order 3.9")


def test_marimo_shows_it(tab, tmp_path):
    (tmp_path / "app.py").write_text(MARIMO)
    words = ("--yes", "run", "app.py", "--headless", "--no-token")
    with server("marimo", tmp_path, *words) as address:
        tab.goto(address)
        use(tab)
