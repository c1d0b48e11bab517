"""The cost of knowledge: a hand-written index, this knowledge base and its peers, in one run; see docs/speed.md.

`python benchmarks/kb.py [--quick] [--json] [--write]`: tiny worlds and one short round, plain data for programs, or the
table for docs/speed.md. Peers that are not installed are skipped; `make bench-kb` installs them.
"""

import argparse
import json
import platform
import sqlite3

import page
from knowledge import contenders
from knowledge.contender import Contender
from knowledge.questions import question_rows
from knowledge.updates import (
    FSYNCED,
    JOURNALED,
    Sizes,
    condition_rows,
    everyday_rows,
    recovery_rows,
    relation_rows,
    size_rows,
)
from rows import ENGINE, Row, table
from timing import Pace

FULL, QUICK = Pace(rounds=9, seconds=0.02), Pace(rounds=1, seconds=0.001)
TINY = Sizes(many=300, conditions=(20, 40), facts=(300, 600), versions=70, singly=20)


def rows_of(everyone: list[type[Contender]], *, quick: bool) -> list[Row]:
    """Return the rows of all cases, the common one first."""
    pace, sizes = (QUICK, TINY) if quick else (FULL, Sizes())
    asked = [row for size in ((100,) if quick else (10_000, 100_000)) for row in question_rows(everyone, size, pace)]
    watched = condition_rows(pace, sizes)
    live = relation_rows(pace, sizes)
    return [*everyday_rows(pace), *asked, *watched, *live, *size_rows(pace, sizes), *recovery_rows(sizes)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="tiny worlds, one short round: does it work at all?")
    parser.add_argument("--json", action="store_true", help="plain data")
    parser.add_argument("--write", action="store_true", help="put the table into docs/speed.md")
    options = parser.parse_args()
    everyone = contenders()
    rows = rows_of(everyone, quick=options.quick)
    packages = {one.package: one.version() for one in everyone if one.package}
    versions = {"Python": platform.python_version(), **packages, "SQLite": sqlite3.sqlite_version}
    if options.json:
        print(json.dumps({"versions": versions, "rows": [row.to_json() for row in rows]}))
        return
    names = [kind.name for kind in everyone]
    after = names.index(ENGINE) + 1
    said = ", ".join(f"{name} {version}" for name, version in versions.items())
    text = f"{table(rows, [*names[:after], JOURNALED, FSYNCED, *names[after:]])}\n\nMeasured with {said}."
    print(text)
    if options.write:
        page.put(text, "knowledge")


if __name__ == "__main__":
    main()
