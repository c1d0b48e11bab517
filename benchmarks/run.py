"""The cost of a run around the engine: a macrostep, its store, and many concurrent plots; see docs/speed.md.

`python benchmarks/run.py [--quick] [--json] [--write] [--folder F] [--plots N] [--seconds S]`: a moment for each, plain
data for programs, or the tables for docs/speed.md. Files are made in F; the speed of its disk matters.
"""

from __future__ import annotations

import argparse
import json
import platform
import sqlite3
import statistics
import tempfile
from pathlib import Path

import page
from rows import Cell, Row, Target, table
from run_jobs import ANSWER, CASES, DURABILITIES, ENGINE, HOP, NO_STORE, ONE, Bench, bare
from run_plots import fleets, plots_table
from timing import Figures, Pace, measure

FULL, QUICK = Pace(rounds=9, seconds=0.3), Pace(rounds=1, seconds=0.01)
MOST = {"process": 5.0, "power": 1.3}
"""Maximum ratio of a macrostep's store to a bare commit."""
COLUMNS = [ENGINE, HOP, NO_STORE, *[name for one in DURABILITIES for name in (one, bare(one))]]


def row(case: str, figures: Figures) -> Row:
    """Return a case, in microseconds; the store's cell has only its own share."""
    if case == ONE:  # one of the two hops is the way back to the benchmark
        figures = figures | {name: _less(figures[name], figures[HOP]) for name in (NO_STORE, *DURABILITIES)}
    cells = {name: Cell(1e6 * statistics.median(rounds)) for name, rounds in figures.items()}
    cells[NO_STORE] = Cell(cells[NO_STORE].value, _times(figures[NO_STORE], figures[HOP]), HOP)
    targets = [Target(f"x {HOP}", 3.0, cells[NO_STORE].times)]
    for one in DURABILITIES:
        share = _times(_less(figures[one], figures[NO_STORE]), figures[bare(one)])
        cells[one] = Cell(cells[one].value, share, "its commit")
        targets.append(Target(f"x its commit, {one}", MOST[one], share))
    around = _times(figures[NO_STORE], figures[ENGINE])
    return Row(f"{case}, {around:.1f}x the engine", "µs", cells, targets=targets)


def answers_a_second(measured: Row) -> Row:
    """Return the reciprocal: answers per second."""
    cells = {name: Cell(1e6 / measured.cells[name].value) for name in (NO_STORE, *DURABILITIES)}
    return Row("answers that lead to the next skill", "1/s", cells)


def _less(figures: list[float], others: list[float]) -> list[float]:
    return [one - other for one, other in zip(figures, others, strict=True)]


def _times(figures: list[float], others: list[float]) -> float:
    return statistics.median(one / other for one, other in zip(figures, others, strict=True))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a moment for each, to see that it works")
    parser.add_argument("--json", action="store_true", help="plain data")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/speed.md")
    parser.add_argument("--folder", type=Path, default=Path(), help="where files are made: the disk matters")
    parser.add_argument("--plots", type=int, help="how many at once")
    parser.add_argument("--seconds", type=float, help="how long they run")
    options = parser.parse_args()
    pace = QUICK if options.quick else FULL
    count, seconds = options.plots or (10 if options.quick else 1000), options.seconds or (2 if options.quick else 60)
    with tempfile.TemporaryDirectory(dir=options.folder) as folder:
        bench = Bench(Path(folder))
        rows = [row(case, measure(bench.jobs(case), pace)) for case in CASES]
        rows.append(answers_a_second(rows[CASES.index(ANSWER)]))
        many = fleets(Path(folder), count, seconds)
    if options.json:
        print(json.dumps({"rows": [one.to_json() for one in rows], "plots": [one.to_json() for one in many]}))
        return
    said = f"Measured with Python {platform.python_version()}, SQLite {sqlite3.sqlite_version}; {pace.rounds} rounds; "
    text = f"{table(rows, COLUMNS)}\n\n{plots_table(many)}\n\n{said}{count} plots for {seconds:g} s."
    print(text)
    if options.write:
        page.put(text, "run")


if __name__ == "__main__":
    main()
