"""A process that writes a store until it is killed, and says each version once it is acknowledged.

What it commits at each version follows from the version alone,
so that whoever looks at the store afterwards knows what must be in it.
"""

from __future__ import annotations

from multiprocessing.connection import Connection
from random import Random

from knowledge_base import Delta, Fact, KnowledgeBase, Schema, fact
from knowledge_base.journal import journal
from knowledge_base.journal.file import Durability

SCHEMA = Schema.parse(
    "(define (domain d) (:types cup) (:predicates (quiet) (level ?c - cup ?n - number)) (:functions (time)))"
)
LONGEST = 100
"""The most things that one change adds: some are longer than a page of the file, most are not."""


def change(version: int) -> Delta:
    """The change that makes that version; it always changes something."""
    cups = cups_of(version)
    told = [fact("level", cup, version) for cup in cups]
    flip = {"added": (Fact("quiet"), *told)} if version % 2 else {"removed": (Fact("quiet"),), "added": tuple(told)}
    old = cups_of(version - 9)  # they are taken away, so that the world stays small
    return Delta(nodes=dict.fromkeys(cups, "cup"), values={Fact("time"): version}, removed_nodes=old, **flip)


def cups_of(version: int) -> tuple[str, ...]:
    """The things that come with a version."""
    count = Random(version).choice([1, 1, 1, 1, 1, 1, 3, LONGEST])  # noqa: S311
    return tuple(f"cup-{version}-{n}" for n in range(count))


def write(path: str, durability: Durability, acknowledge: Connection) -> None:
    """Commit one version after the other, with snapshots and, now and then, compaction; never return."""
    journal.SNAPSHOT_AFTER = 20_000
    with KnowledgeBase.open(SCHEMA, path, durability) as kb:
        acknowledge.send(kb.version)
        while True:
            version = kb.version + 1
            kb.apply(change(version), author="writer", key=str(version))
            acknowledge.send(version)
            if version % 97 == 0:
                kb.compact(keep_since=version - 50)


def write_on_demand(path: str, asked: Connection) -> None:
    """Commit as many versions as is asked for each time, and say the last one; until nobody asks any more."""
    with KnowledgeBase.open(SCHEMA, path) as kb:
        asked.send(kb.version)
        while count := asked.recv():
            for _ in range(count):
                kb.apply(change(kb.version + 1), author="writer")
            asked.send(kb.version)
