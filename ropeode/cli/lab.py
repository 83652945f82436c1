"""The command that opens the lab."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from urllib.parse import quote

import click

from ropeode.cli.options import TABLE, no_code_option
from ropeode.errors import InputError
from ropeode.files import check_suffix, write_whole
from ropeode.terminal import not_interrupted, out_option_with, set_up_jax, with_progress
from ropeode.validation import bad_value

_PACKAGES = ("uvicorn", "starlette", "websockets")


@click.command()
@click.argument("step", required=False, metavar="[FILE.py[:NAME]]")
@click.option("--problem", metavar="NAME", help=TABLE["problem"].help, type=click.Path())
@click.option("--scene", metavar="NAME", help="A lesson, or a figure of the published report.")
@click.option("--port", metavar="N", help="Port to listen on. [the first free one from 8460]")
@click.option("--no-browser", is_flag=True, help="Print the address, and open no browser.")
@out_option_with(
    "Write the lab to one .html file that plays without Python, and open nothing.",
    metavar="FILE.html",
)
@no_code_option
def lab(
    step: str | None,
    problem: str | None,
    scene: str | None,
    port: str | None,
    no_browser: bool,
    out: str | None,
) -> int:
    """Open the lab: motion and true error side by side, in the browser.

    The steppers of FILE.py, or the one of this NAME, stand beside those of ropeode, and a new
    version takes their place as soon as the file is saved. The page is served to this machine
    alone, until Ctrl-C.
    """
    if out is not None:
        if port is not None:
            allowed = "only without --out: a file needs no port"
            raise bad_value("port", port, allowed, "leave out one of the two")
        return _write(out, step, problem, scene)
    from ropeode.validation import check_whole, require

    for package in _PACKAGES:
        require(package, "lab", "the lab")
    from ropeode.laboratory import (
        LOOPBACK,
        Dispatcher,
        Doorkeeper,
        Limits,
        WatchedFile,
        WorkerProcess,
        listening,
        open_browser,
        serve,
    )

    file = None if step is None else WatchedFile(_file_of(step))
    code = _file_of_problem(problem)
    number = None if port is None else check_whole("port", port, at_least=1, example="8460")
    server = listening(number)
    taken = server.getsockname()[1]
    doorkeeper = Doorkeeper(taken)

    def opened(link: dict[str, Any]) -> None:
        parts = "&".join(f"{name}={quote(json.dumps(value))}" for name, value in link.items())
        address = f"http://{LOOPBACK}:{taken}/?token={doorkeeper.token}{parts and f'#{parts}'}"
        click.echo(f"The lab is at {address}\nCtrl-C closes it.")
        if not no_browser:
            open_browser(address)

    worker = WorkerProcess(Limits(), step, problem, scene)
    dispatcher = Dispatcher(worker, file, code)
    if problem is None and scene is None:
        # The page need not wait for the worker.
        opened({})
    else:
        dispatcher.opened = opened
    serve(server, dispatcher, doorkeeper)
    click.echo("The lab is closed.")
    return 0


def _file_of_problem(problem: str | None) -> Path | None:
    """The file that a problem is in; None for one of the library.

    Raises:
        InputError: it is code, and none may be run.
    """
    from ropeode.files import refuse_code

    path = Path((problem or "").rpartition(":")[0] or problem or "")
    if path.suffix == ".py":
        refuse_code("problem", path)
    return path if path.is_file() else None


def _write(out: str, step: str | None, problem: str | None, scene: str | None) -> int:
    """Write the lab to one file."""
    path = check_suffix("out", out, [".html"])
    file = None if step is None else _file_of(step)
    _file_of_problem(problem)
    set_up_jax()
    from ropeode.laboratory import (
        Laboratory,
        OwnFile,
        WatchedFile,
        link_of,
        opened_with,
        page_with_answers,
    )

    given, choice = opened_with(problem) if problem else (None, None)
    link, laboratory = link_of(choice, scene), Laboratory(given)
    if step is not None and file is not None:
        own, version = OwnFile(step), WatchedFile(file).newest
        for each in own.load(version.name, version.text, version.fault).own:
            if each.fault is not None:
                raise InputError(each.fault)
        laboratory.own = own.own
    contents = with_progress(lambda progress: page_with_answers(laboratory, link, progress))
    with not_interrupted():
        write_whole(path, contents)
    click.echo(f"wrote {path} ({len(contents.encode()) / 1e6:.1f} MB)")
    return 0


def _file_of(stepper: str) -> Path:
    """The file of a stepper, which exists.

    Raises:
        InputError: it does not, or no code may be run.
    """
    from ropeode.files import read_bytes, refuse_code
    from ropeode.laboratory import watched_path

    path = watched_path(stepper)
    if path.suffix != ".py":
        fix = "name a file of yours; those of ropeode are in the lab in any case"
        raise bad_value("stepper", stepper, "FILE.py or FILE.py:NAME", fix)
    refuse_code("stepper", path)
    read_bytes("stepper", path)
    return path
