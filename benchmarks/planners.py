"""The cost of a plan on the clean-up table: each engine through plain unified-planning, the race, and the parts.

`python benchmarks/planners.py [--quick] [--json] [--write]`: small tables in one round, plain data for programs, or the
tables for docs/engines.md. `make bench-planning` installs the engines first. One run measures all engines in turn; only
ratios are meaningful.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import os
import signal
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from contextlib import aclosing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import replanning
import set_table

from planning.engines.fast_downward import sas
from planning.engines.planner import PlannerProcess
from planning.engines.race import PlannerRace
from planning.engines.registry import ENGINES, installed
from planning.engines.request import write_problem
from planning.generation.plan_to_plot import plot_from_plan
from planning.model.plan import Plan, PlanFound
from planning.model.problem import Problem
from planning.ordering.causal_tracing import deordered
from planning.problem.construction import ProblemBuilder, build_problem

PAGE = Path(__file__).parents[1] / "docs" / "engines.md"
MARK = "<!-- results -->\n"
SIZES, QUICK_SIZES = (5, 15, 25, 50), (5, 9)
OPTIMAL_SIZES, QUICK_OPTIMAL_SIZES = (4, 5, 6, 7), (4,)
SECONDS = 20.0
PLAIN = ("fast-downward", "pyperplan", "enhsp")
RATIO, EXTRA_MS, OUR_MS, LONGER = 1.5, 50, 40, 0.15


@dataclass(frozen=True, slots=True)
class Answer:
    """Seconds of the search and trips of the plan; no seconds after a timeout."""

    seconds: float | None
    trips: int | None = None


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="small tables, one round: does it work at all?")
    parser.add_argument("--json", action="store_true", help="plain data")
    parser.add_argument("--write", action="store_true", help="put the tables into docs/engines.md")
    options = parser.parse_args()
    rounds = 1 if options.quick else 3
    engines = [row(items, rounds) for items in (QUICK_SIZES if options.quick else SIZES)]
    parts = [part_row(items, rounds) for items in (QUICK_SIZES if options.quick else SIZES)]
    whole = [whole_row(items) for items in (QUICK_SIZES if options.quick else SIZES)]
    optimal = [optimal_row(items) for items in (QUICK_OPTIMAL_SIZES if options.quick else OPTIMAL_SIZES)]
    if options.json:
        print(json.dumps({"engines": engines, "parts": parts, "whole": whole, "optimal": optimal}))
        return
    versions = ", ".join(f"{one.package} {one.version}" for one in ENGINES if one.races and installed(one))
    tables = map(_table, (engines, parts, whole, optimal))
    text = "\n\n".join([*tables, f"Measured with {versions}; {rounds} rounds."])
    print(text)
    if options.write:
        head, mark, _ = PAGE.read_text(encoding="utf-8").partition(MARK)
        PAGE.write_text(f"{head}{mark}{text}\n", encoding="utf-8")


def row(items: int, rounds: int) -> dict[str, Any]:
    """Return the figures of each engine and the race, in turn; an engine that timed out once is not asked again."""
    names = [name for name in PLAIN if installed(next(one for one in ENGINES if one.name == name))]
    answers: dict[str, list[Answer]] = {name: [] for name in [*names, "race"]}
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "problem.pddl"
        file.write_text(set_table.problem_text(items), encoding="utf-8")
        racing = _racing(build_problem(set_table.domain(), set_table.world(items), set_table.GOAL), rounds)
        for _ in range(rounds):
            for name in names:
                if not answers[name] or answers[name][-1].seconds is not None:
                    answers[name].append(plain(name, file))
        answers["race"] = racing
    medians = {name: _median(found) for name, found in answers.items()}
    best = min((one.seconds for name, one in medians.items() if name != "race" and one.seconds), default=None)
    race = medians["race"].seconds
    target = None if best is None else RATIO * best + EXTRA_MS / 1000
    said = "" if target is None else f"≤ {1000 * target:.0f} ms: {_verdict(race is not None and race <= target)}"
    return {"items": items, **{name: _said(one) for name, one in medians.items()}, "race's target": said}


def plain(name: str, problem: Path) -> Answer:
    """Return the answer of one engine through unified-planning, in a process group that is killed afterwards."""
    command = [sys.executable, str(Path(__file__).with_name("plain_up.py")), name, str(set_table.FILE), str(problem)]
    running = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, start_new_session=True
    )
    try:
        out, _ = running.communicate(timeout=SECONDS)
        said = json.loads(out.splitlines()[-1]) if out.strip() else {"steps": None}
    except subprocess.TimeoutExpired:
        said = {"steps": None}
    finally:
        _kill_all(running)
    if said["steps"] is None:
        return Answer(None)
    return Answer(said["seconds"], said["steps"].count(set_table.TRIP))


def _kill_all(running: subprocess.Popen[str]) -> None:
    """Kill the process and the engine, which unified-planning starts in a separate session."""
    own = Path(f"/proc/{running.pid}/task/{running.pid}/children")
    children = [int(pid) for pid in own.read_text().split()] if own.exists() else []
    for group in (*children, running.pid):
        try:
            os.killpg(group, signal.SIGKILL)
        except OSError:
            continue
    running.wait()


def _racing(problem: Problem, rounds: int) -> list[Answer]:
    async def run() -> list[Answer]:
        race, found = PlannerRace(), []
        await race.warm_up(problem)
        for _ in range(rounds):
            started = time.perf_counter()
            outcome = await race.solve(problem, SECONDS)
            seconds = time.perf_counter() - started
            plan = isinstance(outcome, PlanFound)
            found.append(Answer(seconds, set_table.trips(outcome.plan.steps)) if plan else Answer(None))
        await race.close()
        return found

    return asyncio.run(run())


def part_row(items: int, rounds: int) -> dict[str, Any]:
    """Return the medians of all work around the engine, in ms."""
    domain, world, goal = set_table.domain(), set_table.world(items), set_table.GOAL
    builder = ProblemBuilder(domain)
    problem = builder.build_problem(world, goal)
    plan = _plan(problem)
    order, request = deordered(plan, domain, world, goal), write_problem(problem)
    parts: dict[str, Callable[[], object]] = {
        "pose, cold": lambda: ProblemBuilder(domain).build_problem(world, goal),
        "pose, warm": lambda: builder.build_problem(world, goal),
        "write": lambda: write_problem(replace(problem)),
        "translate": lambda: sas(json.loads(request)),
        "validate, de-order": lambda: deordered(plan, domain, world, goal),
        "generate": lambda: plot_from_plan(plan, domain, None, order=order),
    }
    times = {name: 1000 * _seconds(part, rounds) for name, part in parts.items()}
    ours = sum(times.values()) - times["pose, cold"]
    verdict = f"≤ {OUR_MS} ms: {_verdict(ours <= OUR_MS)}" if items == 25 else ""
    said = {name: f"{ms:.1f} ms" for name, ms in times.items()}
    return {"items": items, "actions": len(problem.actions), **said, "warm in all": f"{ours:.0f} ms", "": verdict}


def whole_row(items: int) -> dict[str, Any]:
    """Return the time from a failure to the first action of the new plan, in a run; see `replanning`."""
    spent = replanning.measured(items)
    ours = sum(spent[part] for part in replanning.OURS)
    verdict = f"≤ {OUR_MS} ms: {_verdict(ours <= OUR_MS)}" if items == 25 else ""
    said = {part: f"{ms:.1f} ms" for part, ms in spent.items()}
    return {"items": items, **said, "ours": f"{ours:.0f} ms", "": verdict}


def optimal_row(items: int) -> dict[str, Any]:
    """Return the trips next to the minimum, which an optimal engine finds when only trips cost."""
    problem = build_problem(set_table.domain(), set_table.world(items), set_table.GOAL)
    actions = tuple(replace(a, cost=_trip_cost(a.step)) for a in problem.actions)
    priced = replace(problem, unsliced=None, actions=actions)
    fewest = asyncio.run(_solved("fast-downward-opt", priced))
    if not isinstance(fewest, PlanFound):
        return {"items": items, "trips": "", "fewest": f"not within {SECONDS:g} s", "": ""}
    trips, least = set_table.trips(_plan(problem).steps), set_table.trips(fewest.plan.steps)
    return {"items": items, "trips": trips, "fewest": least, "": f"≤ +15 %: {_verdict(trips <= (1 + LONGER) * least)}"}


def _trip_cost(step: Any) -> float:
    return 1000.0 if step is not None and step.action == set_table.TRIP else 1.0


async def _solved(name: str, problem: Problem) -> object:
    planner = PlannerProcess(name)
    async with aclosing(planner.plans(problem, SECONDS)) as plans:
        outcome = await anext(plans)
    await planner.close()
    return outcome


def _plan(problem: Problem) -> Plan:
    """Return a plan of the race's preferred engine, or of the embedded one."""
    for name in ("fast-downward", "pyperplan"):
        if installed(next(one for one in ENGINES if one.name == name)):
            found = asyncio.run(_solved(name, problem))
            if isinstance(found, PlanFound):
                return found.plan
    raise SystemExit("no engine found a plan")


def _seconds(part: Callable[[], object], rounds: int) -> float:
    times = []
    for _ in range(rounds + 1):
        started = time.perf_counter()
        part()
        times.append(time.perf_counter() - started)
    return statistics.median(times[1:])


def _median(found: Sequence[Answer]) -> Answer:
    seconds = [one.seconds for one in found]
    if None in seconds:
        return Answer(None)
    return Answer(statistics.median(s for s in seconds if s is not None), found[-1].trips)


def _said(one: Answer) -> str:
    return f"> {SECONDS:g} s" if one.seconds is None else f"{1000 * one.seconds:.0f} ms, {one.trips} trips"


def _verdict(met: bool) -> str:  # noqa: FBT001
    return "met" if met else "missed"


def _table(rows: Sequence[dict[str, Any]]) -> str:
    """Return a Markdown table with aligned columns."""
    lines = [list(rows[0]), *([str(value) for value in one.values()] for one in rows)]
    widths = [max(len(line[n]) for line in lines) for n in range(len(lines[0]))]
    rule = ["-" * max(width, 3) for width in widths]
    return "\n".join("| " + " | ".join(map(str.ljust, line, widths)) + " |" for line in [lines[0], rule, *lines[1:]])


if __name__ == "__main__":
    main()
