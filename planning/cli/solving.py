"""Implementation of `dsc plan`: read the files, find a plan, wait for cheaper plans, explain why no plan exists."""

from __future__ import annotations

import asyncio
import sys
import time
from contextlib import AbstractContextManager, aclosing, nullcontext, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn

from knowledge_base.errors import InputError, Place, UnknownNameError
from knowledge_base.language.syntax.expression import Expression
from knowledge_base.output_files import Output
from knowledge_base.pddl import ProblemText, read_problem
from knowledge_base.store import KnowledgeBase
from planning.analysis.explanation import why_unsolvable
from planning.cli.plan_report import TIMED_OUT, answer_of, end, ordered, purposes, valueless, without_derived
from planning.engines.planner import PlannerProcess
from planning.engines.race import PlannerRace
from planning.engines.registry import ENGINES, able, chosen, timing
from planning.model.cancellable_work import WorkLimit, WorkLimitError, aside
from planning.model.domain import PlanningDomain
from planning.model.plan import Plan, PlanFound, PlanningOutcome, ProvenUnsolvable, TimedOut, Unsupported
from planning.model.problem import Problem
from planning.ordering.causal_tracing import deordered
from planning.ordering.partial_order import PartialOrder, in_sequence
from planning.ordering.timed_links import linked
from planning.problem.axioms import Derivable
from planning.problem.construction import build_problem
from planning.problem.relevance import why_no_engine

PLOT_NAME = "plan"
PATIENCE, PATIENT_SECONDS = 3.0, 2.0
"""The wait for a cheaper plan: a factor on the time of the first plan, and the minimum in seconds."""


def plan(
    files: list[Path],
    engine: str | None,
    seconds: float,
    plot: Path | None,
    *,
    parallel: bool,
    explain: bool,
    as_json: bool,
) -> NoReturn:
    """Find a plan, print it, and exit; for the arguments see `planning.cli.plan_command`."""
    output = None if plot is None else Output(plot, "--plot", *files)
    domain, read, world = read_files(files)
    notes = [*domain.notes, *read.notes]
    try:
        problem, outcome = solved(domain, read, world, seconds, engine)
    except WorkLimitError as error:
        end(TIMED_OUT, late(error, seconds), notes, as_json=as_json)
    notes += problem.notes
    status, answer = reason_of(outcome, domain, read, world, seconds if explain else None)
    if isinstance(outcome, PlanFound):
        plan = outcome.plan
        notes += valueless(plan, domain, read)
        order = _order(plan, domain, world, read.goal)
        notes += _note_untraced(domain) if parallel or explain or plot else []
        answer |= ordered(order) if parallel else {}
        answer |= purposes(order) if explain else {}
        if output is not None:
            output.write(_plot_text(outcome.plan, domain, order if parallel else None))
    end(status, answer, notes, as_json=as_json)


def late(error: WorkLimitError, seconds: float) -> dict[str, Any]:
    """Return the answer after the time limit has ended the construction of the problem."""
    return {"outcome": "timed_out", "steps": [], "engine": None, "seconds": seconds, "while": error.doing}


def reason_of(
    outcome: PlanningOutcome, domain: PlanningDomain, read: ProblemText, world: KnowledgeBase, seconds: float | None
) -> tuple[int, dict[str, Any]]:
    """Return exit status and answer for an outcome; `seconds` limits the search for the reasons why no plan exists."""
    status, answer = answer_of(outcome)
    if isinstance(outcome, Unsupported):
        answer["reason"] = why_no_engine(domain, read.goal, outcome)
    if isinstance(outcome, ProvenUnsolvable) and seconds is not None:
        answer["why"] = why_none(domain, read, world, seconds)
    return status, answer


def _order(plan: Plan, domain: PlanningDomain, world: KnowledgeBase, goal: Expression) -> PartialOrder:
    if Derivable.of(domain) is not None:
        return in_sequence(plan)
    return (linked if plan.schedule else deordered)(plan, domain, world, goal)


