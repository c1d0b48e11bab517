"""The cost of an update with installed conditions, in memory and in a file, and of opening that file again."""

from __future__ import annotations

import gc
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from rows import ENGINE, FLOOR, Cell, Row, Target
from timing import Pace, measure, ratio

from knowledge.warehouse import Bare, Kept, Live
from knowledge_base import KnowledgeBase

JOURNALED, FSYNCED = "journaled", "fsynced"
NONE, SOME, SEEN, LIVE = "without", "with conditions", "with graph", "live"


@dataclass(frozen=True, slots=True)
class Sizes:
    """Sizes of the worlds."""

    many: int = 100_000
    conditions: tuple[int, ...] = (1000, 10_000)
    shapes: tuple[int, ...] = (5, 200)
    facts: tuple[int, ...] = (1000, 10_000, 100_000, 1_000_000)
    versions: int = 100_000
    openings: int = 7
    singly: int = 5000


def everyday_rows(pace: Pace, facts: int = 200, conditions: int = 30) -> list[Row]:
    """Return the rows of a typical small world, with and without conditions."""
    plain, watched, seen = Kept(facts), Kept(facts), Kept(facts)
    watched.install(watched.conditions(conditions, 5))
    assert seen.kb.graph
    jobs = {FLOOR: Bare(facts).job(), NONE: plain.job(), SOME: watched.job(), SEEN: seen.job()}
    figures = measure(jobs, pace)
    micros = {name: 1e6 * median(each) for name, each in figures.items()}
    floor = Cell(micros[FLOOR])

    def row(case: str, name: str, against: str) -> Row:
        compared = Cell(micros[name], ratio(figures, name, against), "" if against == FLOOR else against)
        return Row(f"update, {facts} facts, {case}", "µs", {FLOOR: floor, ENGINE: compared})

    return [
        row("no conditions", NONE, FLOOR),
        row(f"{conditions} conditions", SOME, NONE),
        row("somebody looks at the graph", SEEN, NONE),
    ]


def condition_rows(pace: Pace, sizes: Sizes) -> list[Row]:
    """Return the rows of updates with increasing numbers of conditions over many facts, kept in three ways."""
    with TemporaryDirectory() as folder:
        kept = {
            ENGINE: Kept(sizes.many),
            JOURNALED: Kept(sizes.many, Path(folder) / "process.kb", "process"),
            FSYNCED: Kept(sizes.many, Path(folder) / "power.kb", "power"),
        }
        bare = Bare(sizes.many)
        gc.freeze()
        rows = _updated(bare, kept, f"no conditions, {sizes.many:,} facts", pace, sizes, bounds=None)
        for number in sizes.conditions:
            for shapes in sizes.shapes:
                about = f"{number:,} conditions of {shapes} shapes"
                seconds = {name: each.install(each.conditions(number, shapes)) for name, each in kept.items()}
                least = number == sizes.conditions[0]
                installed = Row(f"install, {about}", "ms", {n: Cell(1000 * s) for n, s in seconds.items()})
                installed.targets.append(Target(" ms", 0.5, 1000 * seconds[ENGINE]))
                rows += [installed, *_updated(bare, kept, about, pace, sizes, bounds=(20, 40) if least else None)]
                for each in kept.values():
                    each.uninstall()
        gc.unfreeze()
        for each in kept.values():
            each.kb.close()
    return rows


