"""What an update costs with conditions installed, in memory and in a file, and what it takes to open that again."""

from __future__ import annotations

import gc
import time
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from rows import ENGINE, FLOOR, Cell, Row, Target
from timing import Pace, measure, ratio

from knowledge.warehouse import Bare, Kept
from knowledge_base import KnowledgeBase

JOURNALED, FSYNCED = "journaled", "fsynced"
NONE = "without"


@dataclass(frozen=True, slots=True)
class Sizes:
    """How large the worlds are."""

    many: int = 100_000
    conditions: tuple[int, ...] = (1000, 10_000)
    shapes: tuple[int, ...] = (5, 200)
    facts: tuple[int, ...] = (1000, 10_000, 100_000, 1_000_000)
    versions: int = 100_000
    singly: int = 5000


def everyday_rows(pace: Pace, facts: int = 200, conditions: int = 30) -> list[Row]:
    """A small world as most are, with conditions and without."""
    plain, watched = Kept(facts), Kept(facts)
    watched.install(watched.conditions(conditions, 5))
    figures = measure({FLOOR: Bare(facts).job(), NONE: plain.job(), ENGINE: watched.job()}, pace)
    micros = {name: 1e6 * median(each) for name, each in figures.items()}
    floor = Cell(micros[FLOOR])
    without = Cell(micros[NONE], ratio(figures, NONE, FLOOR))
    those = Cell(micros[ENGINE], ratio(figures, ENGINE, NONE), NONE)
    return [
        Row(f"update, {facts} facts, no conditions", "µs", {FLOOR: floor, ENGINE: without}),
        Row(f"update, {facts} facts, {conditions} conditions", "µs", {FLOOR: floor, ENGINE: those}),
    ]


def condition_rows(pace: Pace, sizes: Sizes) -> list[Row]:
    """Updates with more and more conditions over many facts, kept in three ways."""
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


def size_rows(pace: Pace, sizes: Sizes) -> list[Row]:
    """Updates without conditions over more and more facts."""
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


def recovery_row(sizes: Sizes) -> Row:
    """A store of many versions is opened as after a crash: what it holds is read and made a world."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "many.kb"
        kept = Kept(200, path, "process")
        for move in kept.moves(sizes.versions):
            kept.move(*move)
        versions = kept.kb.version
        kept.kb.close()
        start = time.perf_counter()
        with KnowledgeBase.open(None, path) as again:
            seconds = time.perf_counter() - start
            assert (again.version, again.facts()) == (versions, kept.kb.facts())
    targets = [Target(" s", 5, seconds)]
    return Row(f"recovery of {sizes.versions:,} versions", "s", {ENGINE: Cell(seconds)}, targets=targets)


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
