"""Cases that this engine and its peers share."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable, Sequence
from statistics import median
from typing import Any

from peers.charts import PING, Chart, deep, flat, regions, ring
from peers.contender import Contender
from rows import ENGINE, FLOOR, Cell, Row, Target
from timing import Figures, Job, Pace, measure, ratio

INSTANCES = 1000
Everyone = Sequence[Contender]


def common_rows(everyone: Everyone, pace: Pace) -> list[Row]:
    """Return one row for each case."""
    return [
        _compared(flat(), stepping, everyone, pace, lead=10, floors=10),
        _compared(deep(), stepping, everyone, pace, lead=10),
        _compared(regions(), stepping, everyone, pace, lead=10),
        _compared(ring(), stepping, everyone, pace),
        _compared(flat(), in_turn, everyone, pace, case=f"{INSTANCES:,} instances in turn"),
        _compared(ring(), building, everyone, pace, case="build of 1,000 states", unit="ms"),
        _remembered(everyone),
    ]


def stepping(one: Contender, chart: Chart) -> Job:
    """Return a job of events to one machine, after a check of its transitions."""
    machine = one.start(one.load(one.write(chart)))
    for number in range(2 * chart.rounds if chart.rounds < 10 else 5):
        assert one.where(machine) == chart.leaves(number), (one.name, chart.name, one.where(machine))
        one.run(machine, PING, 1)
    return Job(lambda times: one.run(machine, PING, times))


def in_turn(one: Contender, chart: Chart) -> Job:
    """Return a job of one event to each of many machines of one chart."""
    loaded = one.load(one.write(chart))
    machines = [one.start(loaded) for _ in range(INSTANCES)]
    one.run_each(machines, PING)
    assert {one.where(machine) for machine in machines} == {chart.leaves(1)}, one.name

    def run(times: int) -> None:
        for _ in range(times):
            one.run_each(machines, PING)

    return Job(run, units=INSTANCES)


def building(one: Contender, chart: Chart) -> Job:
    """Return a job from data to a started machine."""

    def run(data: list[Any]) -> None:
        for each in data:
            one.start(one.load(each))

    return Job(run, prepare=lambda times: [one.write(chart) for _ in range(times)])


def _compared(
    chart: Chart, job: Callable[[Contender, Chart], Job], everyone: Everyone, pace: Pace, *,
    case: str = "", unit: str = "µs", lead: float | None = None, floors: float | None = None,
) -> Row:  # fmt: skip
    figures = measure({one.name: job(one, chart) for one in everyone}, pace)
    cells = {name: cell(figures, name, FLOOR, unit) for name in figures}
    targets = [] if floors is None else [Target("x floor", floors, cells[ENGINE].times)]
    peers = [one.name for one in everyone if one.is_peer]
    fastest = min(peers, key=lambda name: median(figures[name]), default="")
    ahead = ratio(figures, fastest, ENGINE) if fastest else None
    targets += [] if lead is None else [Target("x ahead", lead, ahead, least=True)]
    return Row(case or chart.name, unit, cells, ahead, fastest, targets)


def cell(figures: Figures, name: str, against: str, unit: str) -> Cell:
    """Return the median, with its ratio; the floor's hand-written table has no build time to compare."""
    value = {"µs": 1e6, "ms": 1e3}[unit] * median(figures[name])
    compared = name != against and not (unit == "ms" and against == FLOOR)
    return Cell(value, ratio(figures, name, against) if compared else None)


def _remembered(everyone: Everyone) -> Row:
    """Return the memory of a started machine, without parts shared by all machines of its chart."""
    cells = {one.name: Cell(_kib(one, flat())) for one in everyone}
    target = Target(" KiB", 3, cells[ENGINE].value)
    return Row("memory of an instance", "KiB", cells, targets=[target])


def _kib(one: Contender, chart: Chart) -> float:
    loaded = one.load(one.write(chart))
    one.run(one.start(loaded), PING, chart.rounds)  # caches filled on the way are shared by all
    tracemalloc.start()
    machines = [one.start(loaded) for _ in range(INSTANCES)]
    held = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    return held / len(machines) / 1024
