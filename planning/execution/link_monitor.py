"""Monitor of the causal links of a plan's remaining steps, installed as conditions in the knowledge base (S4.2).

A change that affects no installed condition causes no computation. The monitor validates changes by the running step or
a rule when the next step begins. It validates changes by other authors immediately.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from knowledge_base.conditions.condition import Condition, Firing
from knowledge_base.errors import InputError
from knowledge_base.facts import Change
from knowledge_base.language.evaluation.lookups import conjuncts
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.expression import Atom, Expression
from knowledge_base.language.syntax.text import to_text
from knowledge_base.store import KnowledgeBase
from planning.analysis.validation import validate
from planning.execution.plan_ends import leads_to, shortest_end
from planning.execution.plan_progress import PlanProgress, is_true, thinned
from planning.generation.carried_steps import expectation
from planning.model.domain import PlanningDomain
from planning.model.plan import Plan, PlanStep

OWN_STEPS, EARLIER = "the steps before", "earlier"
"""Authors of changes that no other author has made: completed steps, and changes before the monitoring."""
OVERTAKING = "changes during the search"
"""Author of changes that overtook the search for a plan that begins without its goal."""


@dataclass(frozen=True, slots=True)
class Broken:
    """News that the remaining steps no longer lead to the goal.

    Attributes:
        why: the condition that does not hold when its step begins, in PDDL; for a later step, as a prediction.
        needed: the broken condition on the present world, as text; empty if no single condition is broken.
        user: the number of the first step that needs the condition; the number of steps plus one for the goal.
        author: the author of the change.
        version: the version of the knowledge base from which the condition is broken.
        foreseen: whether no condition is broken, but the simulation foresees that a step fails.
    """

    why: str
    needed: str
    user: int
    author: str
    version: int
    foreseen: bool = False

    @property
    def foreign(self) -> bool:
        """Whether another author has made the change during the plan."""
        return self.author not in {OWN_STEPS, EARLIER}


@dataclass(frozen=True, slots=True)
class Shorter:
    """News that fewer steps than the remaining ones lead to the goal."""

    steps: tuple[PlanStep, ...]


@dataclass(frozen=True, slots=True)
class GoalReached:
    """News that the goal holds before the last step."""

    author: str


News = Broken | Shorter | GoalReached


def news_form(news: News) -> dict[str, Any]:
    """Return the news as plain data."""
    match news:
        case Broken():
            return {"broken": asdict(news)}
        case Shorter(steps):
            return {"shorter": [step.to_json() for step in steps]}
        case GoalReached(author):
            return {"reached": author}


def news_from(form: Mapping[str, Any]) -> News:
    """Return the news that `news_form` wrote as `form`."""
    ((kind, said),) = form.items()
    if kind == "broken":
        return Broken(**said)
    return GoalReached(said) if kind == "reached" else Shorter(tuple(map(PlanStep.from_json, said)))


class LinkMonitor:
    """Observer of the causal links of one plan, until `close`.

    Args:
        progress: the progress of the plan. The caller that begins a step there must then call `look`.
        domain, knowledge: the planning domain and the knowledge base.
        is_own: returns whether a change by this author is an effect of the running step.
        receive: receives the news of a change, during the commit of the change.
    """

    def __init__(
        self,
        progress: PlanProgress,
        domain: PlanningDomain,
        knowledge: KnowledgeBase,
        is_own: Callable[[str], bool],
        receive: Callable[[News], None],
    ) -> None:
        self._progress = progress
        self._domain = domain
        self._knowledge = knowledge
        self._is_own = is_own
        self._receive = receive
        self._links: dict[Expression, Condition] = {}
        self._to_come: dict[Expression, Condition] = {}
        self._brought: dict[PlanStep, list[Expression]] = {}
        self._whole: Callable[[], None] = lambda: None
        self._is_broken = False
        self._goal = self._install(progress.goal, self._goal_fired)

    def look_first(self) -> None:
        """Validate the plan when monitoring begins; the effects of a running step may already hold."""
        progress = self._progress
        if progress.running and leads_to(progress.coming(), self._domain, self._knowledge, progress.goal):
            self.update()
        else:
            self.look(EARLIER)

    def look(self, author: str) -> None:
        """Validate all remaining steps after a change by `author`, and report news if there are any."""
        self.update()
        progress, world = self._progress, self._knowledge
        if is_true(progress.goal, world):
            self._receive(GoalReached(author))
        elif len(progress.running) > 1:  # a shorter plan interrupts no step
            if not progress.is_valid(world):
                self._receive(self._broken(author, world.version))
        else:
            end = shortest_end(progress.remaining_steps, self._domain, world, progress.goal)
            if end is None:
                self._receive(self._broken(author, world.version))
                return
            if progress.early:
                progress.early = False
                end = thinned(end, self._domain, world, progress.goal)
            if len(end) < len(progress.remaining):
                self._receive(Shorter(end))

    def close(self) -> None:
        """Cancel all installed conditions."""
        self._whole()
        for condition in (*self._links.values(), *self._to_come.values(), self._goal):
            if condition is not None:
                condition.cancel()
        self._links, self._to_come, self._goal = {}, {}, None

    def update(self) -> None:
        """Install the conditions that the plan needs now, and effects of later steps that another author may cause."""
        progress = self._progress
        needed, later = progress.needed(), progress.needed_later()
        self._whole()
        if needed is None or later is None:
            self._whole = self._knowledge.subscribe(self._changed)
            needed = later = {}
        self._keep(self._links, {**later, **needed}, self._link_fired)
        bring = (part for step in progress.coming() for part in self._brings(step))
        fresh = [fact for fact in bring if fact not in self._links and not is_true(fact, self._knowledge)]
        self._keep(self._to_come, dict.fromkeys(fresh), self._came)

    def _brings(self, step: PlanStep) -> list[Expression]:
        """Return the facts that a step adds in every world; equal objects each time, whose tests are compiled once."""
        if step not in self._brought:
            parts = conjuncts(_expectation_of(step, self._domain))
            self._brought[step] = [part for part in parts if isinstance(part, Atom)]
        return self._brought[step]

    def _keep(
        self,
        kept: dict[Expression, Condition],
        wanted: dict[Expression, int] | dict[Expression, None],
        fired: Callable[[Expression, Firing], None],
    ) -> None:
        for condition in [one for one in kept if one not in wanted]:
            kept.pop(condition).cancel()
        for condition in wanted:
            if condition not in kept:
                installed = self._install(condition, fired)
                if installed is not None:
                    kept[condition] = installed

    def _install(self, e: Expression, fired: Callable[[Expression, Firing], None]) -> Condition | None:
        try:
            condition = self._knowledge.install(e)
        except InputError:  # the condition contains a missing object, so it stays false
            return None
        condition.subscribe(lambda firing: fired(e, firing), falls=True)
        return condition

    def _foreign(self, firing: Firing) -> str | None:
        """Return the author of the change; `None` if the change is an effect of the running step."""
        (change,) = self._knowledge.changes(since=firing.version - 1, until=firing.version)
        return None if self._is_own(change.author) else change.author

    def _goal_fired(self, _: Expression, firing: Firing) -> None:
        author = self._foreign(firing) if firing.truth else None
        if author is not None:
            self._receive(GoalReached(author))

    def _came(self, _: Expression, firing: Firing) -> None:
        if firing.truth and self._foreign(firing) is not None:
            self._progress.early = True

    def _link_fired(self, e: Expression, firing: Firing) -> None:
        author = None if firing.truth else self._foreign(firing)
        if author is None or is_true(
            self._progress.goal, self._knowledge
        ):  # the condition of the goal reports a reached goal
            return
        progress = self._progress
        later = e in (progress.needed() or {}) and e in (progress.needed_later() or {})
        if later and self._is_broken:  # one change may break many links
            return
        world = self._knowledge.snapshot()  # reads of a snapshot need no lock
        if later:
            # Effects of the running step do not matter here, because a later step may become the next step.
            if shortest_end(progress.coming(), self._domain, world, progress.goal) is None:
                self._receive(self._broken(author, firing.version, e))
        elif not progress.is_valid(world):  # the change breaks the running step
            end = shortest_end(progress.coming(), self._domain, world, progress.goal)
            self._receive(self._broken(author, firing.version, e) if end is None else Shorter(end))

    def _changed(self, change: Change) -> None:
        if not self._is_own(change.author) and not self._progress.is_valid(self._knowledge):
            self._receive(self._broken(change.author, change.version))

    def _broken(self, author: str, version: int, fallen: Expression | None = None) -> Broken:
        progress, world = self._progress, self._knowledge.snapshot()
        self._is_broken = True
        now, later = progress.needed() or {}, progress.needed_later() or {}
        if fallen is None:
            fallen = next((one for one in itertools.chain(now, later) if not is_true(one, world)), None)
        why = self._predict_failure(world)
        if fallen is None:
            return Broken(why, "", len(progress.steps) + 1, author, version)
        return Broken(why, to_text(fallen), now.get(fallen) or later[fallen], author, version)

    def _predict_failure(self, world: World) -> str:
        """Return the first condition that fails, with the later step for which its failure is predicted."""
        progress, left = self._progress, self._not_done(world)
        found = validate(Plan(progress.steps_of(left)), self._domain, world, progress.goal)
        if found.failing_step is None:
            return f"after the last step: {found.why}" if left else found.why
        number = left[found.failing_step]
        return f"before step {number}, {progress.steps[number - 1]}: {found.why}" if found.failing_step else found.why

    def _not_done(self, world: World) -> tuple[int, ...]:
        """Return the numbers of the remaining steps, without running steps whose expected effects already hold."""
        progress = self._progress
        done = [n for n in progress.running if is_true(_expectation_of(progress.steps[n - 1], self._domain), world)]
        return tuple([number for number in progress.remaining if number not in done])


def _expectation_of(step: PlanStep, domain: PlanningDomain) -> Expression:
    return expectation(domain.action(step).effect, domain.bindings(step))
