"""Escalation: the handling of a failed plan by one `EscalationStep` after another (S1.4)."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dsc.dynamic.rule_expansion import NO_CANDIDATE_FITS
from knowledge_base.language.evaluation.lookups import conjuncts
from knowledge_base.language.syntax.effect import effect_conditions
from knowledge_base.language.syntax.expression import Expression, Not
from knowledge_base.language.syntax.rewriting import names_of
from knowledge_base.language.syntax.text import to_text
from knowledge_base.owner_cache import cache_on_owner
from planning.execution.attempt import EscalationStep, Failure
from planning.execution.outcomes import GaveUp, GoalHolds, PlotFound, Repaired, Replan
from planning.execution.plan_ends import shortest_end
from planning.execution.plan_progress import PlanProgress, is_true
from planning.execution.plan_run import PlanRun, PlanState
from planning.execution.plan_runs import PlanRuns
from planning.generation.carried_steps import expectation, implementing
from planning.generation.control_flow import NOT_OBSERVED
from planning.model.plan import Plan, PlanStep
from planning.ordering.causal_tracing import deordered
from planning.ordering.partial_order import PartialOrder
from planning.problem.relevance import relevant

if TYPE_CHECKING:
    from knowledge_base.store import KnowledgeBase
    from knowledge_base.view import View
    from planning.execution.choices import Choices
    from planning.execution.plan_records import PlanRecords
    from planning.execution.plotting import Plotting
    from planning.execution.search import Search
    from planning.model.domain import PlanningDomain

_MOST_GOALS = 8


@dataclass(frozen=True, slots=True)
class Escalation:
    """Handler of failed plans: continues the plan without a planner call, requests a new plan, or abandons the goal.

    Attributes:
        plotting, runs, choices, search, records: objects of the planning component.
    """

    plotting: Plotting
    runs: PlanRuns
    choices: Choices
    search: Search
    records: PlanRecords

    @property
    def _knowledge(self) -> KnowledgeBase:
        return self.plotting.knowledge

    async def answer(self, run: PlanRun, why: str, *, outage: bool = False) -> Repaired:
        """Handle the failure of a plan; `outage` tells whether a device has failed, and not the step.

        Returns:
            The outcome of the skill `repair`.
        """
        ordered = await self._order(run)
        if self._end_if_reached(run):
            return GoalHolds()
        progress, attempt = run.progress, run.attempt
        if why.startswith(NOT_OBSERVED):
            why += self._record_unobserved(run)
        elif why == NO_CANDIDATE_FITS and self.choices.refusals:
            why += f" ({'; '.join(self.choices.refusals)})"
        end = self._end(run)
        failed = None if run.state is PlanState.STOPPED else self._failed_step(progress)
        if end is not None and (run.successor is not None if failed is None else failed not in end):
            attempt.completed()
            return self._continue_with(run, end, why, ordered=ordered)
        step, choice = self._chosen(run, failed, end, why, outage=outage)
        if step is EscalationStep.REPLAN and run.state is PlanState.MONITORED:
            self.records.failed(run.name, progress.steps_of(progress.running), why)
        if end is not None and step in (EscalationStep.RESUME, EscalationStep.OTHER_CANDIDATE):
            attempt.resumed[end[0]] += 1
            instead_of = choice if step is EscalationStep.OTHER_CANDIDATE else None
            return self._continue_with(run, end, why, instead_of, ordered=ordered)
        if step is EscalationStep.GIVE_UP:
            remedy = self._remedy(failed) if failed is not None and why.startswith(NOT_OBSERVED) else ""
            reason = f"{failed} has failed before, in the same way and the same situation: {why}{remedy}"
            return self._abandon(run, reason)
        disturbed = run.disturbed or (failed is None and run.successor is not None)
        if not attempt.replan(run.replans, disturbed=disturbed):
            used = f"the budget of {run.replans} new plans is used up"
            ended = f"changes by others ended {run.replans} plans before a step was completed"
            return self._abandon(run, f"{ended if disturbed else used}: {why}")
        if step is EscalationStep.EXCLUDE and failed is not None:
            self.search.exclude(failed, why)
        return Replan()

    def succeeded(self, run: PlanRun, why: str) -> GoalHolds | PlotFound | None:
        """Return the outcome with the successor's plot; `None` if the successor no longer leads to the goal."""
        if self._end_if_reached(run):
            return GoalHolds()
        end = self._end(run)
        return None if end is None else self._continue_with(run, end, why, keeping=True)

    def bound(self, run: PlanRun, order: PartialOrder, form: dict[str, Any]) -> PlotFound:
        """Add a plan run and record the order of its steps; return the outcome that contains its plot."""
        self.runs.add(run)
        self.records.ordered(run.name, order)
        return PlotFound(plot=form, name=run.name, steps=len(run.progress.steps))

    def _end_if_reached(self, run: PlanRun) -> bool:
        """Return whether the goal holds; delete the plan run if it does."""
        if self.plotting.derivation.recursive:
            run.renew(self.plotting.derivation.at(self._knowledge))
        reached = is_true(run.progress.goal, self._knowledge)
        if reached:
            self.runs.conclude(run.task)
            self.runs.over(run.name)
        return reached

    def _end(self, run: PlanRun) -> tuple[PlanStep, ...] | None:
        """Return the fewest last steps of the successor, or of the plan without one, that lead to the goal.

        `None` if there are none, or if the simulation foresees that the plan fails.
        """
        world, progress = self._knowledge.snapshot(), run.progress  # reads of a snapshot need no lock
        if run.successor is None:
            return None if run.rejected else progress.shortest_end(world)
        return shortest_end(run.successor.steps, progress.domain, world, progress.goal)

    def _chosen(
        self, run: PlanRun, failed: PlanStep | None, end: tuple[PlanStep, ...] | None, why: str, *, outage: bool
    ) -> tuple[EscalationStep, str | None]:
        """Return the escalation step, and the plot that was chosen for the failed plan step."""
        attempt, progress = run.attempt, run.progress
        if failed is None:
            return attempt.interrupted(end[0] if end else None), None
        choice = self.choices.of(failed)
        others = choice is not None and len(implementing(failed, self.plotting.library)) > 1
        failure = Failure(failed, why, situation(progress.domain, self._knowledge, progress.goal))
        return attempt.failed(failure, is_valid=end is not None, others=others, outage=outage), choice

    def _failed_step(self, progress: PlanProgress) -> PlanStep | None:
        """Return the running step; `None` if its expected effects hold, or if several steps are running."""
        if len(progress.running) != 1:
            return None
        step, domain = progress.steps[progress.running[0] - 1], self.plotting.derivation.domain
        expected = expectation(domain.action(step).effect, domain.bindings(step))
        return None if is_true(expected, self._knowledge) else step

    def _record_unobserved(self, run: PlanRun) -> str:
        """Record the expected effects of running steps that do not hold, and return them as text."""
        domain, missing = self.plotting.derivation.domain, list[str]()
        for step in run.progress.steps_of(run.progress.running):
            expected = conjuncts(expectation(domain.action(step).effect, domain.bindings(step)))
            facts = [one for one in expected if not is_true(one, self._knowledge)]
            if facts:
                self.records.unobserved(run.name, step, facts)
            missing += map(_as_missing, facts)
        return f": {', '.join(missing)}" if missing else ""

    def _remedy(self, failed: PlanStep) -> str:
        name = self.choices.of(failed)
        if name is None:
            return ""
        place = self.plotting.library.plot(name).place(("plot",))
        where = f" ({place})" if place is not None and place.source else ""
        return f"; let its skill observe the effect, or give plot '{name}'{where} `tell` or `effects: assumed`"

    def _continue_with(
        self,
        run: PlanRun,
        steps: tuple[PlanStep, ...],
        why: str,
        instead_of: str | None = None,
        *,
        keeping: bool = False,
        ordered: PartialOrder | None = None,
    ) -> PlotFound:
        """Continue with `steps` without a planner call.

        Args:
            run: the plan that is replaced.
            steps: the steps of the new plan.
            why: the reason.
            instead_of: the candidate that the first step tries last.
            keeping: whether running steps with which the new plan begins continue.
            ordered: the partial order of a plan that may have the steps.
        """
        name = self._record_change(run, steps, why, instead_of)
        found = None if run.successor is None else run.successor.found
        known = None if found is None else found.known_order(steps, self._knowledge.version)
        if known is None and ordered is not None and ordered.steps == steps:
            known = ordered
        progress = None if found is None else found.known_progress(steps, self._knowledge.version)
        progress = progress or PlanProgress(steps, run.progress.domain, run.progress.goal)
        running = len(run.continuing(steps)) if keeping else 0
        again = PlanRun(
            name, run.goal, progress, run.attempt, run.holder, run.seconds, run.replans, replaces=run.name,
            labels=run.labels_for(steps) if keeping else (),
        )  # fmt: skip
        order, form = self.plotting.plotted(again, Plan(steps), known, instead_of, running)
        if keeping:
            again.take_over(run, running)
        return self.bound(again, order, form)

    async def _order(self, run: PlanRun) -> PartialOrder | None:
        """Return the partial order of the last steps that lead to the goal, computed outside of the event loop.

        `None` if no steps lead to the goal, or if the successor knows its order.
        """
        end, version = self._end(run), self._knowledge.version
        found = None if run.successor is None else run.successor.found
        if not end or (found is not None and found.known_order(end, version) is not None):
            return None
        domain, world = self.plotting.derivation.original, self._knowledge.snapshot()
        order = await self.search.aside(lambda: deordered(Plan(end), domain, world, run.goal))
        return order if self._knowledge.version == version else None

    def _record_change(self, run: PlanRun, steps: tuple[PlanStep, ...], why: str, instead_of: str | None) -> str:
        """Record why other steps continue a plan, and return the name of their plot."""
        successor, remaining = run.successor, run.progress.remaining_steps
        if successor is not None and successor.name is not None:
            self.records.replaced(run.name, successor.name, successor.kept)
            return successor.name
        name = self.runs.new_name()
        if successor is not None:
            return name  # monitoring has already recorded the shorter plan
        if len(steps) < len(remaining):
            self.records.skipped(run.name, [step for step in remaining if step not in steps], why)
        else:
            self.records.resumed(run.name, name, steps[0], why, instead_of)
        return name

    def _abandon(self, run: PlanRun, reason: str) -> GaveUp:
        self.runs.conclude(run.task)
        self.runs.over(run.name)
        self.records.gave_up(run.name, reason)
        return GaveUp(reason=reason)


