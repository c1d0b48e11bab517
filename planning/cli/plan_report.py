"""Report of `dsc plan`: plain data for `--json`, text for users, and warnings about the problem."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

import typer

from knowledge_base.facts import Fact
from knowledge_base.language.syntax.effect import (
    Add,
    AllOf,
    Delete,
    Effect,
    ForEach,
    NumericEffect,
    When,
    effect_conditions,
)
from knowledge_base.language.syntax.expression import Call, Constant, Expression, Term, parts_of
from knowledge_base.language.syntax.text import to_text
from knowledge_base.pddl import ProblemText
from planning.model.domain import PlanningDomain
from planning.model.plan import (
    EngineFailed,
    NoneFound,
    Plan,
    PlanFound,
    PlanningOutcome,
    ProvenUnsolvable,
    TimedOut,
    Unsupported,
)
from planning.ordering.partial_order import PartialOrder, chains

FOUND, UNSOLVABLE, TIMED_OUT, FAILED = 0, 1, 3, 4
"""Exit statuses of `dsc plan`; status 2 is bad input, for every command."""


def end(status: int, answer: dict[str, Any], notes: list[str], *, as_json: bool) -> NoReturn:
    """Print the answer, print the notes on standard error, and exit with `status`."""
    for note in () if as_json else notes:
        typer.echo(f"note: {note}", err=True)
    typer.echo(
        json.dumps(answer | {"notes": notes}) if as_json else describe(answer), err=status != FOUND and not as_json
    )
    raise typer.Exit(status)


def answer_of(outcome: PlanningOutcome) -> tuple[int, dict[str, Any]]:
    """Return the exit status and the answer to print, as JSON data."""
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
        case Unsupported(engine=engine, message=message):
            return FAILED, {"outcome": "no_engine", "steps": [], "engine": engine, "reason": message}


def ordered(order: PartialOrder) -> dict[str, Any]:
    """Return the concurrent chains of steps, and the steps for which each step waits; steps are numbered from 1."""
    linked = {(link.provider, link.user) for link in order.links}
    found = chains(order.earlier, lambda one, other: (one, other) in linked)
    waits = {number: list(earlier) for number, earlier in order.waits_for.items()}
    return {"lanes": [list(chain) for chain in found], "waits_for": waits}


def purposes(order: PartialOrder) -> dict[str, Any]:
    """Return the facts that each step establishes, each with the step that needs it; 0 stands for the goal."""
    purposes: dict[int, list[dict[str, Any]]] = {number: [] for number in range(1, len(order.steps) + 1)}
    for link in order.links:
        if link.provider:
            user = link.user if link.user <= len(order.steps) else 0
            purposes[link.provider].append({"fact": to_text(link.fact), "for": user})
    return {"purposes": purposes}


def describe(answer: Mapping[str, Any]) -> str:
    """Return an answer as text for users."""
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
    """Return the plan as text, one step per line, with the chains, waits and purposes that the answer contains."""
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
    """Return a step's start and duration in the notation of temporal planners."""
    return f"{start:8.3f}: [{seconds:g}] "


def without_derived(read: ProblemText, domain: PlanningDomain, file: Path) -> ProblemText:
    """Return the problem without initial facts of derived predicates, with a note for each such predicate."""
    derived = {axiom.predicate for axiom in domain.axioms}
    said = dict.fromkeys(fact.predicate for fact in read.init if fact.predicate in derived)
    notes = [f"{file}: facts of '{name}' in :init are ignored, since it is derived" for name in said]
    kept = tuple(fact for fact in read.init if fact.predicate not in derived)
    return replace(read, init=kept, notes=(*read.notes, *notes))


def valueless(plan: Plan, domain: PlanningDomain, read: ProblemText) -> list[str]:
    """Return a note for each number that a step of the plan reads before it has a value; the value is then 0."""
    given, missing = set(read.values), dict[Fact, None]()
    for step in plan.steps:
        ground = domain.ground(step)
        asked = [*_fluents(ground.condition), *(one for e in effect_conditions(ground.effect) for one in _fluents(e))]
        changed = list(_find_assignments(ground.effect))
        asked += [one for _, amount in changed for one in _fluents(amount)]
        missing.update(dict.fromkeys(one for one in asked if one not in given))
        given.update(fluent for fluent, _ in changed)
    return [f"{fluent} has no value and counts as 0" for fluent in missing]


def _find_assignments(effect: Effect) -> Iterator[tuple[Fact, Term]]:
    match effect:
        case AllOf(parts):
            for part in parts:
                yield from _find_assignments(part)
        case When(_, inner):
            yield from _find_assignments(inner)
        case NumericEffect(_, call, amount):
            for fluent in _fluents(call):
                yield fluent, amount
        case Add() | Delete() | ForEach():
            pass


def _fluents(e: Expression | Term) -> Iterator[Fact]:
    """Yield the ground fluents of a condition or term."""
    if isinstance(e, Call) and all(isinstance(arg, Constant) for arg in e.args):
        yield Fact(e.function, tuple(arg.value for arg in e.args if isinstance(arg, Constant)))
    for part in parts_of(e):
        yield from _fluents(part)
