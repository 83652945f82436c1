"""The page of the lab in Chromium: its start, frame times, answers to keys, and memory.

    python benchmarks/lab.py [--seconds S] [--presses P] [--minutes M]

Needs Chromium and playwright. The times are those of a page without a screen and, where there is no
graphics card, of drawing by the processor.
"""

from __future__ import annotations

import argparse
import contextlib
import itertools
import json
import random
import re
import shutil
import statistics
import subprocess
import sys
import time
from collections.abc import Iterator
from urllib.parse import quote

import numpy as np
import psutil
from playwright.sync_api import Browser, CDPSession, Page, TimeoutError, sync_playwright
from tabulate import tabulate

FIVE = ["explicit-euler", "semi-implicit-euler", "velocity-verlet", "rk4", "stormer-verlet"]
COUNT_FRAMES = """seconds => new Promise((resolve) => {
  const times = [];
  const turn = (now) => {
    times.push(now);
    if (now - times[0] < 1000 * seconds) requestAnimationFrame(turn);
    else resolve(times.slice(1).map((each, i) => each - times[i]));
  };
  requestAnimationFrame(turn);
})"""
# From a key to the first frame in which the order plot has a point more for each stepper.
PRESS = """([key, more]) => new Promise((resolve) => {
  const points = () => document.querySelectorAll(".plot-markers > g").length;
  const [before, start] = [points(), performance.now()];
  document.body.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
  const turn = () => {
    if (points() >= before + more) resolve(performance.now() - start);
    else requestAnimationFrame(turn);
  };
  turn();
})"""


