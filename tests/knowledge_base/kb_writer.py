"""A process that writes a store until it is killed, and says each version once it is acknowledged.

Run as `python kb_writer.py STORE DURABILITY`. What it commits at each version follows from the version alone,
so that whoever looks at the store afterwards knows what must be in it.
"""

from __future__ import annotations

import sys
from random import Random

from kb_strategies import SCHEMA

from knowledge_base import Delta, Fact, KnowledgeBase, fact
from knowledge_base.journal import journal

LONGEST = 300
"""The most things that one change adds: some are longer than a page of the file, most are not."""


def change(version: int) -> Delta:
    """The change that makes that version; it always changes something."""
    random = Random(version)  # noqa: S311
    count = random.choice([1, 1, 1, 3, LONGEST])
    cups = {f"cup-{version}-{n}": "cup" for n in range(count)}
    told = [fact("level", cup, version) for cup in cups]
    flip = {"added": (Fact("quiet"), *told)} if version % 2 else {"removed": (Fact("quiet"),), "added": tuple(told)}
    old = tuple(f"cup-{version - 20}-{n}" for n in range(LONGEST)) if version > 20 else ()  # the world stays small
    return Delta(nodes=cups, values={Fact("time"): version}, removed_nodes=old, **flip)


def write(path: str, durability: str) -> None:
    """Commit one version after the other, with snapshots and, now and then, compaction."""
    journal.SNAPSHOT_AFTER = 20_000
    with KnowledgeBase.open(SCHEMA, path, durability) as kb:
        print("open", flush=True)  # noqa: T201
        while True:
            version = kb.version + 1
            kb.apply(change(version), author="writer", key=str(version))
            print(version, flush=True)  # noqa: T201
            if version % 97 == 0:
                kb.compact(keep_since=version - 50)


if __name__ == "__main__":
    write(*sys.argv[1:])
