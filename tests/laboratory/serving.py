"""A lab that is served, and pages that talk to it, in one event loop."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import json

import websockets

from ropeode import laboratory
from tests.laboratory.stand_in import StandIn

SOON_S = 60.0


class Lab:
    def __init__(self, doorkeeper, dispatcher, worker, port):
        self.doorkeeper, self.dispatcher, self.worker = doorkeeper, dispatcher, worker
        self.port, self.host = port, f"127.0.0.1:{port}"

    def connect(self, name=None, **changes):
        """A WebSocket to this server, by another name where one is given."""
        headers = {"Cookie": f"{self.doorkeeper.cookie}={self.doorkeeper.token}"}
        given = {"origin": f"http://{self.host}", "additional_headers": headers, **changes}
        place = {"host": "127.0.0.1", "port": self.port, "max_size": None}
        return websockets.connect(f"ws://{name or self.host}/socket", **place, **given)

    @contextlib.asynccontextmanager
    async def page(self):
        async with self.connect() as socket:
            yield Page(socket)


class Page:
    def __init__(self, socket):
        self.socket = socket

    async def want(self, **asks):
        entries = [{"key": key, "ask": ask} for key, ask in asks.items()]
        await self.socket.send(json.dumps({"want": entries}))

    async def next(self):
        """The next message."""
        received = await asyncio.wait_for(self.socket.recv(), SOON_S)
        return (
            laboratory.decoded(received)[0] if isinstance(received, bytes) else json.loads(received)
        )

    async def answers(self, *keys):
        """The answers with these keys, in the order in which they come."""
        found = {}
        while {*keys} - {*found}:
            message = await self.next()
            if message["kind"] not in ("working", "reloaded"):
                assert message["key"] not in found
                found[message["key"]] = message
        return found

    async def until_it_waits(self):
        while (await self.next()).get("text") != "waiting":
            pass

    async def ask(self, ask, key="a"):
        await self.want(**{key: ask})
        return (await self.answers(key))[key]


_NUMBERS = itertools.count(1)


def do(what):
    """A question that has the stand-in do something; no other question is the same."""
    return {
        "kind": "order",
        "problem": {"name": "rope"},
        "stepper": what,
        "steps_per_frame": [next(_NUMBERS)],
    }


@contextlib.asynccontextmanager
async def running(limits=None, file=None, ahead=()):
    limits = limits or laboratory.Limits()
    listener = laboratory.listening(0)
    port = listener.getsockname()[1]
    worker = laboratory.WorkerProcess(limits, *ahead, answering=StandIn)
    doorkeeper, dispatcher = laboratory.Doorkeeper(port), laboratory.Dispatcher(worker, file)
    site = laboratory.site_of(laboratory.app(dispatcher, doorkeeper))
    task = asyncio.create_task(site.serve(sockets=[listener]))
    try:
        yield Lab(doorkeeper, dispatcher, worker, port)
    finally:
        site.should_exit = True
        await task
