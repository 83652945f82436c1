"""The lab in one file: the page, and a recording of what a reader's keys ask for.

It needs neither Python nor a network, and loads nothing from anywhere.
"""

from __future__ import annotations

import base64
import graphlib
import hashlib
import html
import json
import posixpath
import re
from collections.abc import Iterable, Iterator, Mapping
from importlib import metadata
from typing import Any
from urllib.parse import quote

from pydantic import TypeAdapter

from ropeode.errors import RopeodeError
from ropeode.laboratory.answers import answer_to
from ropeode.laboratory.asks import DEFAULT_LADDER, asks_of, checks_of, shown_first
from ropeode.laboratory.messages import Ask, AskTruth, Refused, Truth
from ropeode.laboratory.page_files import PAGE
from ropeode.laboratory.setup import Laboratory
from ropeode.laboratory.wire import decoded, encoded
from ropeode.progress import Progress, part_of

_ASKS: TypeAdapter[Ask] = TypeAdapter(Ask)
_ENTRY = "main.js"
_LANGUAGES = ("en", "zh")
# What stands between quotes after `from`, or after `import` at the beginning of a line.
_IMPORTED = re.compile(r'(\bfrom\s+|^import\s+)"(\.[^"]+)"', re.MULTILINE)
_STYLE_SHEET = re.compile(r'<link rel="stylesheet" href="([^"]+)">')


def page_with_answers(
    laboratory: Laboratory,
    link: Mapping[str, Any],
    progress: Progress,
    *,
    checks: bool = True,
    theory: bool = True,
) -> str:
    """The lab as a page that plays without Python.

    Its order plot grows with the keys `-` and `=`, within a ladder of steps per frame that is
    computed here. What else a reader asks for is answered with how to install ropeode.

    Arguments:
        laboratory: computes the answers.
        link: what the page shows at first, as `setup.link_of` has it.
        progress: called with what is being done and the fraction that is done.
        checks: whether the steppers of the user's own are checked, which takes long.
        theory: whether the order plot shows predicted errors too, which take as long as the rest.

    Returns:
        The text of an HTML file.

    Raises:
        InputError: the problem cannot be used.
        ReferenceRefused: the problem has no certified reference.
    """
    problem, steppers = shown_first(laboratory, link)
    beginning = part_of(progress, 0.0, 0.1)
    # Without a reference there is nothing to show; this raises.
    truth, _ = answer_to(AskTruth(kind="truth", problem=problem), laboratory, beginning)
    assert isinstance(truth, Truth)
    ladder = tuple(link.get("ladder", DEFAULT_LADDER))
    every = asks_of(laboratory, problem, steppers, ladder, link.get("steps"))
    asks = [ask for ask in every if theory or ask.kind != "theory"]
    if checks:
        asks += checks_of(laboratory)
    answers = recorded(asks, laboratory, part_of(progress, 0.1, 1.0))
    named = {"problem": problem.model_dump(mode="json"), "steppers": steppers, **link}
    return page_with(as_link(named), answers, truth.certificate)


def recorded(asks: Iterable[Ask], laboratory: Laboratory, progress: Progress) -> str:
    """The answers to questions, as the text of a JSON file.

    A list of ``{"ask": the question, "wire": the answer's bytes in base64}``, as
    `wire.py` makes them, without a key. What is refused is recorded as such.

    Arguments:
        asks: the questions.
        laboratory: answers them.
        progress: called with what is being done and the fraction that is done.
    """
    whole, entries = list(asks), []
    for index, ask in enumerate(whole):
        part = part_of(progress, index / len(whole), (index + 1) / len(whole))
        try:
            contents = encoded("", *answer_to(ask, laboratory, part))
        except RopeodeError as error:
            contents = encoded("", Refused(message=str(error)), {})
        question = ask.model_dump(mode="json", exclude_none=True)
        entries.append({"ask": question, "wire": base64.b64encode(contents).decode()})
    progress("done", 1.0)
    lines = ",\n".join(json.dumps(each, separators=(",", ":")) for each in entries)
    return f"[\n{lines}\n]\n"


