"""Records `plan.*` of a trace, and the explanation of a record `plan.broken` as a sentence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from dsc.model.language import text_of
from knowledge_base.language.syntax.expression import Expression
from planning.ordering.partial_order import PRESENT

if TYPE_CHECKING:
    from dsc.trace import Trace
    from planning.execution.link_monitor import Broken
    from planning.execution.plan_progress import PlanProgress
    from planning.model.plan import PlanFound, PlanStep
    from planning.ordering.partial_order import PartialOrder

_CUT_SHORT = {"reproducible": False}
"""A mark for outcomes that a limit of real time influenced; a repetition with equal seed may have another outcome."""


class PlanRecords:
    """Writer of the records `plan.*`, which describe each plan from its search to its end."""

    def __init__(self, trace: Trace) -> None:
        self._trace = trace

    def asked(self, goal: str, version: int) -> None:
        """Record that a search for a plan begins, with the goal and the version of the knowledge base."""
        self._trace.record("plan.asked", goal=goal, version=version)

    def found(self, answer: PlanFound, name: str) -> None:
        """Record a new plan, and the engines that failed in the same race."""
        more: dict[str, Any] = {} if answer.reproducible else dict(_CUT_SHORT)
        if answer.failures:
            more["failures"] = [{"engine": one.engine, "message": one.message} for one in answer.failures]
        steps = [str(step) for step in answer.plan.steps]
        self._trace.record("plan.found", plot=name, steps=steps, engine=answer.engine, **more)

    def ordered(self, name: str, order: PartialOrder) -> None:
        """Record the steps and the causal links of a plan before its execution.

        A link consists of a provider, a fact and a user. Steps are numbered from 1. Provider 0 is the present world,
        and the user after the last step is the goal. Links from the present to the goal are omitted, since a goal may
        have many parts.
        """
        if not self._trace.heard:  # without a listener, skip the slow conversion of links to text
            self._trace.record("plan.ordered")
            return
        goal = len(order.steps) + 1
        kept = [link for link in order.links if (link.provider, link.user) != (PRESENT, goal)]
        links = sorted([link.user, link.provider, text_of(link.fact)] for link in kept)
        self._trace.record(
            "plan.ordered",
            plot=name,
            steps=[str(step) for step in order.steps],
            links=[[provider, fact, user] for user, provider, fact in links],
        )

    def overtaken(self, searches: int, why: str) -> None:
        """Record that the world has overtaken several searches, so that a plan begins that does not reach the goal."""
        self._trace.record("plan.overtaken", searches=searches, why=why)

    def none(self, kind: str, reason: str) -> None:
        """Record that a search ended without a plan."""
        self._trace.record("plan.none", kind=kind, reason=reason, **(_CUT_SHORT if kind == "timed_out" else {}))

    def broken(self, progress: PlanProgress, news: Broken) -> None:
        """Record that the remaining steps no longer lead to the goal, with the broken link and its author."""
        user = str(progress.steps[news.user - 1]) if news.user <= len(progress.steps) else "the goal"
        self._trace.record(
            "plan.broken",
            reason=news.why,
            link={"fact": news.needed, "step": news.user, "user": user},
            author=news.author,
            version=news.version,
            step=max(progress.running, default=1),
        )

    def replaced(self, old: str, new: str, kept: int) -> None:
        """Record that a new plan replaces a running plan and keeps the last `kept` steps of that plan."""
        self._trace.record("plan.replaced", plot=new, after=old, kept=kept)

    def resumed(self, old: str, new: str, step: PlanStep, why: str, instead_of: str | None) -> None:
        """Record that a plan resumes at a step; if `instead_of` is given, another candidate replaces it."""
        other = {} if instead_of is None else {"instead_of": instead_of}
        self._trace.record("plan.resumed", plot=new, after=old, step=str(step), why=why, **other)

    def skipped(self, name: str, steps: Iterable[PlanStep], why: str) -> None:
        """Record that the plan omits steps that the goal does not need."""
        self._trace.record("plan.skipped", plot=name, steps=[str(step) for step in steps], why=why)

    def unobserved(self, name: str, step: PlanStep, facts: Iterable[Expression]) -> None:
        """Record the expected effects of a step that do not hold some time after its end."""
        self._trace.record("plan.unobserved", plot=name, step=str(step), facts=[text_of(fact) for fact in facts])

    def failed(self, name: str, steps: Iterable[PlanStep], why: str) -> None:
        """Record that one of the running steps failed, and that a new plan is needed."""
        self._trace.record("plan.failed", plot=name, steps=[str(step) for step in steps], why=why)

    def waits(self, name: str, component: str, seconds: float) -> None:
        """Record that a failed plan waits for a component, for at most some seconds."""
        self._trace.record("plan.waits", plan=name, component=component, seconds=seconds)

    def gave_up(self, name: str, reason: str) -> None:
        """Record that the robot abandons the goal of the plan."""
        self._trace.record("plan.gave_up", plot=name, reason=reason)

    def excluded(self, step: PlanStep, seconds: float, why: str) -> None:
        """Record that new plans omit a step for some seconds."""
        self._trace.record("plan.excluded", step=str(step), seconds=seconds, why=why)

    def readmitted(self, steps: Iterable[PlanStep]) -> None:
        """Record that new plans may contain excluded steps again, since there is no plan without these steps."""
        self._trace.record("plan.readmitted", steps=sorted(str(step) for step in steps))

    def rejected(self, step: PlanStep | None, reason: str, engine: str) -> None:
        """Record that the simulation predicts the failure of a plan at a step, or at the goal if `step` is `None`."""
        self._trace.record("plan.rejected", step=None if step is None else str(step), reason=reason, engine=engine)

    def comparison(self, best: float, cost: float, without: PlanStep, engine: str) -> None:
        """Record an alternative plan without a step, and its cost in the simulation."""
        self._trace.record("plan.compared", best=best, cost=cost, without=str(without), engine=engine)

    def wrong(self, step: PlanStep | None, reason: str, engine: str) -> None:
        """Record a plan that fails at a step, or at the goal if `step` is `None`, in an unchanged world."""
        self._trace.record("plan.wrong", step=None if step is None else str(step), reason=reason, engine=engine)


def why_broken(broken: Mapping[str, Any]) -> str:
    """Return the data of a record `plan.broken` as a sentence."""
    link, author = broken["link"], broken["author"]
    if not link["fact"]:
        return f"the plan no longer leads to the goal: {broken['reason']} (version {broken['version']}, {author})"
    user = link["user"] if link["user"] == "the goal" else f"step {link['step']}, {link['user']},"
    return f"{link['fact']}, which {user} needs, does not hold since version {broken['version']} ({author})"
