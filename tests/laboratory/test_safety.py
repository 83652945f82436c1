"""Who is let in, and what a page may send."""

from __future__ import annotations

import json
import random
import socket

import httpx
import pytest
import websockets

from ropeode.errors import InputError
from ropeode.laboratory import MOST_TEXT, listening
from ropeode.laboratory.messages import MOST_WANTED
from tests.laboratory.serving import do

pytestmark = pytest.mark.anyio


def test_it_listens_on_this_machine_alone():
    with listening(0) as listener:
        host, port = listener.getsockname()
        assert host == "127.0.0.1"
        with pytest.raises(InputError, match=f"port: {port} given; allowed: a port that is free"):
            listening(port)
        with socket.socket() as other, pytest.raises(ConnectionRefusedError):
            other.connect(("127.0.0.2", port))


async def test_the_token_becomes_a_cookie_and_every_answer_carries_the_headers_of_safety(lab):
    answers = {
        f"/?token={lab.doorkeeper.token}&a=b": 303,
        "/": 200,
        "/messages.d.ts": 200,
        "/?token=wrong": 403,
        "/%2e%2e/server.py": 404,
    }
    async with httpx.AsyncClient(base_url=f"http://{lab.host}") as client:
        for path, code in answers.items():
            done = await client.get(path)
            assert done.status_code == code
            if code == 303:
                # The token leaves the address.
                assert done.headers["location"] == f"http://{lab.host}/?a=b"
                cookie = done.headers["set-cookie"].lower().split("; ")
                assert {"httponly", "samesite=strict"} <= {*cookie}
            else:
                assert "set-cookie" not in done.headers
            policy = done.headers["content-security-policy"]
            assert {"default-src 'self'", "frame-ancestors 'none'"} <= {*policy.split("; ")}
            assert "unsafe" not in policy
            assert done.headers["x-content-type-options"] == "nosniff"
            assert done.headers["referrer-policy"] == "no-referrer"
        assert (await client.post("/")).status_code == 405


async def test_another_host_and_another_page_are_refused(lab):
    host, _, port = lab.host.rpartition(":")
    strangers = ("evil.example", f"evil.example:{port}", host, f"{host}:1", f"[::2]:{port}")
    async with httpx.AsyncClient(base_url=f"http://{lab.host}") as client:
        for name in strangers:
            done = await client.get("/messages.d.ts", headers={"Host": name})
            assert done.status_code == 403, name
            assert "nowhere else" in done.text
            with pytest.raises(websockets.InvalidStatus, match="403"):
                await lab.connect(name, origin=f"http://{name}")
        for name in (f"localhost:{port}", f"[::1]:{port}"):
            done = await client.get("/messages.d.ts", headers={"Host": name})
            assert done.status_code == 200
            async with lab.connect(name, origin=f"http://{name}") as page:
                await page.ping()
    for origin in (None, "http://evil.example", "null", f"https://{lab.host}"):
        with pytest.raises(websockets.InvalidStatus, match="403"):
            await lab.connect(origin=origin)


async def test_without_the_token_nothing_is_answered(lab):
    cookie, token = lab.doorkeeper.cookie, lab.doorkeeper.token
    for given in ({}, {"Cookie": f"{cookie}=wrong"}, {"Cookie": f"other={token}"}):
        async with lab.connect(additional_headers=given) as page:
            with pytest.raises(websockets.ConnectionClosed) as closed:
                await page.recv()
            assert closed.value.rcvd.code == 1008
            assert "`ropeode lab` printed" in closed.value.rcvd.reason


FAULTY = {
    "{": "JSON",
    "null": '{"want"',
    '{"want": 3}': '{"want"',
    '{"want": [], "file": "/etc/passwd"}': "leave it out",
    '{"want": [NaN]}': "NaN is not a number in JSON",
    "[" * 100_000: "nested too deeply",
    '{"want": [' + "9" * 5000 + "]}": "JSON",
    '{"want": [' + "0," * MOST_WANTED + "0]}": f"at most {MOST_WANTED}",
    " " * (MOST_TEXT + 1): f"at most {MOST_TEXT}",
    b"\x00": "allowed: text",
}
RUN = do("work")
FAULTY_QUESTIONS = [
    ({**RUN, "steps_per_frame": [0]}, "steps_per_frame.0: 0 given"),
    ({**RUN, "stepper": "s" * 1000}, "at most 200 characters"),
    ({**RUN, "file": "/etc/passwd"}, "file: '/etc/passwd' given; allowed: extra inputs are not"),
    ({"kind": "exec", "code": "1"}, "exec"),
    (7, "7 given"),
]


async def test_what_is_faulty_is_refused_with_a_sentence_and_what_is_beside_it_answered(page):
    for text, words in FAULTY.items():
        await page.socket.send(text)
        refused = await page.next()
        assert (refused["kind"], refused["key"]) == ("refused", "")
        assert words in refused["message"]
        assert len(refused["message"]) < 1000
    for ask, words in FAULTY_QUESTIONS:
        await page.want(bad=ask, good=RUN)
        answers = await page.answers("bad", "good")
        assert words in answers["bad"]["message"]
        assert answers["good"]["kind"] == "phase"


ANYTHING = [
    *(None, True, 0, -1, 0.5, 2**63, 10**400, 1e308, float("inf"), float("nan")),
    *("", "truth", "order", "\x00", "\ud800", "../../etc/passwd", "x" * 5000),
    *([], [[]], [0, ["x"]], {}, {"kind": "truth"}, {"name": {"\ud800": [None]}}),
]


def message(draw):
    """A question with something wrong; of one in four a piece is gone or replaced."""
    ask = {**RUN, draw.choice([*RUN, "version", "x"]): draw.choice(ANYTHING)}
    entry = {"key": draw.choice(["k", "", "\ud800", 3]), "ask": ask}
    text = json.dumps({"want": draw.choice([[entry], [entry], draw.choice(ANYTHING)])})
    if draw.randrange(4):
        return text
    at, end = sorted(draw.randrange(len(text) + 1) for _ in range(2))
    between = draw.choice(["", text[at:end] * 2, "}", "\x00", "1e999", "[" * 5000])
    return text[:at] + between + text[end:]


async def test_no_message_kills_the_server(page, monkeypatch):
    # A thousand pauses would be most of the time of this test.
    monkeypatch.setattr("ropeode.laboratory.dispatcher._BETWEEN_S", 0.0)
    draw = random.Random(20)
    worker = (await page.ask(do("work")))["x_label"]
    for _ in range(1000):
        is_text = draw.randrange(4)
        await page.socket.send(message(draw) if is_text else draw.randbytes(draw.randrange(200)))
    await page.want(end=do("work"))
    sentences = []
    while (said := await page.next())["kind"] == "working" or said["key"] != "end":
        sentences += [said["message"]] if said["kind"] == "refused" else []
    assert all(sentences)
    assert len(sentences) > 600
    # And none has ended the worker.
    assert said["x_label"] == worker
