"""What a store's file consists of, and how it comes into being: as a whole or not at all, whenever its maker dies.

`changes` is the journal, one row a version. `snapshots` are whole worlds, the oldest of which is where the
journal begins. `keys` leads from idempotency keys to changes; its own `delta` is null while the change is in
the journal. `schemas` are the declarations used; `version` is the first change made with them. JSON as in
`exchange.forms`. Changes, schemas and keys are chains of digests (`integrity`), which `ends` ends.

A change's digest depends on the change before it and on the schema it was made with. The first one follows the
`head` of the first snapshot, which is random: rows of one store never fit another. A later snapshot's `head` is the
digest of the change that made its version. A key's digest depends on the key before it and on its change's digest,
for which `context` has what that depends on.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from knowledge_base.errors import Place, StoreError
from knowledge_base.journal.file import APPLICATION_ID, FORMAT, Durability, reported
from knowledge_base.journal.integrity import ENDS
from knowledge_base.journal.neighbours import store_owning
from knowledge_base.journal.placing import new_database

TABLES = {
    "schemas": """CREATE TABLE schemas (version INTEGER NOT NULL, hash TEXT NOT NULL, declarations TEXT NOT NULL,
        digest BLOB NOT NULL)""",
    "changes": """CREATE TABLE changes (version INTEGER PRIMARY KEY, time REAL NOT NULL, author TEXT NOT NULL,
        delta TEXT NOT NULL, digest BLOB NOT NULL)""",
    "snapshots": """CREATE TABLE snapshots (version INTEGER PRIMARY KEY, time REAL NOT NULL, world TEXT NOT NULL,
        head BLOB NOT NULL, digest BLOB NOT NULL)""",
    "keys": """CREATE TABLE keys (number INTEGER PRIMARY KEY, key TEXT NOT NULL UNIQUE, version INTEGER NOT NULL,
        time REAL NOT NULL, author TEXT NOT NULL, delta TEXT, context BLOB NOT NULL, digest BLOB NOT NULL)""",
    "ends": ENDS,
}


@contextmanager
def making(path: Path, durability: Durability) -> Iterator[sqlite3.Connection]:
    """A connection to a new store with empty tables, which has its name when the block is left.

    Until then it is in memory. To be used by who has the right to write, where nothing is.

    Raises:
        StoreError: it cannot be made; nothing is there then.
    """
    owner = store_owning(path)
    if owner not in (None, path):
        said = f"'{path.name}' is a name that the store '{owner}' has for a file of its own"
        raise StoreError(said, place=Place(str(path)))
    try:
        with (
            reported(path, "make"),
            new_database(path, APPLICATION_ID, FORMAT, lasting=durability == "power") as connection,
        ):
            for statement in TABLES.values():
                connection.execute(statement)
            yield connection
    except FileExistsError:
        said = f"'{path.name}' is there already; a new store takes the place of no file"
        raise StoreError(said, place=Place(str(path))) from None
    except OSError as error:
        raise StoreError(f"cannot make the store '{path}': {error.strerror}") from error
