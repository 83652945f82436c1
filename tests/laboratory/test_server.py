"""The server: one question at a time, the most urgent first, and a worker that may die."""

from __future__ import annotations

import asyncio
import itertools

import psutil
import pytest

from ropeode.laboratory import Limits, WatchedFile, checked_header
from tests.laboratory.serving import SOON_S, do, running
from tests.time_limit import HANGS_AFTER_S

pytestmark = pytest.mark.anyio


async def test_an_answer_is_kept_for_all_pages_and_after_a_reconnection(lab):
    question = do("work")
    async with lab.page() as page:
        first = await page.ask(question, "one")
    async with lab.page() as page:
        again = await page.ask(question, "two")
    assert first["kind"] == "phase"
    assert again == {**first, "key": "two"}
    while lab.dispatcher.connections:
        await asyncio.sleep(0.01)


async def test_the_most_urgent_comes_first_and_what_is_not_wanted_is_never_begun():
    # Of a worker that is not ready yet.
    async with running() as lab, lab.page() as page:
        a, b, c = (do("work") for _ in range(3))
        await page.want(a=a, b=b, c=c)
        await page.want(c=c, a=a)
        answers = await page.answers("a", "c")
        # The first may have been begun before the second message came.
        assert list(answers) == ["c", "a"] or answers["a"]["every"] == 1
        assert (await page.ask(do("work"), "d"))["every"] <= 4


async def test_what_runs_gives_way_to_the_more_urgent_and_is_stopped_where_nobody_wants_it(lab):
    async with asyncio.timeout(10), lab.page() as page:
        long = do("wait")
        await page.want(long=long)
        await page.until_it_waits()
        await page.want(short=do("work"), long=long)
        begun = (await page.answers("short"))["short"]["every"]
        await page.until_it_waits()
        assert (await page.ask(do("work"), "b"))["every"] == begun + 2


@pytest.mark.slow
async def test_pages_take_turns_and_a_long_question_of_one_gives_way_to_the_other(lab):
    async with lab.page() as one, lab.page() as two:
        begun = (await two.ask(do("work")))["every"]
        many = {f"k{n}": do("work") for n in range(40)}
        await one.want(**many)
        assert (await two.ask(do("work"), "b"))["every"] < begun + 35
        assert len(await one.answers(*many)) == 40
        await one.want(long={"kind": "check", "stepper": "wait 1"})
        await one.until_it_waits()
        begun = [(await two.ask(do("work"), key))["every"] for key in "cde"]
        # It was begun, and again after the other page had its answers.
        assert (await one.answers("long"))["long"]["every"] > begun[-1] > begun[0]


@pytest.mark.slow
async def test_what_nobody_asked_is_prepared_in_a_pause_gives_way_and_is_prepared_again():
    async with (
        running(ahead=(do("break"), do("wait"))) as lab,
        lab.page() as page,
        asyncio.timeout(SOON_S),
    ):
        begun = [0]
        while sum(two - one > 1 for one, two in itertools.pairwise(begun)) < 2:
            await asyncio.sleep(0.6)
            answer = await asyncio.wait_for(page.ask(do("work"), f"k{len(begun)}"), 10)
            begun.append(answer["every"])
        # What fails is not tried again; nothing but it and what waits was begun beside these.
        gaps = [two - one - 1 for one, two in itertools.pairwise(begun)]
        assert sum(gaps) <= 3
        assert max(gaps) <= 2


REFUSED = {
    "crash": "The computation ended its process (SIGSEGV)",
    "spin": "The computation did not finish within 1 s of processor time",
    "spit []": "wrote something in place of its answer",
    "raise": "stepper: raises given",
    "break": "ZeroDivisionError: by zero: a fault of ropeode; please report it.",
    "exit": "The computation ended its process (exit code 7)",
}