def _as_missing(fact: Expression) -> str:
    return f"{to_text(fact.body)} is still true" if isinstance(fact, Not) else f"{to_text(fact)} is false"


def situation(domain: PlanningDomain, world: View, goal: Expression) -> str:
    """Return a digest of the facts, numbers and objects on which the problem of reaching the goal depends."""
    names = _asked_about(domain, goal)
    facts = sorted(str(fact) for fact in world.facts() if fact.predicate in names)
    numbers = sorted((str(number), value) for number, value in world.values().items() if number.predicate in names)
    told = repr((sorted(world.nodes().items()), facts, numbers))
    return hashlib.blake2b(told.encode(), digest_size=16).hexdigest()


@cache_on_owner
def _names_by_goal(domain: PlanningDomain) -> dict[Expression, frozenset[str]]:  # noqa: ARG001  its owner
    """Return, for each goal, the predicates and functions on which its plans depend."""
    return {}


def _asked_about(domain: PlanningDomain, goal: Expression) -> frozenset[str]:
    known = _names_by_goal(domain)
    names = known.get(goal)
    if names is None:
        if len(known) >= _MOST_GOALS:
            known.clear()
        names = known[goal] = _names_about(domain, goal)
    return names


def _names_about(domain: PlanningDomain, goal: Expression) -> frozenset[str]:
    actions = relevant(goal, None, domain.actions.values()).actions
    asked = [goal, *(action.precondition for action in actions)]
    asked += [condition for action in actions for condition in effect_conditions(action.effect)]
    return frozenset(name for condition in asked for name in names_of(condition))
