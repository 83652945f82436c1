"""Who may talk to the lab: the browser of whoever started it, and no page of another site.

The server listens on this machine alone. That does not keep other pages in the same browser out: a
page may send requests to any address, and a name of its own may come to mean this machine (DNS
rebinding). So `Host` must be a name of this machine, the WebSocket wants the `Origin` of the lab's
own page, and the token that only the printed address has.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Mapping

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

LOOPBACK = "127.0.0.1"
# What the page may load: its own files. Pictures that it draws itself become data: and blob:.
_POLICY = (
    "default-src 'self'; img-src 'self' data: blob:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)
_HEADERS = {
    "Content-Security-Policy": _POLICY,
    "Referrer-Policy": "no-referrer",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    # A page of an older release is never shown; unchanged files are not sent again.
    "Cache-Control": "no-cache",
}


class Doorkeeper:
    """Knows the token, and the names of this machine.

    Arguments:
        port: that the server listens on.
    """

    def __init__(self, port: int) -> None:
        self.token = secrets.token_urlsafe()
        # Cookies do not tell ports apart; two labs on one machine do.
        self.cookie = f"ropeode-lab-{port}"
        self.hosts = frozenset(f"{name}:{port}" for name in (LOOPBACK, "localhost", "[::1]"))

    def knows(self, token: str | None) -> bool:
        """Whether this is the token."""
        return token is not None and hmac.compare_digest(token.encode(), self.token.encode())

    def is_at_home(self, headers: Mapping[str, str]) -> bool:
        """Whether a request is for this machine by one of its own names."""
        return headers.get("host", "").lower() in self.hosts

    def is_own_page(self, headers: Mapping[str, str]) -> bool:
        """Whether a WebSocket is opened by a page of this server; browsers always say by which."""
        return headers.get("origin", "").lower() == f"http://{headers.get('host', '').lower()}"


class Guarded:
    """An ASGI application behind the doorkeeper, whose answers carry the headers of safety."""

    def __init__(self, app: ASGIApp, doorkeeper: Doorkeeper) -> None:
        self._app, self._doorkeeper = app, doorkeeper

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Refuse what is for another host; a WebSocket also where another page opens it."""
        if scope["type"] == "lifespan":
            await self._app(scope, receive, send)
            return
        headers = Headers(scope=scope)
        if scope["type"] == "websocket":
            if self._doorkeeper.is_at_home(headers) and self._doorkeeper.is_own_page(headers):
                await self._app(scope, receive, send)
            else:
                # Before it is accepted: the browser is answered 403.
                await send({"type": "websocket.close", "code": 1008})
            return

        async def send_safely(message: Message) -> None:
            if message["type"] == "http.response.start":
                MutableHeaders(scope=message).update(_HEADERS)
            await send(message)

        app = self._app
        if not self._doorkeeper.is_at_home(headers):
            names = " or ".join(sorted(self._doorkeeper.hosts))
            app = PlainTextResponse(
                f"The lab is at {names}, and nowhere else. Through ssh, take the same port on both "
                "sides.",
                403,
            )
        await app(scope, receive, send_safely)
