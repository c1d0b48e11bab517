"""Simulation of a running plan after changes by others of what its foresight reads (S1.10, S1.20)."""

from __future__ import annotations

from collections.abc import Callable

from knowledge_base.conditions.watch import Missed
from knowledge_base.facts import Change
from knowledge_base.store import KnowledgeBase
from knowledge_base.user_objects import described
from planning.analysis.validation import Validation
from planning.execution.link_monitor import Broken
from planning.execution.plan_run import PlanRun
from planning.execution.search import Search


async def foresee_failure(
    run: PlanRun, search: Search, knowledge: KnowledgeBase, is_own: Callable[[str], bool]
) -> Broken:
    """Wait until the simulation foresees that the coming steps of a plan fail, and return that news.

    Args:
        run: the plan.
        search: has the foresight.
        knowledge: the knowledge base.
        is_own: returns whether a change by this author is an effect of the running step.
    """
    assessed = -1
    with knowledge.watch() as changes:
        async for change in changes:
            if isinstance(change, Missed):
                author = "others"
            elif change.version <= assessed or is_own(change.author) or search.reads.isdisjoint(_names_in(change)):
                continue  # already in the world of the last simulation, or expected, or not read
            else:
                author = change.author
            assessed, progress = knowledge.version, run.progress
            numbers = progress.coming_numbers()
            try:
                verdict = await search.foresee_coming(progress)
            except Exception as error:  # noqa: BLE001  # the next plan has the same error, which ends the search
                verdict = Validation(valid=False, why=described(error))
            if not verdict.valid:
                return _news(verdict, run, numbers, author, assessed)
    raise AssertionError("the knowledge base closes after its runs")


def _names_in(change: Change) -> set[str]:
    delta = change.delta
    return {fact.predicate for fact in (*delta.added, *delta.removed, *delta.values)}


def _news(verdict: Validation, run: PlanRun, numbers: tuple[int, ...], author: str, version: int) -> Broken:
    steps = run.progress.steps
    number = len(steps) + 1 if verdict.failing_step is None else numbers[verdict.failing_step]
    step = "" if verdict.failing_step is None else f"{steps[number - 1]}: "
    why = f"the simulation foresees a failure: {step}{verdict.why}"
    return Broken(why=why, needed="", user=number, author=author, version=version, foreseen=True)
