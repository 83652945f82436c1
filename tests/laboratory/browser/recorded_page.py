"""The page without Python: how it is opened and read, and answers in Python's place."""

from __future__ import annotations

import base64
import json
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

from ropeode.laboratory import PAGE, decoded, encoded

EXAMPLE = Path(__file__).parents[3] / "docs/examples/steps.py"
RECORDING = json.loads((PAGE / "recordings/default.json").read_text())
STILL = {"playing": False, "time": 3.5}
# A problem of which only Python knows.
NOT_RECORDED = {"name": "rope", "parameters": {"damping": 0.02}, "frames": 40}
# The points of the order plot, and the group of plots that it stands in.
POINTS = ".plot-markers > g"
STEPS = ".tab-group:last-child"


def link(**scene: object) -> str:
    """What stands after the address of the page, for a scene."""
    return "#" + "&".join(f"{name}={quote(json.dumps(value))}" for name, value in scene.items())


def scene_of(url: str) -> dict[str, object]:
    """What the link of a page says of its scene."""
    parts = url.partition("#")[2].split("&")
    return {name: json.loads(unquote(text)) for name, _, text in (p.partition("=") for p in parts)}


class Python:
    """Answers at the other end of the WebSocket, from a table; what is not in it has none.

    `asked` has every question, `said` what is sent as text.
    """

    def __init__(self, page) -> None:
        self._page = page
        self.asked: list[dict] = []
        self.longest = 0
        # JSON, or a message with its arrays.
        self.answers: dict[str, Any] = {}
        self.sockets: list = []
        page.route_web_socket("**/socket", self._connected)

    def _connected(self, socket) -> None:
        self.sockets.append(socket)
        socket.on_message(lambda text: self._listen(socket, json.loads(text)["want"]))

    def _listen(self, socket, want: list[dict]) -> None:
        self.longest = max(self.longest, len(want))
        for each in want:
            ask = each["ask"]
            self.asked.append(ask)
            found = self.answers.get(f"{ask['kind']} {ask.get('stepper', '')}".strip())
            if isinstance(found, tuple):
                socket.send(encoded(each["key"], *found))
            elif found is not None:
                socket.send(json.dumps({**found, "key": each["key"]}))

    def until_asked(self, **wanted: object) -> None:
        """Wait until the page has asked a question with these fields."""
        for _ in range(1200):
            if any(wanted.items() <= each.items() for each in self.asked):
                return
            self._page.wait_for_timeout(50)
        raise AssertionError(f"not asked: {wanted}")

    def say(self, **message: object) -> None:
        """Send what comes unasked."""
        self.sockets[-1].send(json.dumps(message))


def library(**changes: object) -> dict:
    """The recorded answer to what can be chosen, with changes."""
    (wire,) = (each["wire"] for each in RECORDING if each["ask"]["kind"] == "library")
    header, _ = decoded(base64.b64decode(wire))
    return {**header, **changes}


def opened(page, address, **scene):
    """The page with a scene, when it shows it."""
    page.goto(address + link(**scene))
    page.wait_for_function("document.querySelector('#time-shown')?.textContent")
    return page


def picture(page):
    """The stage as SVG."""
    page.click("#take")
    with page.expect_download() as download:
        page.click("#save-svg")
    page.keyboard.press("Escape")
    return download.value.path().read_text()


def tab(page, name):
    """Choose what a group of plots shows."""
    page.locator(f"[role=tab][data-name={name}]").click()


def labels(page):
    """What the points of the order plot say."""
    return page.locator(POINTS).evaluate_all(
        "all => all.map((each) => each.getAttribute('aria-label'))"
    )
