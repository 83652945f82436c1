"""The pictures of docs/gallery/lab-scenes.md: every scene of the lab, in Chromium.

    python -m tools.scene_pictures [SCENE ...]   (make pictures)

writes ``docs/images/lab-LESSON.webp`` for each lesson, after the keys that it asks for, and the
figures of the report, six to a sheet, to ``docs/images/lab-figures-NUMBER.webp``. With names it
writes those lessons, and the sheets that hold those figures. Takes ten minutes, most of it for
references.
"""

from __future__ import annotations

import io
import json
import shutil
import sys
import time
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import Page, WebSocket, sync_playwright

from benchmarks.lab import opened_lab
from ropeode.files import write_whole
from ropeode.laboratory import header_of
from ropeode.laboratory.messages import SceneFacts
from ropeode.laboratory.scenes import lessons, scenes
from ropeode.progress import bar

IMAGES = Path(__file__).parents[1] / "docs/images"
WINDOW = {"width": 1280, "height": 800}
# Of the motion, at which the page is shown; where a lesson tells of what happens later, or sooner.
_USUAL, _PARTS = 0.4, {"why-euler-explodes": 0.45, "energy": 0.95, "chaos": 0.85}
COLUMNS, ROWS = 2, 3
_OF_A_SHEET = COLUMNS * ROWS
_QUALITY = 80
# In seconds: nothing is asked for so long when all is there, and no scene takes longer than that.
_STILL, _LONGEST = 0.5, 600.0


class Questions:
    """Those of a page that are not answered yet."""

    def __init__(self, page: Page) -> None:
        self.page = page
        self.open: set[str] = set()
        self.refused: list[str] = []
        self.changed = time.monotonic()
        page.on("websocket", self._connected)

    def _connected(self, socket: WebSocket) -> None:
        self.open = {"what a page asks first"}
        socket.on("framesent", self._sent)
        socket.on("framereceived", self._received)

    def _sent(self, text: str | bytes) -> None:
        self.open = {each["key"] for each in json.loads(text)["want"]}
        self.changed = time.monotonic()

    def _received(self, contents: str | bytes) -> None:
        answer: dict[str, Any] = (
            header_of(contents)[0] if isinstance(contents, bytes) else json.loads(contents)
        )
        if answer["kind"] == "refused":
            self.refused.append(answer["message"])
        if answer["kind"] not in ("working", "reloaded"):
            self.open.discard(answer["key"])
            self.changed = time.monotonic()

    def wait(self) -> None:
        """Until all are answered; raises RuntimeError where one is refused, or takes too long."""
        self.changed = time.monotonic()
        end = self.changed + _LONGEST
        while self.open or time.monotonic() - self.changed < _STILL:
            if self.refused or time.monotonic() > end:
                raise RuntimeError(f"{self.page.url}: {self.refused or sorted(self.open)}")
            self.page.wait_for_timeout(100)


def picture_of(page: Page, questions: Questions, address: str, scene: SceneFacts) -> Image.Image:
    """The page with a scene, when all that it asks for is answered."""
    presses = {
        each["name"]: len(each.get("shows", {}).get("ladder", [0])) - 1 for each in lessons()
    }
    page.goto("about:blank")
    with page.expect_websocket():
        page.goto(f"{address}&scene={scene.name}")
    questions.wait()
    page.keyboard.press("Space")
    # A page on stability shows the step size with which it begins.
    for _ in range(presses.get(scene.name, 0) if scene.state.plot == "order" else 0):
        page.keyboard.press("=")
        questions.wait()
    frame = int(_PARTS.get(scene.name, _USUAL) * scene.state.problem.frames)
    page.locator("#scrub").fill(str(frame))
    page.locator("#scrub").blur()
    questions.wait()
    return Image.open(io.BytesIO(page.screenshot())).convert("RGB")


def sheet_of(pictures: list[Image.Image]) -> Image.Image:
    """Pictures at half their size, side by side."""
    width, height = WINDOW["width"] // 2, WINDOW["height"] // 2
    rows = -(-len(pictures) // COLUMNS)
    sheet = Image.new("RGB", (COLUMNS * width, rows * height), "white")
    for index, each in enumerate(pictures):
        place = (index % COLUMNS * width, index // COLUMNS * height)
        sheet.paste(each.resize((width, height), Image.Resampling.LANCZOS), place)
    return sheet


def write(name: str, image: Image.Image) -> None:
    """A file of docs/images."""
    contents = io.BytesIO()
    image.save(contents, "WEBP", quality=_QUALITY, method=6)
    write_whole(IMAGES / name, contents.getvalue())


def main(names: list[str]) -> None:
    """Write the pictures."""
    of_lessons = [each for each in scenes() if not each.name.startswith("figure-")]
    figures = [each for each in scenes() if each not in of_lessons]
    sheets = [figures[i : i + _OF_A_SHEET] for i in range(0, len(figures), _OF_A_SHEET)]
    chromium = shutil.which("chromium") or sys.exit("there is no Chromium on this machine")
    with opened_lab() as (address, _), sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium, args=["--no-sandbox"])
        page = browser.new_page(viewport=WINDOW, locale="en-GB")  # type: ignore[arg-type]
        questions = Questions(page)
        files = {
            **{f"lab-{each.name}.webp": [each] for each in of_lessons},
            **{f"lab-figures-{number}.webp": each for number, each in enumerate(sheets, start=1)},
        }
        for index, (name, those) in enumerate(files.items()):
            bar(name, index / len(files))
            if not names or {each.name for each in those} & set(names):
                pictures = [picture_of(page, questions, address, each) for each in those]
                write(name, pictures[0] if those[0] in of_lessons else sheet_of(pictures))
        bar("done", 1.0)
        browser.close()


if __name__ == "__main__":
    main(sys.argv[1:])
