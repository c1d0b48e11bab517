"""What an update costs with conditions installed, next to a dict-of-sets index that is updated by hand.

    python benchmarks/conditions.py [--facts 200 --facts 100000]

Conditions are of five shapes; every update moves one thing from one place to another.
"""

from __future__ import annotations

import argparse
import statistics
import time
from collections import defaultdict

from knowledge_base import Delta, KnowledgeBase, Schema, fact

SCHEMA = Schema.parse(
    """(define (domain store)
  (:types item place - object cup - item)
  (:predicates (on ?i - item ?p - place) (clean ?i - item) (in ?p ?q - place))
  (:functions (weight ?i - item)))"""
)
SHAPES = (
    "(on ?x p{0})",
    "(on i{0} p{0})",
    "(and (on ?x p{0}) (clean ?x))",
    "(and (on ?x ?p) (in ?p p{0}) (> (weight ?x) 5))",
    "(and (place p{0}) (not (exists (?x - item) (on ?x p{0}))))",
)
INSTALLED = (0, 30, 1000, 10_000)
ROUNDS, UPDATES = 5, 2000


class Index:
    """The floor: facts in a set, and by each argument."""

    def __init__(self) -> None:
        self.facts: dict[str, set[tuple[str, ...]]] = defaultdict(set)
        self.by_argument: dict[tuple[str, int, str], set[tuple[str, ...]]] = defaultdict(set)

    def move(self, item: str, old: str, new: str) -> None:
        gone, come = (item, old), (item, new)
        self.facts["on"].discard(gone)
        self.facts["on"].add(come)
        for i, value in enumerate(gone):
            self.by_argument["on", i, value].discard(gone)
        for i, value in enumerate(come):
            self.by_argument["on", i, value].add(come)


class World:
    """A knowledge base whose every thing lies somewhere, and moves on with each update."""

    def __init__(self, facts: int, conditions: int) -> None:
        places = max(20, facts // 50, conditions // len(SHAPES))
        self.places = [f"p{i}" for i in range(places)]
        self.at = {f"i{i}": i % places for i in range(max(facts, places))}
        self.moves = 0
        self.kb = KnowledgeBase(SCHEMA)
        self.kb.apply(Delta(nodes={**dict.fromkeys(self.at, "cup"), **dict.fromkeys(self.places, "place")}), "start")
        on = tuple(fact("on", item, self.places[at]) for item, at in self.at.items())
        rooms = tuple(fact("in", p, self.places[i // 10]) for i, p in enumerate(self.places))
        self.items = list(self.at)
        clean, heavy = self.items[::3], self.items[::4]
        self.kb.apply(
            Delta(
                added=(*on, *rooms, *(fact("clean", item) for item in clean)),
                values={fact("weight", item): 7 for item in heavy},
            ),
            "start",
        )
        self.index = Index()
        start = time.thread_time()
        for number in range(conditions):
            self.kb.install(SHAPES[number % len(SHAPES)].format(number // len(SHAPES)))
        self.install_ms = 1000 * (time.thread_time() - start) / max(1, conditions)

    def next_moves(self, count: int) -> list[tuple[str, str, str]]:
        found = []
        for _ in range(count):
            item = self.items[self.moves * 7919 % len(self.items)]
            old, self.moves = self.at[item], self.moves + 1
            self.at[item] = new = (old + 1 + self.moves % 7) % len(self.places)
            found.append((item, self.places[old], self.places[new]))
        return found


def update(world: World) -> tuple[float, float]:
    """CPU seconds for one update: of the knowledge base, of the bare index."""
    moves = world.next_moves(UPDATES)
    start = time.thread_time()
    for item, old, new in moves:
        world.kb.apply(Delta(removed=(fact("on", item, old),), added=(fact("on", item, new),)), "bench")
    middle = time.thread_time()
    for item, old, new in moves:
        world.index.move(item, old, new)
    end = time.thread_time()
    return (middle - start) / UPDATES, (end - middle) / UPDATES


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--facts", type=int, action="append")
    print("| facts | conditions | install, ms | update, us | bare index, us | ratio |")
    print("|-------|------------|-------------|------------|----------------|-------|")
    for facts in parser.parse_args().facts or [200, 100_000]:
        for conditions in INSTALLED:
            world = World(facts, conditions)
            rounds = [update(world) for _ in range(ROUNDS)]
            mine, bare = (1e6 * statistics.median(column) for column in zip(*rounds, strict=True))
            ratio = statistics.median(a / b for a, b in rounds)
            print(
                f"| {facts:6} | {conditions:6} | {world.install_ms:6.3f} | {mine:6.1f} | {bare:5.2f} | {ratio:5.1f} |"
            )


if __name__ == "__main__":
    main()
