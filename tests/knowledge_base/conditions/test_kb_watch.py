"""Changes as an asynchronous iterator: filtered, bounded, from any thread."""

from __future__ import annotations

import asyncio
import threading
from typing import Any

import pytest
from kb_strategies import SCHEMA, THINGS

from knowledge_base import Change, Delta, KnowledgeBase, Missed, fact
from knowledge_base.errors import InputError


@pytest.fixture
def kb() -> KnowledgeBase:
    kb = KnowledgeBase(SCHEMA)
    kb.apply(Delta(nodes=THINGS), author="test")
    return kb


def tell(kb: KnowledgeBase, *facts) -> Change:
    return kb.apply(Delta(added=tuple(fact(*f) for f in facts)), author="test")


def read(watch) -> list[Any]:
    """All that waits to be read, to the end of the watch."""

    async def run() -> list[Any]:
        return [item async for item in watch]

    return asyncio.run(run())


async def _taken(watch, count) -> list[Any]:
    return [await asyncio.wait_for(anext(watch), 5) for _ in range(count)]


MOVED = Delta(added=(fact("on", "cup1", "shelf"),))
CHANGES = {
    "moved": MOVED,
    "quiet": Delta(added=(fact("quiet"),)),
    "weighed": Delta(values={fact("weight", "cup1"): 3}),
    "new": Delta(nodes={"cup9": "cup"}),
    "gone": Delta(removed=MOVED.added),
    "removed": Delta(removed_nodes=("cup1",)),
}


@pytest.mark.parametrize(
    ("pattern", "params", "expected"),
    [
        (None, {}, list(CHANGES)),
        ("(on ?o shelf)", {}, ["moved", "gone"]),
        ("(on ?o ?p)", {"p": "shelf"}, ["moved", "gone"]),
        ("(on cup2 ?p)", {}, []),
        ("(on ?same ?same)", {}, []),
        ("(weight ?i)", {}, ["weighed", "removed"]),
        ("(weight cup2)", {}, []),
        ("(item ?i)", {}, ["new", "removed"]),
        ("(place ?i)", {}, ["removed"]),
        ("(quiet)", {}, ["quiet"]),
    ],
)
def test_a_watch_tells_the_changes_that_touch_its_pattern(kb, pattern, params, expected) -> None:
    watch = kb.watch(pattern, params)
    versions = {kb.apply(delta, author="test").version: name for name, delta in CHANGES.items()}

    async def run() -> list[Any]:
        found = await _taken(watch, len(expected))
        with pytest.raises(asyncio.TimeoutError):
            await asyncio.wait_for(anext(watch), 0)
        return found

    assert [versions[change.version] for change in asyncio.run(run())] == expected


def test_a_slow_watcher_is_told_what_it_missed(kb) -> None:
    watch = kb.watch(limit=2)
    first = tell(kb, ("quiet",))
    assert asyncio.run(_taken(watch, 1)) == [first]
    for thing in ("cup1", "cup2", "can1"):
        last = tell(kb, ("heavy", thing))
    next_one = tell(kb, ("on", "cup1", "shelf"))
    assert asyncio.run(_taken(watch, 2)) == [Missed(since=first.version, until=last.version), next_one]


def test_missing_again_before_it_was_read_is_one_gap(kb) -> None:
    watch, start = kb.watch(limit=1), kb.version
    changes = [tell(kb, ("heavy", thing)) for thing in ("cup1", "cup2", "can1")]
    last = tell(kb, ("quiet",))
    assert asyncio.run(_taken(watch, 1)) == [Missed(start, last.version)]
    assert len(changes) == 3


def test_a_closed_watch_ends(kb) -> None:
    with kb.watch() as watch:
        tell(kb, ("quiet",))
    assert read(watch) == []
    tell(kb, ("heavy", "cup1"))
    assert read(watch) == []


def test_closing_ends_whoever_waits(kb) -> None:
    watch = kb.watch()

    async def run() -> list[Any]:
        waiting = asyncio.create_task(_all(watch))
        await asyncio.sleep(0)
        threading.Thread(target=watch.close).start()
        return await asyncio.wait_for(waiting, 5)

    assert asyncio.run(run()) == []


async def _all(watch) -> list[Any]:
    return [item async for item in watch]


def test_changes_of_several_threads_come_in_order_and_none_is_lost(kb) -> None:
    threads, each = 4, 50
    barrier = threading.Barrier(threads)
    watch = kb.watch("(time)")
    start = kb.version

    def work() -> None:
        barrier.wait(timeout=30)
        for _ in range(each):
            with kb.transaction(author="test") as tx:
                tx.set("time", kb.value("time", ()) + 1)

    async def run() -> list[Any]:
        workers = [threading.Thread(target=work) for _ in range(threads)]
        for worker in workers:
            worker.start()
        found = await _taken(watch, threads * each)
        for worker in workers:
            worker.join()
        return found

    assert [change.version for change in asyncio.run(run())] == list(range(start + 1, start + 1 + threads * each))


def test_a_watcher_whose_loop_is_closed_disturbs_nobody(kb) -> None:
    watch = kb.watch()
    loop = asyncio.new_event_loop()
    waiting = loop.create_task(_all(watch))
    loop.call_soon(loop.stop)
    loop.run_forever()
    loop.call_soon(waiting.cancel)
    loop.close()
    tell(kb, ("quiet",))
    watch.close()


@pytest.mark.parametrize(
    ("pattern", "limit", "message"),
    [
        ("(hevy ?o)", 1, "did you mean 'heavy'"),
        ("(on ?o)", 1, "takes 2 arguments"),
        ("(weight)", 1, "takes 1 argument"),
        ("(and (quiet))", 1, "a pattern is one predicate"),
        ("(quiet)", 0, "at least one change"),
    ],
)
def test_a_bad_pattern_is_refused(kb, pattern, limit, message) -> None:
    with pytest.raises(InputError, match=message):
        kb.watch(pattern, limit=limit)