def relation_rows(pace: Pace, sizes: Sizes, facts: int = 50) -> list[Row]:
    """Return the rows of a change in a live relation of a small world, and of the same change of facts."""
    bare, told, live = Bare(facts), Kept(facts), Live(facts)
    number, shapes = sizes.conditions[0], sizes.shapes[0]
    for each in (told, live):
        each.install(each.conditions(number, shapes))
    figures = measure({FLOOR: bare.job(), SOME: told.job(), LIVE: live.job()}, pace)
    floor = Cell(1e6 * median(figures[FLOOR]))
    about = f"{live.items} rows, {number:,} conditions of {shapes} shapes"
    rows = [
        Row(
            f"{change}, {about}",
            "µs",
            {FLOOR: floor, ENGINE: Cell(1e6 * median(figures[name]), ratio(figures, name, FLOOR))},
        )
        for change, name in (("change of facts", SOME), ("change of a live relation", LIVE))
    ]
    rows[-1].targets.append(Target("x facts", 2, ratio(figures, LIVE, SOME)))
    return rows


def size_rows(pace: Pace, sizes: Sizes) -> list[Row]:
    """Return the rows of updates without conditions over increasing numbers of facts."""
    rows: list[Row] = []
    for facts in sizes.facts:
        bare, kept = Bare(facts), Kept(facts)
        gc.freeze()
        figures = measure({FLOOR: bare.job(), ENGINE: kept.job()}, pace)
        gc.unfreeze()
        cells = {name: Cell(1e6 * median(each)) for name, each in figures.items()}
        cells[ENGINE] = Cell(cells[ENGINE].value, ratio(figures, ENGINE, FLOOR))
        rows.append(Row(f"update, {facts:,} facts", "µs", cells))
    growth = rows[-1].cells[ENGINE].value / rows[0].cells[ENGINE].value
    rows[-1].targets.append(Target(f"x {sizes.facts[0]:,} facts", 2, growth))
    return rows


def recovery_rows(sizes: Sizes) -> list[Row]:
    """Return the rows of opening stores with many versions, of a small and a large world, as after a crash."""
    return [_recovered(200, sizes), _recovered(sizes.many, sizes)]


def _recovered(facts: int, sizes: Sizes) -> Row:
    """Return the longest of several openings, which depend on the changes since the last snapshot."""
    seconds = []
    with TemporaryDirectory() as folder:
        path = Path(folder) / "many.kb"
        kept = Kept(facts, path, "process")
        for pause in range(1, sizes.openings + 1):
            for move in kept.moves(sizes.versions * pause // sizes.openings - kept.kb.version):
                kept.move(*move)
            before = kept.kb
            before.close()
            start = time.perf_counter()
            kept.kb = KnowledgeBase.open(None, path)
            seconds.append(time.perf_counter() - start)
            assert (kept.kb.version, kept.kb.facts()) == (before.version, before.facts())
        kept.kb.close()
    case = f"recovery of {sizes.versions:,} versions, {facts:,} facts"
    return Row(case, "s", {ENGINE: Cell(max(seconds))}, targets=[Target(" s", 5, max(seconds))])


def _updated(
    bare: Bare, kept: dict[str, Kept], about: str, pace: Pace, sizes: Sizes, bounds: tuple[float, float] | None
) -> list[Row]:
    jobs = {FLOOR: bare.job(), **{name: each.job() for name, each in kept.items()}}
    figures = measure(jobs, pace)
    cells = {
        name: Cell(1e6 * median(each), None if name == FLOOR else ratio(figures, name, FLOOR))
        for name, each in figures.items()
    }
    targets, late = [], []
    single = {name: kept[name].singly(sizes.singly) for name in (ENGINE, JOURNALED)}
    last = {name: Cell(1e6 * each[len(each) * 99 // 100]) for name, each in single.items()}
    if bounds is not None:
        targets = [
            Target(f"x floor, {name}", bound, cells[name].times)
            for name, bound in zip((ENGINE, JOURNALED), bounds, strict=True)
        ]
        late = [Target(f" µs, {name}", 1000, cell.value) for name, cell in last.items()]
    return [
        Row(f"update, {about}", "µs", cells, targets=targets),
        Row(f"half of the updates within, {about}", "µs", {n: Cell(1e6 * median(each)) for n, each in single.items()}),
        Row(f"99 of 100 updates within, {about}", "µs", last, targets=late),
    ]
