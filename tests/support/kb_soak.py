"""Four threads and an event loop that change, ask and watch one knowledge base at once, and what must be true of it.

Each thread moves its own token, counts its own commits and the total; what it reads in a transaction it may rely on.
Others ask questions that are true at every version, watch all changes, watch too slowly, wait for a condition,
and answer changes with changes of their own.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from random import Random

from knowledge_base import Change, Delta, Firing, KnowledgeBase, Missed, Schema, fact
from knowledge_base.world.state import WorldState

WORKERS = tuple(f"w{n}" for n in range(4))
CELLS = tuple(f"c{n}" for n in range(5))
SCHEMA = Schema.parse(
    """(define (domain soak) (:types worker cell thing)
  (:predicates (at ?w - worker ?c - cell) (left ?w - worker ?t - thing))
  (:functions (count ?w - worker) (total) (answers)))"""
)
INVARIANT = (
    "(and (= (total) (+ (+ (count w0) (count w1)) (+ (count w2) (count w3))))"
    " (forall (?w - worker) (exists (?c - cell) (and (at ?w ?c)"
    " (forall (?d - cell) (imply (at ?w ?d) (= ?c ?d)))))))"
)
"""No commit is seen in part, and none is lost."""
MEETING = "(and (at ?a ?c) (at ?b ?c) (!= ?a ?b))"


class UndoneError(Exception):
    """A transaction that shall leave nothing behind."""


@dataclass
class Soak:
    """One run: everybody works until `resuming` says no.

    Attributes:
        kb: what is shared.
        resuming: asked by each thread before each commit, with the number of its commits so far.
        acknowledged: commits that returned, by thread.
        failures: what was not as it must be.
    """

    kb: KnowledgeBase
    resuming: Callable[[int], bool]
    acknowledged: dict[str, int] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)
    heard: list[Change] = field(default_factory=list)
    firings: list[Firing] = field(default_factory=list)
    questions: int = 0
    waited: int = 0
    missed: int = 0

    @property
    def working(self) -> bool:
        """Whether a thread still commits."""
        return len(self.acknowledged) < len(WORKERS)

    def run(self, limit_s: float) -> None:
        """Work to the end.

        Raises:
            TimeoutError: somebody waits for ever.
        """
        nodes = {**dict.fromkeys(WORKERS, "worker"), **dict.fromkeys(CELLS, "cell")}
        self.kb.apply(Delta(nodes=nodes, added=tuple(fact("at", w, CELLS[0]) for w in WORKERS)), "start")
        self.kb.subscribe(self.heard.append)
        self.kb.subscribe(self._answer)
        met = self.kb.install(MEETING, fire="each")
        met.subscribe(self.firings.append, falls=True)
        threads = [threading.Thread(target=self._work, args=(worker,), daemon=True) for worker in WORKERS]
        asyncio.run(asyncio.wait_for(self._loop(threads), limit_s))
        self._judge(met.truth)

    async def _loop(self, threads: list[threading.Thread]) -> None:
        ready = [asyncio.Event() for _ in range(2)]
        watchers = [asyncio.create_task(self._watch(ready[0], 1_000_000, 0.0)),
                    asyncio.create_task(self._watch(ready[1], 20, 0.002))]  # fmt: skip
        for event in ready:
            await event.wait()
        waiter = asyncio.create_task(self._wait())
        for thread in threads:
            thread.start()
        while self.working:
            self._ask(self.kb)
            await asyncio.sleep(0)
        for thread in threads:
            await asyncio.to_thread(thread.join)
        await self._flush(watchers)
        waiter.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await waiter

    async def _flush(self, watchers: list[asyncio.Task[None]]) -> None:
        """A last change that everybody who watches must come to hear of."""
        await asyncio.to_thread(self.kb.apply, Delta(nodes={"end": "thing"}), "end")
        await asyncio.gather(*watchers)

    def _work(self, worker: str) -> None:
        random, commits = Random(worker), 0
        try:
            while self.resuming(commits):
                commits += self._commit(worker, commits, random)
                self._ask(self.kb)
        except Exception as error:  # noqa: BLE001  said at the end
            self.failures.append(f"{worker}: {error!r}")
        finally:
            self.acknowledged[worker] = commits

    def _commit(self, worker: str, commits: int, random: Random) -> int:
        undone = random.random() < 0.1
        with contextlib.suppress(UndoneError), self.kb.transaction(author=worker) as tx:
            (here,) = tx.query("(at ?w ?c)", {"w": worker})
            counted = [self._number("count", worker), self._number("total")]
            if counted[0] != commits:
                self.failures.append(f"{worker} reads {counted[0]} commits of its own after {commits}")
            tx.retract("at", worker, here["c"])
            tx.tell("at", worker, random.choice([c for c in CELLS if c != here["c"]]))
            tx.set("count", worker, counted[0] + 1)
            tx.set("total", counted[1] + 1)
            thing = f"{worker}-{commits}"
            tx.add_node(thing, "thing")
            tx.tell("left", worker, thing)
            if commits > 20:
                tx.remove_node(f"{worker}-{commits - 20}")
            if undone:
                raise UndoneError
            return 1
        return 0

    def _ask(self, kb: KnowledgeBase) -> None:
        self.questions += 1
        if not kb.ask(INVARIANT):
            self.failures.append(f"at version {kb.version}: {kb.explain(INVARIANT).deciding}")

    def _number(self, name: str, *things: str) -> int:
        found = self.kb.value(name, things)
        assert isinstance(found, int | float)
        return int(found)

    def _answer(self, change: Change) -> None:
        """A listener that commits: every fiftieth change is answered."""
        if change.author != "answer" and change.version % 50 == 0:
            with self.kb.transaction(author="answer") as tx:
                tx.set("answers", self._number("answers") + 1)

    async def _watch(self, ready: asyncio.Event, limit: int, pause_s: float) -> None:
        with self.kb.watch(limit=limit) as changes:
            version = self.kb.version
            ready.set()
            async for item in changes:
                if isinstance(item, Missed):
                    self.missed += 1
                    if item.since != version or item.until <= item.since:
                        self.failures.append(f"missed {item} after version {version}")
                    version = item.until
                else:
                    if item.version != version + 1:
                        self.failures.append(f"version {item.version} was told after {version}")
                    version = item.version
                if not self.working and self.kb.type_of("end") and version == self.kb.version:
                    return
                if pause_s:
                    await asyncio.sleep(pause_s)

    async def _wait(self) -> None:
        """Waits for firings; each is later than the one before."""
        with self.kb.install("(exists (?w - worker) (at ?w c4))") as condition:
            last = 0
            while True:
                firing = await condition.wait(after=last)
                if firing.number <= last:
                    self.failures.append(f"firing {firing.number} was told after {last}")
                last, self.waited = firing.number, self.waited + 1

    def _judge(self, met: bool) -> None:
        kb, versions = self.kb, [change.version for change in self.heard]
        total = sum(self.acknowledged.values())
        answers = sum(change.author == "answer" for change in self.heard)
        for truth, what in (
            (versions == list(range(2, kb.version + 1)), "a listener missed a version, or heard them out of order"),
            (kb.value("total", ()) == total, f"{total} commits were acknowledged, {kb.value('total', ())} counted"),
            (kb.version == 1 + total + answers + 1, "there are other versions than acknowledged commits"),
            (kb.value("answers", ()) == answers, "an answer of a listener was lost"),
            (met == bool(kb.query(MEETING)), "the installed condition is not what asking says"),
            (self._told_in_order(), "firings came out of order"),
        ):
            if not truth:
                self.failures.append(what)
        for change, told in zip(kb.changes(since=kb.oldest)[::-1], self.heard[::-1], strict=False):
            if change != told:
                self.failures.append(f"the history of version {change.version} is not what was announced")

    def _told_in_order(self) -> bool:
        order = [(firing.version, firing.number) for firing in self.firings]
        return order == sorted(order)


def replayed(kb: KnowledgeBase) -> WorldState:
    """The world that the changes kept in the file lead to."""
    state = WorldState(kb.schema)
    for change in kb.changes():
        state.commit(change.delta)
    return state


def soak(path: Path | None, resuming: Callable[[int], bool], limit_s: float) -> Soak:
    """A run on a store (`None`: in memory); its failures are for the caller to look at."""
    with KnowledgeBase.open(SCHEMA, path) as kb:
        done = Soak(kb, resuming)
        done.run(limit_s)
        if path is not None:
            state = replayed(kb)
            if (dict(state.nodes), set(state.facts), dict(state.values)) != (kb.nodes(), set(kb.facts()), kb.values()):
                done.failures.append("the journal leads to another world")
    return done


def _is_before(end: float, _: int) -> bool:
    return time.monotonic() < end


def main(seconds: float) -> int:
    """Soak in memory and on a file, half of the time each; prints what happened."""
    from tempfile import TemporaryDirectory

    status = 0
    with TemporaryDirectory() as folder:
        for path in (None, Path(folder) / "world.kb"):
            end = time.monotonic() + seconds / 2
            done = soak(path, partial(_is_before, end), seconds + 60)
            kind = "in memory" if path is None else "journaled"
            print(
                f"{kind}: {sum(done.acknowledged.values())} commits of {len(done.acknowledged)} threads, "
                f"{done.questions} questions, {len(done.firings)} firings, {done.waited} waited for, "
                f"{done.missed} times too slow and told so, {len(done.failures)} failures"
            )
            for failure in done.failures[:20]:
                print(f"  {failure}")
            status = status or bool(done.failures)
    return status


if __name__ == "__main__":
    import sys

    sys.exit(main(float(sys.argv[1]) if len(sys.argv) > 1 else 30.0))
