"""`dsc plan` and `dsc doctor`: ask for a plan on the command line, and see what there is to plan with."""

from __future__ import annotations

import json
import os
import sys
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

if TYPE_CHECKING:
    from collections.abc import Mapping

    from knowledge_base.exchange.pddl import ProblemText
    from knowledge_base.store import KnowledgeBase
    from planning.domain import PlanningDomain
    from planning.engines.planner import PlannerProcess
    from planning.engines.race import PlannerRace
    from planning.ordering.order import PartialOrder
    from planning.plan import Plan, PlanningOutcome
    from planning.strips import Problem

FOUND, UNSOLVABLE, TIMED_OUT, FAILED = 0, 1, 3, 4
"""Exit statuses; 2 is bad input, for every command."""

PATIENCE, PATIENT_SECONDS = 3.0, 2.0
"""A cheaper plan is waited for that many times as long as the first took, and for as many seconds at least."""

PLOT_NAME = "plan"
PIPE_WIDTH = 120
"""Columns of a table that is not printed on a terminal."""


def plan_command(
    files: Annotated[
        list[Path],
        typer.Argument(
            metavar="DOMAIN... PROBLEM", help="PDDL: the domain, in one file or several, and the problem.",
            show_default=False,
        ),
    ],
    engine: Annotated[
        str | None, typer.Option(metavar="NAME", help="Which engine plans.  [default: those that suit it race]")
    ] = None,
    seconds: Annotated[float, typer.Option(min=0.0, help="Stop posing and planning after this long.")] = 10.0,
    parallel: Annotated[bool, typer.Option("--parallel", help="Show which steps can go side by side.")] = False,
    plot: Annotated[Path | None, typer.Option(metavar="FILE", help="Write it as a plot (YAML) to complete.")] = None,
    explain: Annotated[
        bool, typer.Option("--explain", help="Say what each step is for, or why there is no plan.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:  # fmt: skip
    """Find a plan and print its steps.

    Exit status: 0 a plan, 1 there is none, 2 bad input, 3 out of time, 4 the planner failed.
    """
    from planning.ordering.order import deordered
    from planning.ordering.timed_links import linked
    from planning.patience import OutOfPatienceError
    from planning.plan import NobodyCan, PlanFound, ProvenUnsolvable
    from planning.posing.constructs import why_no_engine

    if plot is not None:
        _refuse_unwritable(plot)
    domain, read, world = _read(files)
    notes = [*domain.notes, *read.notes]
    try:
        problem, outcome = _solved(domain, read, world, seconds, engine)
    except OutOfPatienceError as error:
        late: dict[str, Any] = {"outcome": "timed_out", "steps": [], "engine": None, "seconds": seconds}
        _end(TIMED_OUT, late | {"while": error.doing}, notes, as_json=as_json)
    notes += problem.notes
    status, answer = _answer(outcome)
    if isinstance(outcome, NobodyCan):
        answer["reason"] = why_no_engine(domain, read.goal, outcome)
    if isinstance(outcome, ProvenUnsolvable) and explain:
        answer["why"] = _why(domain, read, world, seconds)
    if isinstance(outcome, PlanFound):
        plan = outcome.plan
        order = (linked if plan.schedule else deordered)(plan, domain, world, read.goal)
        answer |= _ordered(order) if parallel else {}
        answer |= _purposes(order) if explain else {}
        if plot is not None:
            _write_plot(plot, outcome.plan, domain, order if parallel else None)
    _end(status, answer, notes, as_json=as_json)


def doctor_command(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
) -> None:
    """Show which planning engines there are, what each can do, and how to install what is missing."""
    from planning.engines.doctor import findings

    found = findings()
    if as_json:
        typer.echo(json.dumps(found))
        return
    from rich.console import Console

    console = Console(width=None if sys.stdout.isatty() else PIPE_WIDTH)
    console.print(_engine_table(found["engines"]))
    for one in found["engines"]:
        if not one["ready"]:
            console.print(f"  {one['name']}: {one['to_do']}", markup=False, highlight=False)
    versions = {"Python": found["python"], "Java": found["java"], **found["packages"]}
    said = ", ".join(f"{name} {version or '(none)'}" for name, version in versions.items())
    console.print(f"\n{said}; {found['system']}", markup=False, highlight=False)


def _end(status: int, answer: dict[str, Any], notes: list[str], *, as_json: bool) -> NoReturn:
    for note in () if as_json else notes:
        typer.echo(f"note: {note}", err=True)
    typer.echo(json.dumps(answer | {"notes": notes}) if as_json else _text(answer), err=status != FOUND and not as_json)
    raise typer.Exit(status)


def _read(files: list[Path]) -> tuple[PlanningDomain, ProblemText, KnowledgeBase]:
    from knowledge_base.errors import InputError, Place
    from knowledge_base.exchange.pddl import read_problem
    from knowledge_base.store import KnowledgeBase
    from planning.domain import PlanningDomain

    if len(files) < 2:
        raise InputError(f"dsc plan takes a domain and a problem, there is only '{files[0]}'")
    *fragments, file = files
    domain = PlanningDomain.from_fragments(fragments)
    read = read_problem(file, domain.schema, domain=domain.name)
    if not read.has_goal:
        raise InputError("the problem has no goal: (:goal CONDITION)", place=Place(str(file), 1))
    world = KnowledgeBase(domain.schema)
    world.apply(read.delta(), author=str(file))
    return domain, read, world


def _solved(
    domain: PlanningDomain, read: ProblemText, world: KnowledgeBase, seconds: float, engine: str | None
) -> tuple[Problem, PlanningOutcome]:
    """The problem and what comes of it; the time is for both together.

    Raises:
        OutOfPatienceError: it was not even posed in time.
    """
    import asyncio

    from planning.engines.registry import chosen, timing
    from planning.patience import Patience, aside
    from planning.plan import TimedOut
    from planning.posing.problem import pose

    patience = Patience(seconds)
    durations = bool(timing()) or engine is not None

    def posed() -> Problem:
        return pose(domain, world, read.goal, read.metric, durations=durations, patience=patience)

    async def solve() -> tuple[Problem, PlanningOutcome]:
        with _progress("grounding the problem"):
            problem = await aside(posed, patience)
        planner = _planner(problem, engine)
        names = [engine] if engine else [one.name for one in chosen(problem)]
        with _progress(f"planning with {' and '.join(names)}, {len(problem.actions)} ground actions"):
            try:
                outcome = await _cheapest(planner, problem, patience.left)
            finally:
                await planner.close()
        return problem, replace(outcome, seconds=seconds) if isinstance(outcome, TimedOut) else outcome

    return asyncio.run(solve())


def _why(domain: PlanningDomain, read: ProblemText, world: KnowledgeBase, seconds: float) -> list[str]:
    import asyncio

    from planning.patience import OutOfPatienceError, Patience, aside
    from planning.posing.unsolvable import why_unsolvable

    patience = Patience(seconds)
    try:
        return list(asyncio.run(aside(lambda: why_unsolvable(domain, world, read.goal, patience), patience)))
    except OutOfPatienceError:
        return [f"what is missing was not found out within {seconds:g} s"]


async def _cheapest(planner: PlannerProcess | PlannerRace, problem: Problem, seconds: float) -> PlanningOutcome:
    """The first outcome; where actions have costs, the cheapest plan that comes in some more of the time."""
    import asyncio
    import time
    from contextlib import aclosing, suppress

    from planning.plan import PlanFound

    started = time.monotonic()
    async with aclosing(planner.plans(problem, seconds)) as plans:
        best = await anext(plans)
        if isinstance(best, PlanFound) and "costs" in problem.features:
            spent = time.monotonic() - started
            with suppress(TimeoutError):
                async with asyncio.timeout(min(seconds - spent, max(PATIENT_SECONDS, PATIENCE * spent))):
                    async for cheaper in plans:
                        best = cheaper
    return best


def _planner(problem: Problem, engine: str | None) -> PlannerProcess | PlannerRace:
    """The named engine, if it can do the problem and is installed; else a race."""
    from knowledge_base.errors import InputError, UnknownNameError
    from planning.engines.planner import PlannerProcess
    from planning.engines.race import PlannerRace
    from planning.engines.registry import ENGINES, able

    if engine is None:
        return PlannerRace()
    forms = [problem, *([problem.timed] if problem.timed else ())]
    suited = {one.name: one for form in forms for one in able(form.features)}
    could = f"; for this problem there are {', '.join(suited)}" if suited else ""
    known = [one.name for one in ENGINES]
    if engine not in known:
        raise UnknownNameError(f"there is no engine '{engine}'{could}", found=engine, valid=known)
    if engine not in suited:
        raise InputError(f"the engine '{engine}' cannot do {', '.join(sorted(problem.features))}{could}")
    if lacks := suited[engine].lacks():
        raise InputError(f"the engine '{engine}' is not installed: {lacks}")
    return PlannerProcess(engine)


def _progress(text: str) -> AbstractContextManager[object]:
    if not sys.stderr.isatty():
        return nullcontext()
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    columns = (SpinnerColumn(), TextColumn("{task.description}"), TimeElapsedColumn())
    progress = Progress(*columns, console=Console(stderr=True), transient=True)
    progress.add_task(text, total=None)
    return progress


def _answer(outcome: PlanningOutcome) -> tuple[int, dict[str, Any]]:
    """Exit status and what is printed."""
    from planning.plan import EngineFailed, NobodyCan, NoneFound, PlanFound, ProvenUnsolvable, TimedOut

    match outcome:
        case PlanFound(plan=plan, engine=engine, seconds=seconds, cost=cost):
            found: dict[str, Any] = {"outcome": "plan", "steps": [str(step) for step in plan.steps]}
            if plan.schedule:
                found["schedule"] = [[round(one.start, 6), round(one.duration, 6)] for one in plan.schedule]
            return FOUND, {**found, "cost": cost, "engine": engine, "seconds": round(seconds, 3)}
        case ProvenUnsolvable(engine=engine, reason=reason):
            return UNSOLVABLE, {"outcome": "unsolvable", "steps": [], "engine": engine, "reason": reason}
        case NoneFound(engine=engine, reason=reason):
            return UNSOLVABLE, {"outcome": "none_found", "steps": [], "engine": engine, "reason": reason}
        case TimedOut(engine=engine, seconds=seconds):
            return TIMED_OUT, {"outcome": "timed_out", "steps": [], "engine": engine, "seconds": seconds}
        case EngineFailed(engine=engine, message=message):
            return FAILED, {"outcome": "engine_failed", "steps": [], "engine": engine, "reason": message}
        case NobodyCan(engine=engine, message=message):
            return FAILED, {"outcome": "no_engine", "steps": [], "engine": engine, "reason": message}


def _ordered(order: PartialOrder) -> dict[str, Any]:
    """The chains that can go side by side, and what each step waits for; steps are numbered from 1."""
    from planning.ordering.chains import chains

    linked = {(link.provider, link.user) for link in order.links}
    found = chains(order.earlier, lambda one, other: (one, other) in linked)
    waits = {number: list(earlier) for number, earlier in order.waits_for.items()}
    return {"lanes": [list(chain) for chain in found], "waits_for": waits}


def _purposes(order: PartialOrder) -> dict[str, Any]:
    """For each step what it brings about and for whom; 0 is the goal."""
    from knowledge_base.language.printer import to_text

    purposes: dict[int, list[dict[str, Any]]] = {number: [] for number in range(1, len(order.steps) + 1)}
    for link in order.links:
        if link.provider:
            user = link.user if link.user <= len(order.steps) else 0
            purposes[link.provider].append({"fact": to_text(link.fact), "for": user})
    return {"purposes": purposes}


def _refuse_unwritable(file: Path) -> None:
    """Before any search, and without making the file: there may be no plan to put there."""
    from knowledge_base.errors import InputError

    if file.is_dir():
        raise InputError(f"cannot write the plot to '{file}': it is a folder")
    if not file.parent.is_dir():
        raise InputError(f"cannot write the plot to '{file}': there is no folder '{file.parent}'")
    if not os.access(file if file.exists() else file.parent, os.W_OK):
        raise InputError(f"cannot write the plot to '{file}': it may not be written")


def _write_plot(file: Path, plan: Plan, domain: PlanningDomain, order: PartialOrder | None) -> None:
    from dsc.text.plots import plot_to_yaml
    from knowledge_base.errors import InputError
    from planning.generation.plot import plot_from_plan

    text = plot_to_yaml(plot_from_plan(plan, domain, None, name=PLOT_NAME, order=order))
    try:
        file.write_text(text, encoding="utf-8")
    except OSError as error:
        raise InputError(f"cannot write the plot to '{file}': {error.strerror}") from None


def _text(answer: Mapping[str, Any]) -> str:
    match answer["outcome"]:
        case "plan":
            return _plan_text(answer) if answer["steps"] else "nothing to do: the goal already holds"
        case "none_found" | "no_engine":
            reason: str = answer["reason"]
            return reason
        case "unsolvable":
            return "\n".join([f"there is no plan ({answer['reason']})", *answer.get("why", ())])
        case "timed_out":
            by = f"while {answer['while']}" if "while" in answer else answer["engine"]
            return f"no plan within {answer['seconds']:g} s ({by})"
        case _:
            return f"the planner {answer['engine']} failed: {answer['reason']}"


def _plan_text(answer: Mapping[str, Any]) -> str:
    """One step a line, by lanes if they are known, each with what it waits for and what it is for."""
    lanes = answer.get("lanes") or [range(1, len(answer["steps"]) + 1)]
    lines: list[str] = []
    for number, lane in enumerate(lanes, 1):
        lines += [f"lane {number}"] if "lanes" in answer else []
        before = None
        for step in lane:
            others = [one for one in answer.get("waits_for", {}).get(step, ()) if one != before]
            waiting = f"   waits for {', '.join(map(str, others))}" if others else ""
            timed = _time_text(*answer["schedule"][step - 1]) if "schedule" in answer else ""
            lines.append(f"{step:3} {timed}{answer['steps'][step - 1]}{waiting}")
            before = step
            for purpose in answer.get("purposes", {}).get(step, ()):
                user = f"step {purpose['for']}" if purpose["for"] else "the goal"
                lines.append(f"      {purpose['fact']} for {user}")
    return "\n".join([*lines, f"cost {answer['cost']:g}, engine {answer['engine']}"])


def _time_text(start: float, seconds: float) -> str:
    """When a step begins and how long it takes, in the way of temporal planners."""
    return f"{start:8.3f}: [{seconds:g}] "


def _engine_table(engines: list[dict[str, Any]]) -> Any:
    from rich.table import Table

    table = Table(title="planning engines", title_justify="left")
    for head in ("engine", "version", "can do", "plans", "by itself", "licence"):
        table.add_column(head, overflow="fold")
    for one in engines:
        plans = "the cheapest" if one["optimal"] else "better and better" if one["anytime"] else "one"
        version = one["version"] or "missing" if one["ready"] else "[yellow]missing[/]"
        races = "races" if one["races"] else "by name only"
        table.add_row(one["name"], version, ", ".join(one["can_do"]), plans, races, one["licence"])
    return table
