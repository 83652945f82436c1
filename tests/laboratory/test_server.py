"""The server: one question at a time, the most urgent first, and a worker that may die."""

from __future__ import annotations

import asyncio
import itertools
import os
import sys
import threading
import time

import psutil
import pytest

from ropeode.laboratory import Limits, WatchedFile, open_browser
from tests.laboratory.serving import SOON_S, do, in_lab
from tests.time_limit import HANGS_AFTER_S

SHORT = Limits(seconds=1.0, stops_in=0.5)
# Taking memory costs processor time too, on some machines more than a second.
NARROW = Limits(memory=400 * 2**20)


def test_an_answer_is_kept_for_all_pages_and_after_a_reconnection():
    async def test(lab):
        async with lab.page() as page:
            first = await page.ask(do("work"), "one")
        async with lab.page() as page:
            again = await page.ask(do("work"), "two")
        assert first["words"].startswith("answer 1 of ")
        assert again == {**first, "key": "two"}
        while lab.dispatcher.connections:
            await asyncio.sleep(0.01)

    in_lab(test)


def test_the_most_urgent_question_comes_first_and_what_is_not_wanted_is_never_begun():
    async def test(lab):
        async with lab.page() as page:
            await page.want(a=do("work", 1), b=do("work", 2), c=do("work", 3))
            await page.want(c=do("work", 3), a=do("work", 1))
            answers = await page.answers("a", "c")
            numbers = {key: each["words"].split()[1] for key, each in answers.items()}
            # The first may have been begun before the second message came.
            assert list(answers) == ["c", "a"] or numbers["a"] == "1"
            last = await page.ask(do("work", 4), "d")
            assert int(last["words"].split()[1]) <= 4

    in_lab(test)


def test_what_is_no_longer_wanted_is_stopped_while_it_runs():
    async def test(lab):
        async with lab.page() as page:
            await page.want(a=do("wait"))
            while (await page.next()).get("text") != "waiting":
                pass
            answer = await asyncio.wait_for(page.ask(do("work"), "b"), 10)
            assert answer["words"].startswith("answer 2 of ")

    in_lab(test)


def test_a_less_urgent_question_gives_way_and_is_answered_afterwards():
    async def test(lab):
        async with lab.page() as page:
            await page.want(long=do("wait"))
            while (await page.next()).get("text") != "waiting":
                pass
            await page.want(short=do("work"), long=do("wait"))
            await asyncio.wait_for(page.answers("short"), 10)
            while (await page.next()).get("text") != "waiting":
                pass

    in_lab(test)


def test_a_long_question_gives_way_to_another_page_and_is_answered_afterwards():
    async def test(lab):
        async with lab.page() as one, lab.page() as two:
            await one.want(long={"kind": "check", "stepper": "wait 2"})
            while (await one.next()).get("text") != "waiting":
                pass
            for number in range(3):
                await two.want(**{f"k{number}": do("work", number + 1)})
                await two.answers(f"k{number}")
            answer = (await one.answers("long"))["long"]
            # It was begun, and again after the other page had its answers.
            assert int(answer["words"].split()[1]) >= 5

    in_lab(test)


def test_what_nobody_asked_is_prepared_in_a_pause_gives_way_and_is_prepared_again():
    async def test(lab):
        async with asyncio.timeout(SOON_S), lab.page() as page:
            numbers = [0]
            while sum(two - one > 1 for one, two in itertools.pairwise(numbers)) < 3:
                await asyncio.sleep(0.6)
                question = do("work", len(numbers))
                answer = await asyncio.wait_for(page.ask(question, f"k{len(numbers)}"), 10)
                numbers.append(int(answer["words"].split()[1]))
            # What fails is not tried again; nothing but it and what waits was begun beside these.
            gaps = [two - one - 1 for one, two in itertools.pairwise(numbers)]
            assert sum(gaps) <= 4
            assert max(gaps) <= 2

    in_lab(test, ahead=(do("break"), do("wait")))


def test_two_pages_take_turns():
    async def test(lab):
        async with lab.page() as one, lab.page() as two:
            await one.want(**{f"k{n}": do("work", n) for n in range(1, 41)})
            answer = await two.ask(do("work", 99))
            assert int(answer["words"].split()[1]) < 35
            assert len(await one.answers(*(f"k{n}" for n in range(1, 41)))) == 40

    in_lab(test)


ENDS = {
    "exit": "The computation ended its process (exit code 7)",
    "crash": "The computation ended its process (SIGSEGV)",
    "spin": "The computation did not finish within 1 s of processor time",
    "raise": "stepper: raises given",
    "break": "ZeroDivisionError: by zero: a fault of ropeode; please report it.",
}


@pytest.mark.parametrize(
    "ends", [["exit", "spin", "raise"], pytest.param([*ENDS], marks=pytest.mark.slow)]
)
def test_a_question_that_ends_the_worker_is_refused_and_the_others_are_answered(ends, monkeypatch):
    # Where other processes keep the processors busy, a second of one lasts long.
    monkeypatch.setattr("ropeode.laboratory.worker_process._WAITING", float(HANGS_AFTER_S))

    async def test(lab):
        async with lab.page() as page:
            await page.want(**{does: do(does) for does in ends}, good=do("work"))
            answers = await page.answers(*ends, "good")
            for does in ends:
                assert answers[does]["kind"] == "refused"
                assert ENDS[does] in answers[does]["message"]
            assert answers["good"]["kind"] == "order"

    in_lab(test, limits=SHORT)


