"""Cases of this engine alone: guards, actions, variables, attributes, submachines, the size of the chart."""

from __future__ import annotations

from dataclasses import replace
from itertools import count, repeat

from common import cell
from common import stepping as pinging
from own_jobs import attributes, binding, compiled, holder, ping_pong, plan, read, stage, started, stepping, validated
from peers.charts import flat, ring
from peers.dsc import form
from peers.floor import CONTENDER as BY_HAND
from rows import ENGINE, FLOOR, Row, Target
from timing import Figures, Job, Pace, measure, ratio

SIZES = (10, 100, 1000)
PLAIN, GUARDED, SITUATED = "unguarded", "a guard over a variable", "unguarded, new situation"
BOUND = "submachine left and bound anew"
READ, STARTED = "pydantic alone", "pydantic, validated, compiled, started"


def own_rows(pace: Pace) -> list[Row]:
    """Return one row for each case; cases that are compared are timed together."""
    return [*_step_rows(pace), *_size_rows(pace), *_stage_rows(pace)]


def _step_rows(pace: Pace) -> list[Row]:
    guard = {"when": "(> ?n 0)"}
    switched = {"entry": {"switch": "lamp", "to": "on"}, "exit": {"switch": "lamp", "to": "off"}}
    cases: dict[str, tuple[Job, str, float | None]] = {  # name -> job, the case to compare with, bound
        PLAIN: (stepping(ping_pong()), FLOOR, None),
        GUARDED: (stepping(ping_pong(**guard)), PLAIN, 2),
        SITUATED: (stepping(ping_pong(), situated=True), PLAIN, None),
        f"{GUARDED}, new situation": (stepping(ping_pong(**guard), situated=True), SITUATED, None),
        "entry and exit action": (stepping(ping_pong(**switched)), PLAIN, None),
        "a variable assigned": (stepping(ping_pong(assign={"n": "(+ ?n 1)"})), PLAIN, None),
        "new attributes each time": (attributes(), PLAIN, None),
        BOUND: (binding(holder("inner"), ping_pong("inner"), plans=repeat(None)), FLOOR, 40),
        "plot given as a value bound again": (binding(holder("?plan"), plans=repeat(plan(0))), FLOOR, None),
        "new plot of 10 states bound": (binding(holder("?plan"), plans=map(plan, count(1))), FLOOR, None),
    }
    jobs = {FLOOR: pinging(BY_HAND, flat()), **{name: job for name, (job, _, _) in cases.items()}}
    figures = measure(jobs, pace)
    return [_row(figures, name, against, bound) for name, (_, against, bound) in cases.items()]


def _size_rows(pace: Pace) -> list[Row]:
    names = [f"among {size:,} other states" for size in SIZES]
    jobs = {name: stepping(ping_pong(others=size)) for name, size in zip(names, SIZES, strict=True)}
    figures = measure(jobs, pace)
    rows = [_row(figures, name, names[0]) for name in names]
    spread = max(ratio(figures, one, other) for one in names for other in names)
    rows[-1].targets.append(Target("x from size to size", 1.2, spread))
    return rows


def _stage_rows(pace: Pace) -> list[Row]:
    builds = {READ: read, "pydantic, validated": validated, "pydantic, validated, compiled": compiled, STARTED: started}
    written = form(ring())
    figures = measure({name: stage(build, written) for name, build in builds.items()}, pace)
    return [_row(figures, name, READ, 5 if name == STARTED else None, unit="ms") for name in builds]


def _row(figures: Figures, name: str, against: str, bound: float | None = None, *, unit: str = "µs") -> Row:
    found = cell(figures, name, against, unit)
    targets = [] if bound is None else [Target(f"x {against}", bound, found.times)]
    return Row(name, unit, {ENGINE: replace(found, against=against)}, targets=targets)
