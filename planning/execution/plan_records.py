"""PlanRecords writes the records `plan.*` of a trace; `why_broken` puts one into a sentence."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from knowledge_base.language.syntax.expression import Expression
from knowledge_base.language.syntax.identity_cache import IdentityCache
from knowledge_base.language.syntax.text import to_text
from planning.ordering.partial_order import PRESENT

if TYPE_CHECKING:
    from dsc.trace import Trace
    from planning.execution.monitor import Broken
    from planning.execution.plan_progress import PlanProgress
    from planning.ordering.partial_order import PartialOrder
    from planning.plan import PlanFound, PlanStep

_CUT_SHORT = {"reproducible": False}
"""A mark for answers that a limit of real time influenced: the same seed may give another run."""


class PlanRecords:
    """Writes the life of plans into a trace."""

    def __init__(self, trace: Trace) -> None:
        self._trace = trace

    def asked(self, goal: str, version: int) -> None:
        """Record the start of a search."""
        self._trace.record("plan.asked", goal=goal, version=version)

    def found(self, answer: PlanFound, name: str) -> None:
        """Record a plan, and the engines that failed in the same race."""
        more: dict[str, Any] = {} if answer.reproducible else dict(_CUT_SHORT)
        if answer.failures:
            more["failures"] = [{"engine": one.engine, "message": one.message} for one in answer.failures]
        steps = [str(step) for step in answer.plan.steps]
        self._trace.record("plan.found", plot=name, steps=steps, engine=answer.engine, **more)

    def ordered(self, name: str, order: PartialOrder) -> None:
        """Record the steps and the causal links of a plan that is about to run.

        A link has a provider, a fact and a user; steps count from 1. Provider 0 is the present world, and the user
        after the last step is the goal. Links from 0 to the goal are omitted, since a goal may have many parts.
        """
        if not self._trace.heard:  # the texts of all links take a while
            self._trace.record("plan.ordered")
            return
        goal = len(order.steps) + 1
        kept = [link for link in order.links if (link.provider, link.user) != (PRESENT, goal)]
        links = sorted([link.user, link.provider, _text(link.fact)] for link in kept)
        self._trace.record(
            "plan.ordered",
            plot=name,
            steps=[str(step) for step in order.steps],
            links=[[provider, fact, user] for user, provider, fact in links],
        )

    def none(self, kind: str, reason: str) -> None:
        """Record a search without a plan."""
        self._trace.record("plan.none", kind=kind, reason=reason, **(_CUT_SHORT if kind == "timed_out" else {}))

    def broken(self, progress: PlanProgress, news: Broken) -> None:
        """Record that the remaining steps no longer lead to the goal, with the broken link and the author."""
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
        """Record that a new plan replaces a running one, whose last `kept` steps it keeps."""
        self._trace.record("plan.replaced", plot=new, after=old, kept=kept)

    def resumed(self, old: str, new: str, step: PlanStep, why: str, instead_of: str | None) -> None:
        """Record that a plan resumes at a step, with another candidate than `instead_of` if one fits."""
        other = {} if instead_of is None else {"instead_of": instead_of}
        self._trace.record("plan.resumed", plot=new, after=old, step=str(step), why=why, **other)

    def skipped(self, name: str, steps: Iterable[PlanStep], why: str) -> None:
        """Record skipped steps, which the goal does not need."""
        self._trace.record("plan.skipped", plot=name, steps=[str(step) for step in steps], why=why)

    def gave_up(self, name: str, reason: str) -> None:
        """Record that the goal is abandoned."""
        self._trace.record("plan.gave_up", plot=name, reason=reason)

    def excluded(self, step: PlanStep, seconds: float, why: str) -> None:
        """Record that new plans omit a step for some seconds."""
        self._trace.record("plan.excluded", step=str(step), seconds=seconds, why=why)

    def readmitted(self, steps: Iterable[PlanStep]) -> None:
        """Record that new plans may use excluded steps again, since none exists without them."""
        self._trace.record("plan.readmitted", steps=sorted(str(step) for step in steps))

    def rejected(self, step: PlanStep | None, reason: str, engine: str) -> None:
        """Record that the simulation predicts the failure of a plan, at a step."""
        self._trace.record("plan.rejected", step=None if step is None else str(step), reason=reason, engine=engine)


_texts: IdentityCache[Expression, str] = IdentityCache()


def _text(fact: Expression) -> str:
    """Kept by identity: successive plans share most of their steps, and these their conditions."""
    return _texts.find(fact, None) or _texts.keep(fact, None, to_text(fact))


def why_broken(broken: Mapping[str, Any]) -> str:
    """Explain the record `plan.broken` in a sentence, from its data."""
    link, author = broken["link"], broken["author"]
    if not link["fact"]:
        return f"the plan no longer leads to the goal: {broken['reason']} (version {broken['version']}, {author})"
    user = link["user"] if link["user"] == "the goal" else f"step {link['step']}, {link['user']},"
    return f"{link['fact']}, which {user} needs, does not hold since version {broken['version']} ({author})"
