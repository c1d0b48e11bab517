"""What happens to plans, as records of the trace (`plan.*`) and in sentences for people."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any

from knowledge_base.language.expression import Expression
from knowledge_base.language.identity_cache import IdentityCache
from knowledge_base.language.printer import to_text
from planning.ordering.partial_order import PRESENT

if TYPE_CHECKING:
    from dsc.trace import Trace
    from planning.execution.monitor import Broken
    from planning.execution.progress import PlanProgress
    from planning.ordering.partial_order import PartialOrder
    from planning.plan import PlanFound, PlanStep

_CUT_SHORT = {"reproducible": False}
"""Said where a limit of real time had a part: the same seed may then give another run."""


class PlanRecords:
    """Writes what happens to plans into a trace."""

    def __init__(self, trace: Trace) -> None:
        self._trace = trace

    def asked(self, goal: str, version: int) -> None:
        """A plan is looked for."""
        self._trace.record("plan.asked", goal=goal, version=version)

    def found(self, answer: PlanFound, name: str) -> None:
        """There is a plan; engines that were asked as well and failed are named."""
        more: dict[str, Any] = {} if answer.reproducible else dict(_CUT_SHORT)
        if answer.failures:
            more["failures"] = [{"engine": one.engine, "message": one.message} for one in answer.failures]
        steps = [str(step) for step in answer.plan.steps]
        self._trace.record("plan.found", plot=name, steps=steps, engine=answer.engine, **more)

    def ordered(self, name: str, order: PartialOrder) -> None:
        """The plan of that name is going to be carried out: its steps, and its causal links.

        A link says which step, from 1, brings about what for which; 0 is what holds already, one past the last the
        goal. What holds already and only the goal needs is left out: it may be as much as the goal has parts.
        """
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
        """There is none."""
        self._trace.record("plan.none", kind=kind, reason=reason, **(_CUT_SHORT if kind == "timed_out" else {}))

    def broken(self, progress: PlanProgress, news: Broken) -> None:
        """What is left of a plan does not lead to the goal any more: who changed what that which step needs."""
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
        """A new plan takes the place of one on its way, whose last `kept` steps it keeps."""
        self._trace.record("plan.replaced", plot=new, after=old, kept=kept)

    def resumed(self, old: str, new: str, step: PlanStep, why: str, instead_of: str | None) -> None:
        """The same plan goes on at a step; not with the candidate `instead_of` if there is another one that fits."""
        other = {} if instead_of is None else {"instead_of": instead_of}
        self._trace.record("plan.resumed", plot=new, after=old, step=str(step), why=why, **other)

    def skipped(self, name: str, steps: Iterable[PlanStep], why: str) -> None:
        """Steps of the plan of that name are left out since the goal is reached without them."""
        self._trace.record("plan.skipped", plot=name, steps=[str(step) for step in steps], why=why)

    def gave_up(self, name: str, reason: str) -> None:
        """No plan is tried any more."""
        self._trace.record("plan.gave_up", plot=name, reason=reason)

    def excluded(self, step: PlanStep, seconds: float, why: str) -> None:
        """New plans do without a step for a while."""
        self._trace.record("plan.excluded", step=str(step), seconds=seconds, why=why)

    def readmitted(self, steps: Iterable[PlanStep]) -> None:
        """There is no plan without these steps."""
        self._trace.record("plan.readmitted", steps=sorted(str(step) for step in steps))

    def rejected(self, step: PlanStep | None, reason: str, engine: str) -> None:
        """The simulation foresees that a plan fails, at a step."""
        self._trace.record("plan.rejected", step=None if step is None else str(step), reason=reason, engine=engine)


_texts: IdentityCache[Expression, str] = IdentityCache()


def _text(fact: Expression) -> str:
    """Kept by identity: plans one after the other have most of their steps in common, and these their conditions."""
    return _texts.find(fact, None) or _texts.keep(fact, None, to_text(fact))


def why_broken(broken: Mapping[str, Any]) -> str:
    """In a sentence: why a plan was given up, from the data of its record `plan.broken`."""
    link, author = broken["link"], broken["author"]
    if not link["fact"]:
        return f"the plan no longer leads to the goal: {broken['reason']} (version {broken['version']}, {author})"
    user = link["user"] if link["user"] == "the goal" else f"step {link['step']}, {link['user']},"
    return f"{link['fact']}, which {user} needs, does not hold since version {broken['version']} ({author})"