def _note_untraced(domain: PlanningDomain) -> list[str]:
    """Return a note if the domain allows plans only for display, because causal links cannot be traced."""
    form = Derivable.of(domain)
    names = ", ".join(f"'{one}'" for one in sorted(form.predicates)) if form else ""
    why = "planning actions change what it follows from, itself included"
    return [f"{names}: {why}, so causal links are not traced, and no robot can execute the plan"] if form else []


def _plot_text(plan: Plan, domain: PlanningDomain, order: PartialOrder | None) -> str:
    from dsc.text.plot_files import plot_to_yaml  # imported here, because the import of plots is slow
    from planning.generation.plan_to_plot import plot_from_plan

    return plot_to_yaml(plot_from_plan(plan, domain, None, name=PLOT_NAME, order=order))


def read_files(files: list[Path]) -> tuple[PlanningDomain, ProblemText, KnowledgeBase]:
    """Return the domain, the problem, and the world of the problem's initial state.

    Raises:
        InputError: a file cannot be read or contains an error, the problem file is missing, or the problem has no goal.
    """
    if len(files) < 2:
        raise InputError(f"dsc plan takes a domain and a problem, there is only '{files[0]}'")
    *fragments, file = files
    domain = PlanningDomain.from_fragments(fragments)
    read, world = read_world(file, domain)
    return domain, read, world


def read_world(file: Path, domain: PlanningDomain) -> tuple[ProblemText, KnowledgeBase]:
    """Return the problem of a file, and the world of its initial state.

    Raises:
        InputError: the file cannot be read or contains an error, or the problem has no goal.
    """
    read = without_derived(read_problem(file, domain.schema, domain=domain.name), domain, file)
    if not read.has_goal:
        raise InputError("the problem has no goal: (:goal CONDITION)", place=Place(str(file), 1))
    world = KnowledgeBase(domain.schema)
    world.apply(read.delta(), author=str(file))
    return read, world


def solved(
    domain: PlanningDomain, read: ProblemText, world: KnowledgeBase, seconds: float, engine: str | None
) -> tuple[Problem, PlanningOutcome]:
    """Return the problem and the planning outcome; `seconds` limits problem construction and planning together.

    Raises:
        WorkLimitError: the time limit ended problem construction.
    """
    patience = WorkLimit(seconds)
    durations = bool(timing()) or engine is not None

    def problem_of_files() -> Problem:
        form = Derivable.of(domain)
        if form is not None:
            return form.build_problem(world, read.goal, read.metric, durations=durations, patience=patience)
        return build_problem(domain, world, read.goal, read.metric, durations=durations, patience=patience)

    async def solve() -> tuple[Problem, PlanningOutcome]:
        with _progress("grounding the problem"):
            problem = await aside(problem_of_files, patience)
        planner = _planner(problem, engine)
        names = [engine] if engine else [one.name for one in chosen(problem)]
        with _progress(f"planning with {' and '.join(names)}, {len(problem.actions)} ground actions"):
            try:
                outcome = await _cheapest(planner, problem, patience.left)
            finally:
                await planner.close()
        return problem, replace(outcome, seconds=seconds) if isinstance(outcome, TimedOut) else outcome

    return asyncio.run(solve())


def why_none(domain: PlanningDomain, read: ProblemText, world: KnowledgeBase, seconds: float) -> list[str]:
    """Return the reasons why no plan exists, one sentence per item, or a note that the time limit has passed."""
    patience = WorkLimit(seconds)

    def why() -> tuple[str, ...]:
        form = Derivable.of(domain)
        asked = form.without_axioms(world, read.goal) if form else (domain, world, read.goal)
        return why_unsolvable(*asked, patience)

    try:
        return list(asyncio.run(aside(why, patience)))
    except WorkLimitError:
        return [f"the search for the missing conditions takes more than {seconds:g} s"]


async def _cheapest(planner: PlannerProcess | PlannerRace, problem: Problem, seconds: float) -> PlanningOutcome:
    """Return the first outcome; if actions have costs, the cheapest plan found within some additional time."""
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
    """Return the planner of the named engine, or a race if `engine` is `None`.

    Raises:
        InputError: the engine is unknown, lacks a feature of the problem, or is not installed.
    """
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
