"""The server of the lab: its page, and a WebSocket for questions and answers. It imports no JAX."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import mimetypes
import signal
import socket
import threading
import webbrowser
from collections.abc import AsyncIterator, Callable

import uvicorn
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import FileResponse, PlainTextResponse, RedirectResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp
from starlette.websockets import WebSocket

from ropeode.laboratory.dispatcher import Dispatcher
from ropeode.laboratory.page_files import PAGE
from ropeode.laboratory.safety import LOOPBACK, Doorkeeper, Guarded
from ropeode.laboratory.wants import MOST_TEXT
from ropeode.validation import bad_value

_FIRST_PORT, _PORTS = 8460, 40
# A longer message is not even refused: the connection is closed.
_MOST_BYTES = 4 * MOST_TEXT
_MOST_PAGES = 32
# Reasons for which a WebSocket is closed (RFC 6455).
_POLICY, _TRY_AGAIN_LATER = 1008, 1013
_NO_TOKEN = "Open the address that `ropeode lab` printed: it has the token."


def app(
    dispatcher: Dispatcher, doorkeeper: Doorkeeper, ended: Callable[[], None] = lambda: None
) -> ASGIApp:
    """The lab as an ASGI application.

    Arguments:
        dispatcher: has the questions answered, as long as the application runs.
        doorkeeper: who says what is let in.
        ended: is called when no more questions can be answered.
    """
    # The registry of a machine may have other types, with which browsers run no module.
    mimetypes.add_type("text/javascript", ".js")

    async def page(request: Request) -> Response:
        token = request.query_params.get("token")
        if token is None:
            return FileResponse(PAGE / "index.html")
        if not doorkeeper.knows(token):
            return PlainTextResponse(_NO_TOKEN, 403)
        # The token leaves the address bar, and so what is copied from there.
        answer = RedirectResponse(str(request.url.remove_query_params("token")), 303)
        answer.set_cookie(doorkeeper.cookie, token, httponly=True, samesite="strict")
        return answer

    async def talk(page: WebSocket) -> None:
        await page.accept()
        if not doorkeeper.knows(page.cookies.get(doorkeeper.cookie)):
            await page.close(_POLICY, _NO_TOKEN)
        elif len(dispatcher.connections) >= _MOST_PAGES:
            await page.close(_TRY_AGAIN_LATER, f"At most {_MOST_PAGES} pages; close another.")
        else:
            await dispatcher.serve(page)

    @contextlib.asynccontextmanager
    async def working(_: Starlette) -> AsyncIterator[None]:
        work = asyncio.create_task(dispatcher.work())
        work.add_done_callback(lambda _: ended())
        try:
            yield
        finally:
            work.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await work

    routes = [
        Route("/", page),
        WebSocketRoute("/socket", talk),
        Mount("/", StaticFiles(directory=PAGE)),
    ]
    return Guarded(Starlette(routes=routes, lifespan=working), doorkeeper)


def listening(port: int | None) -> socket.socket:
    """A socket that listens on this machine alone.

    Arguments:
        port: None for the first that is free.

    Raises:
        InputError: the port is taken, or may not be used.
    """
    ports = range(_FIRST_PORT, _FIRST_PORT + _PORTS) if port is None else [port]
    for each in ports:
        server = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
        # One that was closed a moment ago may be used again.
        server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            server.bind((LOOPBACK, each))
            server.listen()
            return server
        except (OSError, OverflowError) as error:
            server.close()
            if port is not None or getattr(error, "errno", None) != errno.EADDRINUSE:
                why = getattr(error, "strerror", None) or error
                allowed = f"a port that is free ({why})"
                raise bad_value("port", each, allowed, "choose another, or none") from None
    taken = f"{_FIRST_PORT} to {_FIRST_PORT + _PORTS - 1}"
    raise bad_value("port", taken, "a port that is free; these are not", "choose one: --port N")


def serve(server: socket.socket, dispatcher: Dispatcher, doorkeeper: Doorkeeper) -> None:
    """Serve the lab until Ctrl-C.

    Raises:
        RopeodeError: the worker cannot be started with what the lab was opened with.
    """

    def end() -> None:
        site.should_exit = True

    site = site_of(app(dispatcher, doorkeeper, end))
    # Uvicorn ends in good order on Ctrl-C, and then raises it again.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    site.run(sockets=[server])
    if dispatcher.failure is not None:
        raise dispatcher.failure


def site_of(lab: ASGIApp) -> uvicorn.Server:
    """A server of the application, which runs until its `should_exit` is set."""
    config = uvicorn.Config(
        lab,
        loop="asyncio",
        http="h11",
        ws="websockets-sansio",
        ws_max_size=_MOST_BYTES,
        # Nothing is saved by it on one machine.
        ws_per_message_deflate=False,
        lifespan="on",
        log_level="warning",
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=1,
    )
    return uvicorn.Server(config)


def open_browser(address: str) -> None:
    """Open a page without waiting for the browser."""
    threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()