def test_a_question_that_takes_too_much_memory_is_refused_and_the_next_is_answered():
    async def test(lab):
        async with lab.page() as page:
            await page.want(eat=do("eat 40"), good=do("work"))
            answers = await page.answers("eat", "good")
            assert "The computation needed more than 400 MiB of memory" in answers["eat"]["message"]
            assert answers["good"]["kind"] == "order"

    in_lab(test, limits=NARROW)


@pytest.mark.skipif(sys.platform != "linux", reason="an orphan in a session of its own")
def test_what_a_question_starts_counts_and_ends_with_the_worker(tmp_path):
    stays, eats = str(tmp_path / "stays"), str(tmp_path / "eats")

    async def test(lab):
        async with lab.page() as page:
            await page.want(stays=do(f"fork {stays}"), eats=do(f"fork {eats}"), good=do("work"))
            answers = await page.answers("stays", "eats", "good")
            assert "needed more than 400 MiB of memory" in answers["eats"]["message"]
            assert answers["stays"]["kind"] == answers["good"]["kind"] == "order"

    in_lab(test, limits=NARROW)
    assert not any(os.path.exists(f"/proc/{os.readlink(each)}") for each in (stays, eats))


@pytest.mark.parametrize(
    "message",
    [
        *["", "{", "\xff" * 9],
        *[
            f"{chr(len(header))}\0\0\0{header}"
            for header in (
                "[]",
                "{}",
                '{"kind":"order","key":"1","arrays":{}}',
                '{"kind":"stopped","key":1,"arrays":{}}',
                '{"kind":"stopped","key":"1","arrays":{"x":[0,[9]]}}',
            )
        ],
    ],
)
def test_a_message_that_is_none_is_refused_and_the_next_question_answered(message):
    async def test(lab):
        async with lab.page() as page:
            await page.want(spit=do(f"spit {message}"), good=do("work"))
            answers = await page.answers("spit", "good")
            assert "wrote something in place of its answer" in answers["spit"]["message"]
            assert answers["good"]["kind"] == "order"

    in_lab(test)


def test_a_new_worker_is_ready_before_the_next_question():
    async def test(lab):
        async with lab.page() as page:
            assert (await page.ask(do("exit")))["kind"] == "refused"
            while not lab.worker.is_ready:
                await asyncio.sleep(0.01)
            assert (await page.ask(do("work"), "b"))["kind"] == "order"

    in_lab(test)


@pytest.mark.slow
def test_memory_is_bounded():
    async def test(lab):
        async with lab.page() as page:
            for number in range(1, 401):
                answer = await page.ask(do("large", number), f"k{number}")
                assert answer["kind"] == "phase"
                sizes.append(psutil.Process().memory_info().rss)

    sizes: list[int] = []
    in_lab(test)
    # 1600 MiB were answered, of which the server keeps 128.
    assert max(sizes) - sizes[0] < 400 * 2**20
    assert max(sizes[200:]) - max(sizes[:200]) < 40 * 2**20


def test_a_worker_that_does_not_stop_is_replaced():
    async def test(lab):
        async with lab.page() as page:
            first = await page.ask(do("work"))
            await page.want(a=do("spin"))
            await asyncio.sleep(0.3)
            second = await page.ask(do("work", 2), "b")
            assert first["words"].split()[3] != second["words"].split()[3]

    # No other limit ends it.
    in_lab(test, limits=Limits(seconds=1000.0, stops_in=0.2))


@pytest.mark.slow
def test_a_worker_that_has_grown_is_replaced_when_it_rests():
    async def test(lab):
        async with lab.page() as page:
            first = await page.ask(do("work"))
            second = await page.ask(do("work", 2), "b")
            assert first["words"].split()[3] != second["words"].split()[3]

    in_lab(test, limits=Limits(tidy_memory=1))


def test_nothing_is_left_behind():
    async def test(lab):
        async with lab.page() as page:
            await page.want(a=do("spin"))
            await asyncio.sleep(0.3)
        children.extend({*psutil.Process().children(recursive=True)} - before)
        assert children

    # Other tests leave behind Python's own process that tracks shared memory.
    before = {*psutil.Process().children(recursive=True)}
    children: list[psutil.Process] = []
    in_lab(test)
    gone, alive = psutil.wait_procs(children, timeout=10)
    assert gone
    assert not alive


def test_a_new_version_of_the_file_is_announced_and_one_that_ends_the_worker_is_not_run_again(
    tmp_path,
):
    path = tmp_path / "steps.py"
    path.write_text("1")

    async def test(lab):
        async with lab.page() as page:

            async def reloaded():
                while (message := await page.next())["kind"] != "reloaded":
                    pass
                return message["own"][0]

            before = await page.ask(do("work"))
            path.write_text("22")
            second = await reloaded()
            path.write_text("exit")
            third = await reloaded()
            assert third["version"] == second["version"]
            assert third["fault"] == "The file ended its process (exit code 7)"
            path.write_text("4444")
            fourth = await reloaded()
            assert fourth["fault"] is None
            versions = [before["words"].split()[-1], second["version"], fourth["version"]]
            assert len({*versions}) == 3

    in_lab(test, file=WatchedFile(path))


def test_the_page_is_opened_in_the_default_browser_and_nobody_waits_for_it(monkeypatch):
    opened, ends = [], threading.Event()

    def browser(address):
        ends.wait(HANGS_AFTER_S)
        opened.append(address)

    monkeypatch.setattr("webbrowser.open", browser)
    open_browser("http://127.0.0.1:8460/?token=t")
    assert not opened
    ends.set()
    while not opened:
        time.sleep(0.01)
    assert opened == ["http://127.0.0.1:8460/?token=t"]
