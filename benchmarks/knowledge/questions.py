"""The queries of all contenders, and the costs of inserting, changing and holding the facts."""

from __future__ import annotations

import gc
import time
from collections.abc import Callable, Mapping
from itertools import count, cycle, islice
from statistics import median
from typing import Any

from rows import ENGINE, FLOOR, Cell, Row, Target
from timing import Figures, Job, Pace, measure, ratio

from knowledge.arcs import HALL, Arcs
from knowledge.contender import Contender
from knowledge.footprint import bytes_a_fact

CASES: Mapping[str, tuple[str, Callable[[Arcs, int], tuple[str, ...]]]] = {  # case -> method, words for object n
    "point": ("point", lambda arcs, n: (f"i{n}", arcs.place(n + n % 2))),
    "pattern, 10 answers": ("pattern", lambda arcs, n: (arcs.place(n),)),
    "hub, by another kind of arc": ("rare", lambda _arcs, _n: (HALL,)),
    "hub, by the other argument": ("inside", lambda _arcs, n: (HALL, f"i{n}")),
    "2-join, 20 answers": ("join", lambda arcs, n: (arcs.place(n),)),
}
ASKED = 1000
UNITS = {"µs": 1e6, "ms": 1e3, "s": 1}


def question_rows(everyone: list[type[Contender]], size: int, pace: Pace) -> list[Row]:
    """Return one row for each case, all of them on worlds of that size."""
    arcs, about = Arcs(size), f"{size:,} objects"
    able = [kind for kind in everyone if kind.most >= size]
    worlds, seconds = _filled(able, arcs)
    gc.freeze()  # so that no contender pays for a collection of all worlds
    rows = [compared(f"insert, {about}", seconds)]
    for case, (method, words) in CASES.items():
        asked = [words(arcs, n) for n in islice((n * 7919 % size for n in count(1)), ASKED)]
        _agree(case, worlds.values(), method, asked)
        figures = measure({name: _asking(one, method, asked) for name, one in worlds.items()}, pace)
        rows.append(compared(f"{case}, {about}", figures, bound=3))
        if hasattr(worlds.get(ENGINE), f"{method}_by_text"):
            rows.append(_by_text(f"{case}, by its text, {about}", worlds[FLOOR], worlds[ENGINE], method, asked, pace))
    moves = measure({name: _moving(one, arcs) for name, one in worlds.items()}, pace)
    rows.append(compared(f"update, {about}", moves))
    gc.unfreeze()
    return [*rows, _footprints(able, size)]


def compared(case: str, figures: Figures, bound: float | None = None, unit: str = "µs") -> Row:
    """Return the row of all contenders with their ratios to the floor, and the engine's lead over the fastest peer."""
    cells = {
        name: Cell(UNITS[unit] * median(each), None if name == FLOOR else ratio(figures, name, FLOOR))
        for name, each in figures.items()
    }
    targets = [] if bound is None else [Target("x floor", bound, cells[ENGINE].times)]
    peers = [name for name in figures if name not in {FLOOR, ENGINE}]
    fastest = min(peers, key=lambda name: median(figures[name]))
    return Row(case, unit, cells, ratio(figures, fastest, ENGINE), fastest, targets)


def _by_text(case: str, floor: Contender, own: Contender, method: str, asked: list[tuple[str, ...]], pace: Pace) -> Row:
    """Return the row of a query given as text each time."""
    jobs = {FLOOR: _asking(floor, method, asked), ENGINE: _asking(own, f"{method}_by_text", asked)}
    figures = measure(jobs, pace)
    cells = {name: Cell(1e6 * median(each)) for name, each in figures.items()}
    cells[ENGINE] = Cell(cells[ENGINE].value, ratio(figures, ENGINE, FLOOR))
    return Row(case, "µs", cells)


def _filled(everyone: list[type[Contender]], arcs: Arcs) -> tuple[dict[str, Contender], Figures]:
    """Return all worlds, and their seconds for each fact."""
    worlds: dict[str, Contender] = {}
    seconds: Figures = {}
    for kind in everyone:
        worlds[kind.name] = one = kind()
        start = time.perf_counter()
        for things, batch in arcs.batches():
            one.insert(things, batch)
        seconds[kind.name] = [(time.perf_counter() - start) / (5 * arcs.size)]
    return worlds, seconds


def _asking(one: Contender, method: str, asked: list[tuple[str, ...]]) -> Job:
    ask, terms = getattr(one, method), [tuple(map(one.term, words)) for words in asked]

    def run(questions: list[tuple[Any, ...]]) -> None:
        for words in questions:
            ask(*words)

    return Job(run, prepare=lambda times: list(islice(cycle(terms), times)))


def _agree(case: str, worlds: Any, method: str, asked: list[tuple[str, ...]]) -> None:
    """Check that all contenders give the same answers, some of them not empty."""
    said = {one.name: [_plain(one, getattr(one, method)(*map(one.term, words))) for words in asked] for one in worlds}
    for name, answers in said.items():
        assert answers == said[FLOOR], (case, name)
        assert any(answers), case


def _plain(one: Contender, answers: Any) -> Any:
    if isinstance(answers, bool):
        return answers
    return sorted(sorted((variable, one.name_of(term)) for variable, term in each.items()) for each in answers)


def _moving(one: Contender, arcs: Arcs) -> Job:
    """Return a job in which each object moves to the next place, round by round."""
    steps = ((n, lap) for lap in count() for n in range(arcs.size))

    def moves(times: int) -> list[tuple[Any, ...]]:
        return [
            (one.term(f"i{n}"), one.term(arcs.place(n + lap)), one.term(arcs.place(n + lap + 1)))
            for n, lap in islice(steps, times)
        ]

    def run(moves: list[tuple[Any, ...]]) -> None:
        move = one.move
        for each in moves:
            move(*each)

    return Job(run, prepare=moves)


def _footprints(everyone: list[type[Contender]], size: int) -> Row:
    cells = {kind.name: Cell(held) for kind in everyone if (held := bytes_a_fact(kind.name, size)) is not None}
    own = cells.get(ENGINE)
    return Row(f"memory a fact, {size:,} objects", "bytes", cells, targets=[Target(" bytes", 1331, own and own.value)])