def answers_in(recording: str) -> Iterator[tuple[Ask, dict[str, Any], dict[str, Any]]]:
    """Each question of a recording, with the header and the arrays of its answer."""
    for each in json.loads(recording):
        header, arrays = decoded(base64.b64decode(each["wire"]))
        yield _ASKS.validate_python(each["ask"]), header, arrays


def as_link(parts: Mapping[str, Any]) -> str:
    """What stands after # in the page's address."""
    return "&".join(f"{name}={quote(json.dumps(value))}" for name, value in parts.items())


def modules() -> dict[str, str]:
    """The page's modules by their paths, each after those that it imports.

    What one imports is named by its path, behind ``lab:``, for `loader.js` to put an address there.
    """
    sources = {
        path.relative_to(PAGE).as_posix(): path.read_text("utf-8")
        for path in sorted(PAGE.rglob("*.js"))
    }
    needs: dict[str, set[str]] = {}

    def linked(name: str) -> str:
        needs[name] = set()

        def absolute(found: re.Match[str]) -> str:
            path = posixpath.normpath(posixpath.join(posixpath.dirname(name), found[2]))
            needs[name].add(path)
            return f'{found[1]}"lab:{path}"'

        return _IMPORTED.sub(absolute, sources[name])

    texts, wanted = {}, [_ENTRY]
    while wanted:
        name = wanted.pop()
        if name not in texts:
            texts[name] = linked(name)
            wanted += needs[name]
    return {name: texts[name] for name in graphlib.TopologicalSorter(needs).static_order()}


def page_with(link: str, answers: str, certificate: Iterable[str]) -> str:
    """The page in one file, with a recording inside.

    Arguments:
        link: what stands after # in the page's address, for what it shows at first.
        answers: as `recorded` has them.
        certificate: of the reference, for a reader who lets no script run.
    """
    page = (PAGE / "index.html").read_text("utf-8")
    page = _STYLE_SHEET.sub(lambda found: f"<style>\n{_text(found[1])}</style>", page)
    loader = f"\n{_text('loader.js')}"
    allowed = hashlib.sha256(loader.encode()).digest()
    policy = (
        f"default-src 'none'; script-src 'sha256-{base64.b64encode(allowed).decode()}' blob:; "
        "style-src 'unsafe-inline'; img-src data: blob:; base-uri 'none'; form-action 'none'"
    )
    head = (
        f'<meta http-equiv="Content-Security-Policy" content="{policy}">\n    '
        f'<meta name="generator" content="ropeode {metadata.version("ropeode")}">\n    '
        f'<meta name="lab-link" content="{html.escape(link)}">'
    )
    lines = "".join(f"<li>{html.escape(line)}</li>" for line in certificate)
    texts = {
        **{name: _text(name) for name in (f"words/{each}.json" for each in _LANGUAGES)},
        "recordings/default.json": answers,
        "modules": json.dumps(list(modules().items()), ensure_ascii=False),
    }
    inside = "".join(
        f'<script type="application/json" id="{name}">{_inside(text)}</script>\n'
        for name, text in texts.items()
    )
    replaced = {
        '<meta name="lab-socket" content="socket">': head,
        f'<script type="module" src="{_ENTRY}"></script>': "",
        # The page opens it as well; this is for who reads the file, or lets no script run.
        '<div id="certificate"></div>': '<div id="certificate"><details open>'
        f"<ul>{lines}</ul></details></div>",
        "</body>": f"{inside}<script>{loader}</script>\n  </body>",
    }
    for old, new in replaced.items():
        before, found, after = page.partition(old)
        assert found, f"index.html has no {old}"
        page = before + new + after
    return page


def _text(name: str) -> str:
    return (PAGE / name).read_text("utf-8")


def _inside(text: str) -> str:
    """JSON that no tag of HTML can end."""
    return text.replace("<", "\\u003c")
