"""`dsc plan`: ask for a plan on the command line."""

from __future__ import annotations

import json
import sys
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from planning.plan import PlanningOutcome
    from planning.strips import Problem

FOUND, UNSOLVABLE, TIMED_OUT, FAILED = 0, 1, 3, 4
"""Exit statuses; 2 is bad input, for every command."""


def plan_command(
    domain: Annotated[Path, typer.Argument(help="PDDL file with the planning domain.", show_default=False)],
    problem: Annotated[Path, typer.Argument(help="PDDL file with the problem.", show_default=False)],
    seconds: Annotated[float, typer.Option(min=0.0, help="Stop the planner after this long.")] = 10.0,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object.")] = False,
    explain: Annotated[bool, typer.Option("--explain", help="If there is no plan, say why.")] = False,
) -> None:
    """Find a plan and print its steps.

    Exit status: 0 a plan, 1 there is none, 2 bad input, 3 out of time, 4 the planner failed.
    """
    from knowledge_base.errors import InputError, Place
    from knowledge_base.exchange.pddl import read_problem
    from knowledge_base.store import KnowledgeBase
    from planning.domain import PlanningDomain
    from planning.explain import why_unsolvable
    from planning.plan import ProvenUnsolvable
    from planning.problem import pose

    planning_domain = PlanningDomain.from_pddl(domain)
    read = read_problem(problem, planning_domain.schema, domain=planning_domain.name)
    if not read.has_goal:
        raise InputError("the problem has no goal: (:goal CONDITION)", place=Place(str(problem), 1))
    world = KnowledgeBase(planning_domain.schema)
    world.apply(read.delta(), author=str(problem))
    outcome = _solve(pose(planning_domain, world, read.goal), seconds)
    why: tuple[str, ...] = ()
    if explain and isinstance(outcome, ProvenUnsolvable):
        why = why_unsolvable(planning_domain, world, read.goal)
    status, answer = _answer(outcome, why)
    typer.echo(json.dumps(answer) if as_json else _text(answer), err=status != FOUND and not as_json)
    raise typer.Exit(status)


def _solve(problem: Problem, seconds: float) -> PlanningOutcome:
    import asyncio

    from planning.planner import PlannerProcess

    async def solve() -> PlanningOutcome:
        planner = PlannerProcess()
        try:
            return await planner.solve(problem, seconds)
        finally:
            await planner.close()

    with _spinner(f"planning, {len(problem.actions)} ground actions"):
        return asyncio.run(solve())


def _spinner(text: str) -> AbstractContextManager[object]:
    if not sys.stderr.isatty():
        return nullcontext()
    from rich.console import Console

    return Console(stderr=True).status(text)


def _answer(outcome: PlanningOutcome, why: tuple[str, ...]) -> tuple[int, dict[str, Any]]:
    """Exit status and what is printed."""
    from planning.plan import EngineFailed, PlanFound, ProvenUnsolvable, TimedOut

    match outcome:
        case PlanFound(plan, engine, seconds):
            found: dict[str, Any] = {"outcome": "plan", "steps": [str(step) for step in plan.steps]}
            return FOUND, {**found, "engine": engine, "seconds": round(seconds, 3)}
        case ProvenUnsolvable(engine, reason):
            found = {"outcome": "unsolvable", "steps": [], "engine": engine, "reason": reason}
            return UNSOLVABLE, {**found, **({"why": list(why)} if why else {})}
        case TimedOut(engine, seconds):
            return TIMED_OUT, {"outcome": "timed_out", "steps": [], "engine": engine, "seconds": seconds}
        case EngineFailed(engine, message):
            return FAILED, {"outcome": "engine_failed", "steps": [], "engine": engine, "reason": message}


def _text(answer: dict[str, Any]) -> str:
    match answer["outcome"]:
        case "plan":
            numbered = [f"{number:3} {step}" for number, step in enumerate(answer["steps"], 1)]
            return "\n".join(numbered) or "nothing to do: the goal already holds"
        case "unsolvable":
            return "\n".join([f"there is no plan ({answer['reason']})", *answer.get("why", ())])
        case "timed_out":
            return f"no plan within {answer['seconds']:g} s"
        case _:
            return f"the planner {answer['engine']} failed: {answer['reason']}"