async def test_what_ends_the_worker_is_refused_and_a_new_one_is_ready_before_the_next(monkeypatch):
    # Where other processes keep the processors busy, a second of one lasts long.
    monkeypatch.setattr("ropeode.laboratory.worker._WAITING", float(HANGS_AFTER_S))
    async with running(limits=Limits(seconds=1.0, stops_in=0.5)) as lab, lab.page() as page:
        await page.want(**{does: do(does) for does in REFUSED})
        answers = await page.answers(*REFUSED)
        for does, words in REFUSED.items():
            assert answers[does]["kind"] == "refused"
            assert words in answers[does]["message"]
        while not lab.worker.is_ready:
            await asyncio.sleep(0.01)
        assert (await page.ask(do("work")))["kind"] == "phase"


async def test_what_takes_too_much_memory_is_refused():
    # Taking memory costs processor time too, on some machines more than a second.
    async with running(limits=Limits(memory=400 * 2**20)) as lab, lab.page() as page:
        refused = await page.ask(do("eat"))
        assert "needed more than 400 MiB of memory" in refused["message"]


@pytest.mark.slow
async def test_memory_is_bounded():
    sizes = []
    async with running() as lab, lab.page() as page:
        for number in range(400):
            await page.ask(do("large"), f"k{number}")
            sizes.append(psutil.Process().memory_info().rss)
    # 1600 MiB were answered, of which the server keeps 128.
    assert max(sizes) - sizes[0] < 400 * 2**20
    assert max(sizes[200:]) - max(sizes[:200]) < 40 * 2**20
    # A worker that has grown rests.
    async with running(limits=Limits(tidy_memory=1)) as lab, lab.page() as page:
        first, second = [await page.ask(do("work"), key) for key in "ab"]
        assert first["x_label"] != second["x_label"]


async def test_a_worker_that_does_not_stop_is_replaced_and_nothing_is_left_behind():
    # Other tests leave behind Python's own process that tracks shared memory.
    before = {*psutil.Process().children(recursive=True)}
    # No other limit ends it.
    stubborn = Limits(seconds=1000.0, stops_in=0.2)
    async with running(limits=stubborn) as lab, lab.page() as page:
        first = await page.ask(do("work"))
        await page.want(a=do("spin"))
        await asyncio.sleep(0.3)
        second = await page.ask(do("work"), "b")
        assert first["x_label"] != second["x_label"]
        await page.want(a=do("spin"))
        await asyncio.sleep(0.3)
        children = {*psutil.Process().children(recursive=True)} - before
    gone, alive = psutil.wait_procs(children, timeout=10)
    assert gone
    assert not alive


@pytest.mark.slow
async def test_a_new_version_of_the_file_is_announced_and_one_that_ends_the_worker_is_not_run_again(
    tmp_path, monkeypatch
):
    monkeypatch.setattr("ropeode.laboratory.watch._LOOKS_AGAIN_S", 0.01)
    path = tmp_path / "steps.py"
    path.write_text("1")
    async with running(file=WatchedFile(path)) as lab, lab.page() as page:

        async def reloaded(text):
            path.write_text(text)
            while (message := await page.next())["kind"] != "reloaded":
                pass
            return message["own"][0]

        first = await page.ask(do("work"))
        second = await reloaded("22")
        third = await reloaded("exit")
        assert third["version"] == second["version"]
        assert third["fault"] == "The file ended its process (exit code 7)"
        fourth = await reloaded("4444")
        assert fourth["fault"] is None
        assert len({first["v_label"], second["version"], fourth["version"]}) == 3


def test_what_is_no_message_of_a_worker_is_refused():
    headers = [
        *(b"[]", b"{}", b'{"kind":"order","key":"1","arrays":{}}'),
        *(b'{"kind":"stopped","key":%s}' % each for each in (b'1,"arrays":{}', b'"1"')),
        *(b'{"kind":"stopped","key":"1","arrays":{"x":%s}}' % x for x in (b"[0,[9]]", b"[-1,[1]]")),
    ]
    written = [len(each).to_bytes(4, "little") + each for each in headers]
    for contents in (b"", b"{", b"\xff" * 9, *written):
        with pytest.raises(ValueError, match="."):
            checked_header(contents)
