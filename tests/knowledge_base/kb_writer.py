"""A process that writes a store until it is killed, and says each version once it is acknowledged.

What it commits at each version follows from the version alone,
so that whoever looks at the store afterwards knows what must be in it.
"""

from __future__ import annotations

from multiprocessing.connection import Connection
from random import Random

from knowledge_base import Delta, Fact, KnowledgeBase, Schema, fact
from knowledge_base.journal import journal

SCHEMA = Schema.parse(
    "(define (domain d) (:types cup) (:predicates (quiet) (level ?c - cup ?n - number)) (:functions (time)))"
)
LONGEST = 100
"""The most things that one change adds: some are longer than a page of the file, most are not."""


def change(version: int) -> Delta:
    """The change that makes that version; it always changes something."""
    random = Random(version)  # noqa: S311
    count = random.choice([1, 1, 1, 3, LONGEST])
    cups = {f"cup-{version}-{n}": "cup" for n in range(count)}
    told = [fact("level", cup, version) for cup in cups]
    flip = {"added": (Fact("quiet"), *told)} if version % 2 else {"removed": (Fact("quiet"),), "added": tuple(told)}
    old = tuple(f"cup-{version - 9}-{n}" for n in range(LONGEST))  # so the world stays small
    return Delta(nodes=cups, values={Fact("time"): version}, removed_nodes=old, **flip)


def write(path: str, durability: str, acknowledge: Connection) -> None:
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