@contextlib.contextmanager
def opened_lab() -> Iterator[tuple[str, psutil.Process]]:
    """The address of a lab, and its process."""
    command = [sys.executable, "-m", "ropeode", "lab", "--no-browser"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if found := re.search(r"http://\S+", line):
                break
        else:
            sys.exit("the lab did not start")
        try:
            yield found.group(), psutil.Process(process.pid)
        finally:
            process.terminate()


def link(address: str, **scene: object) -> str:
    """The address of a scene."""
    parts = [f"{name}={quote(json.dumps(value))}" for name, value in scene.items()]
    return f"{address}#{'&'.join(parts)}"


def opened(page: Page, address: str, steppers: int) -> None:
    """Wait until every stepper has a point in the order plot."""
    page.goto("about:blank")
    page.goto(address)
    page.locator(".plot-markers > g").nth(steppers - 1).wait_for(timeout=300_000)


def frame_times(page: Page, address: str, seconds: float) -> None:
    rows = []
    for nodes in (16, 256):
        # The reference of a long rope takes minutes for many frames; a picture costs the same.
        problem = {"name": "rope", "parameters": {"num_nodes": nodes}, "frames": 40 * 16 // nodes}
        steps = 64 if nodes == 16 else 256
        scene = link(address, problem=problem, steppers=FIVE, steps=steps, ladder=[steps])
        opened(page, scene, len(FIVE))
        page.wait_for_timeout(2000)
        times = np.array(page.evaluate(COUNT_FRAMES, seconds))
        rows.append([nodes, len(times), *(f"{np.quantile(times, q):.1f}" for q in (0.5, 0.99, 1))])
    head = ["nodes", "frames", "median [ms]", "99% [ms]", "longest [ms]"]
    print(f"Frame times, five ropes, {seconds:g} s\n{tabulate(rows, head)}\n")


def start_times(browser: Browser) -> None:
    """From the command to its address, and from there to the first picture in a new page."""
    rows = []
    for _ in range(5):
        began = time.perf_counter()
        with opened_lab() as (address, _):
            printed = 1000 * (time.perf_counter() - began)
            page = browser.new_page(viewport={"width": 1440, "height": 900})
            opened(page, address, 3)
            shown = page.evaluate("performance.getEntriesByName('first picture')[0].startTime")
            page.close()
        rows.append([printed, shown, printed + shown])
    rows.append(list(np.median(rows, axis=0)))
    head = ["address [ms]", "first picture [ms]", "both [ms]"]
    print(f"Starts; the last line has the medians\n{tabulate(rows, head, floatfmt='.0f')}\n")


def key_times(page: Page, address: str) -> None:
    rows = []
    for words, wait in (("at once", 0), ("after 3 s", 3000)):
        opened(page, link(address, ladder=[16]), 3)
        page.wait_for_timeout(wait)
        times = []
        for _ in range(5):
            times.append(page.evaluate(PRESS, ["=", 3]))
            page.wait_for_timeout(wait)
        rows.append([words, *(f"{each:.0f}" for each in times), f"{statistics.median(times):.0f}"])
    head = ["keys", *(f"{16 * 2**i}" for i in range(1, 6)), "median"]
    print(f"From = to new data at the page, default scene [ms]\n{tabulate(rows, head)}\n")


def memory(page: Page, address: str, process: psutil.Process, presses: int) -> None:
    opened(page, link(address), 3)
    session = page.context.new_cdp_session(page)
    rows = []
    for part in range(6):
        if part:
            for i in range(presses // 5):
                page.keyboard.press("-" if (i // 6) % 2 else "=")
                page.wait_for_timeout(30)
            page.wait_for_timeout(2000)
        rows.append([part * (presses // 5), *used(session, process)])
    head = ["keys", *USED]
    print(f"Memory\n{tabulate(rows, head, floatfmt='.1f')}")


def memory_of_all(page: Page, address: str, process: psutil.Process, minutes: float) -> None:
    """Scenes of all kinds, one after the other in the same page, with keys pressed in each."""
    opened(page, link(address), 3)
    session = page.context.new_cdp_session(page)
    rows, began, keys = [], time.monotonic(), 0
    for scenes, scene in enumerate(various()):
        now = (time.monotonic() - began) / 60
        if now >= len(rows) * minutes / 10:
            rows.append([f"{now:.1f}", scenes, keys, *used(session, process)])
        if now > minutes:
            break
        page.evaluate("hash => { location.hash = hash; }", link("", **scene))
        page.wait_for_timeout(500)
        # What is not there in time is given up for the next scene, as by whoever does not wait.
        with contextlib.suppress(TimeoutError):
            page.locator("#connection:empty").wait_for(state="attached", timeout=15_000)
        for key in "===--==12=-":
            page.keyboard.press(key)
            page.wait_for_timeout(150)
            keys += 1
    head = ["minutes", "scenes", "keys", *USED]
    print(f"Memory, scenes of all kinds\n{tabulate(rows, head, floatfmt='.1f')}\n")


def various() -> Iterator[dict[str, object]]:
    """Scenes without end, no two alike."""
    draw = random.Random(1)
    for index in itertools.count():
        name = ("rope", "rope", "inextensible-rope", "kepler", "lorenz", "pendulum")[index % 6]
        rope = name.endswith("rope")
        parameters = {"damping": round(draw.uniform(0, 0.1), 4)} if name == "rope" else {}
        if rope:
            parameters["num_nodes"] = draw.randrange(3, 20)
        fitting = ["constraint-verlet", "rattle"] if name == "inextensible-rope" else FIVE
        first = 2 ** draw.randrange(4, 7)
        yield {
            "problem": {"name": name, "parameters": parameters, "frames": draw.randrange(5, 40)},
            "steppers": draw.sample(fitting, 2) if name != "lorenz" else ["rk4", "diffrax:Heun"],
            "steps": first,
            "ladder": [first],
            "node": draw.randrange(1, 3) if rope else None,
            "choices": {
                "motion": draw.choice(["error", "energy", "phase"]),
                "steps": draw.choice(["order", "stability"]),
                "phase": draw.choice(
                    ["component 0", "component 1", "mode 0"] if rope else ["component 0"]
                ),
            },
        }


USED = ["page's heap [MiB]", "server [MiB]", "worker [MiB]"]


def used(session: CDPSession, process: psutil.Process) -> tuple[float, ...]:
    """MiB of the page's heap, of the server, and of what it has started."""
    session.send("HeapProfiler.collectGarbage")
    heap = session.send("Runtime.getHeapUsage")["usedSize"]
    others = process.children(recursive=True)
    resident = [sum(each.memory_info().rss for each in part) for part in ([process], others)]
    return tuple(each / 2**20 for each in (heap, *resident))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0)
    parser.add_argument("--presses", type=int, default=500)
    parser.add_argument("--minutes", type=float, default=10.0)
    asked = parser.parse_args()
    chromium = shutil.which("chromium") or sys.exit("there is no Chromium on this machine")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        start_times(browser)
        page = browser.new_page(viewport={"width": 1440, "height": 900})
        with opened_lab() as (address, process):
            key_times(page, address)
            memory(page, address, process, asked.presses)
            memory_of_all(page, address, process, asked.minutes)
            frame_times(page, address, asked.seconds)
        browser.close()


if __name__ == "__main__":
    main()
