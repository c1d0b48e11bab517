"""The cost of an event: a hand-written table, this engine and its peers, in one run; see docs/speed.md.

`python benchmarks/engine.py [--quick] [--json] [--write]`: one quick round, plain data for programs, or the table for
docs/speed.md. Peers that are not installed are skipped; `make bench-engine` installs them.
"""

import argparse
import json
import logging
import platform

import page
from common import common_rows
from own import own_rows
from peers import contenders
from rows import table
from timing import Pace

FULL, QUICK = Pace(rounds=15, seconds=0.02), Pace(rounds=1, seconds=0.002)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one short round: does it work at all?")
    parser.add_argument("--json", action="store_true", help="plain data")
    parser.add_argument("--write", action="store_true", help="put the table into docs/speed.md")
    options = parser.parse_args()
    logging.disable(logging.CRITICAL)  # a log call costs a peer more than its own work
    pace = QUICK if options.quick else FULL
    everyone = contenders()
    rows = [*common_rows(everyone, pace), *own_rows(pace)]
    versions = {"Python": platform.python_version(), **{one.package: one.version for one in everyone if one.package}}
    if options.json:
        print(json.dumps({"versions": versions, "rounds": pace.rounds, "rows": [row.to_json() for row in rows]}))
        return
    said = ", ".join(f"{name} {version}" for name, version in versions.items())
    text = f"{table(rows, [one.name for one in everyone])}\n\nMeasured with {said}; {pace.rounds} rounds."
    print(text)
    if options.write:
        page.put(text, "engine")


if __name__ == "__main__":
    main()
