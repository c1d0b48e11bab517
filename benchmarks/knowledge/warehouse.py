"""Worlds with moving objects and installed conditions, for this knowledge base and the floor."""

from __future__ import annotations

import time
from collections.abc import Iterator
from itertools import islice
from pathlib import Path

from timing import Job

from knowledge.floor import Index
from knowledge_base import Condition, Delta, Fact, KnowledgeBase, Schema, declare_relations, fact

KINDS = 40
SCHEMA = Schema.parse(
    f"""(define (domain warehouse)
    (:types item place - object)
    (:predicates (on ?i - item ?p - place) (clean ?i - item) (in ?p ?q - place)
      {" ".join(f"(kind{n} ?i - item)" for n in range(KINDS))})
    (:functions (weight ?i - item)))"""
)
SHAPES = (
    "(and (on ?x p{0}) (kind{1} ?x))",
    "(and (on i{0} p{0}) (kind{1} i{0}))",
    "(and (on ?x p{0}) (clean ?x) (not (kind{1} ?x)))",
    "(and (on ?x ?p) (in ?p p{0}) (kind{1} ?x) (> (weight ?x) 5))",
    "(not (exists (?x - item) (and (on ?x p{0}) (kind{1} ?x))))",
)
"""Conditions on the predicate that all updates change. 0 is replaced by a number, 1 by a kind."""

Move = tuple[str, str, str]
"""An item, its place, its next place."""


class Warehouse:
    """A world of about `facts` facts: places of items, items that are clean or of a kind, places in places.

    Its items move to their next places, one after the other in leaps.
    """

    def __init__(self, facts: int) -> None:
        self.places = max(20, facts // 50)
        self.items = max(1, (facts - self.places) * 2 // 3)
        self._moves = self._endless()

    def deltas(self) -> Iterator[Delta]:
        """Yield the world in parts, each after the objects that it needs."""
        places = range(self.places)
        inside = tuple(fact("in", f"p{n}", f"p{n // 10}") for n in places)
        yield Delta({f"p{n}": "place" for n in places}, added=inside)
        for first in range(0, self.items, 1000):
            numbers = range(first, min(first + 1000, self.items))
            on = [fact("on", f"i{n}", f"p{n % self.places}") for n in numbers]
            are = [fact("clean" if n % 4 == 1 else f"kind{n % KINDS}", f"i{n}") for n in numbers if n % 2]
            heavy: dict[Fact, float] = {fact("weight", f"i{n}"): 7 for n in numbers if n % 4 == 3}
            yield Delta(dict.fromkeys((f"i{n}" for n in numbers), "item"), added=(*on, *are), values=heavy)

    def moves(self, number: int) -> list[Move]:
        """Return the next moves."""
        return list(islice(self._moves, number))

    def _endless(self) -> Iterator[Move]:
        at = [n % self.places for n in range(self.items)]
        item = 0
        while True:
            item = (item + 7919) % self.items
            old, at[item] = at[item], (at[item] + 1) % self.places
            yield f"i{item}", f"p{old}", f"p{at[item]}"


class Bare(Warehouse):
    """The floor: its index, updated by hand."""

    def __init__(self, facts: int) -> None:
        super().__init__(facts)
        self.index = Index()
        for delta in self.deltas():
            for one in delta.added:
                self.index.add(one.predicate, one.args)

    def job(self) -> Job:
        """Return the job of updates."""

        def run(moves: list[Move]) -> None:
            discard, add = self.index.discard, self.index.add
            for item, old, new in moves:
                discard("on", (item, old))
                add("on", (item, new))

        return Job(run, prepare=self.moves)


class Kept(Warehouse):
    """A knowledge base, in a file if `path` is given."""

    def __init__(self, facts: int, path: Path | None = None, durability: str | None = None) -> None:
        super().__init__(facts)
        self.kb = KnowledgeBase.open(SCHEMA, path, durability)
        self.installed: list[Condition] = []
        for delta in self.deltas():
            self.kb.apply(delta, "start")

    def move(self, item: str, old: str, new: str) -> None:
        """Apply one update."""
        self.kb.apply(Delta(removed=(fact("on", item, old),), added=(fact("on", item, new),)), "bench")

    def job(self) -> Job:
        """Return the job of updates."""

        def run(moves: list[Move]) -> None:
            move = self.move
            for each in moves:
                move(*each)

        return Job(run, prepare=self.moves)

    def singly(self, number: int) -> list[float]:
        """Return the seconds of each of a number of updates, shortest first."""
        found = []
        for each in self.moves(number):
            start = time.perf_counter()
            self.move(*each)
            found.append(time.perf_counter() - start)
        return sorted(found)

    def install(self, texts: list[str]) -> float:
        """Install the conditions; return the seconds for each."""
        start = time.perf_counter()
        self.installed = [self.kb.install(text) for text in texts]
        return (time.perf_counter() - start) / len(self.installed)

    def uninstall(self) -> None:
        """Cancel the installed conditions."""
        for condition in self.installed:
            condition.cancel()

    def conditions(self, number: int, shapes: int) -> list[str]:
        """Return a number of conditions with that number of shapes, spread over the places."""
        return [
            SHAPES[n % len(SHAPES)].format(self._somewhere(n // shapes + n % shapes * 10), n % shapes // len(SHAPES))
            for n in range(number)
        ]

    def _somewhere(self, n: int) -> int:
        return n * 7919 % min(self.places, self.items)


class Live(Kept):
    """A knowledge base whose program provides the places of the items as a live relation."""

    def __init__(self, facts: int) -> None:
        super().__init__(facts)
        self.at = {f"i{n}": f"p{n % self.places}" for n in range(self.items)}
        declare_relations({"bench:on": "item place"})
        self.kb.provide({"bench:on": self.at.items})

    def move(self, item: str, old: str, new: str) -> None:  # noqa: ARG002  the program knows the old place
        """Change one row, and evaluate the conditions."""
        self.at[item] = new
        self.kb.renew_relations("bench:on")

    def conditions(self, number: int, shapes: int) -> list[str]:
        """Return the conditions of `Kept`, on the live relation."""
        return [text.replace("(on ", "(bench:on ") for text in super().conditions(number, shapes)]
