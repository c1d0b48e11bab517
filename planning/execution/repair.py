"""Escalation, which handles a failed plan by one `EscalationStep` after another, and the plots of plans."""

from __future__ import annotations

import hashlib
from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from dsc.dynamic.rule_expansion import NO_CANDIDATE_FITS
from knowledge_base.language.evaluation.lookups import conjuncts
from knowledge_base.language.syntax.effect import effect_conditions
from knowledge_base.language.syntax.expression import Expression, Not
from knowledge_base.language.syntax.identity_cache import IdentityCache
from knowledge_base.language.syntax.rewriting import names_of
from knowledge_base.language.syntax.text import to_text
from planning.execution.outcomes import GaveUp, GoalHolds, PlotFound, Repaired, Replan
from planning.execution.plan_ends import shortest_end
from planning.execution.plan_progress import PlanProgress, is_true
from planning.execution.plan_run import EscalationStep, Failure, PlanRun, PlanRuns, PlanState
from planning.generation.carried_steps import expectation, implementing
from planning.generation.control_flow import NOT_OBSERVED
from planning.generation.plan_to_plot import laid_out, plot_of
from planning.ordering.causal_tracing import deordered
from planning.ordering.partial_order import PartialOrder, in_sequence
from planning.ordering.timed_links import linked
from planning.plan import Plan, PlanStep
from planning.problem.relevance import relevant

if TYPE_CHECKING:
    from dsc.dynamic.library import Library
    from dsc.engine.steps import Step
    from knowledge_base.store import KnowledgeBase
    from knowledge_base.view import View
    from planning.domain import PlanningDomain
    from planning.execution.plan_records import PlanRecords
    from planning.execution.search import Search
    from planning.problem.derived import Derivation


class Choices:
    """The last chosen plot for each plan step, so that another candidate can be tried after a failure.

    Args:
        domain: the planning domain.
        library: the plots.

    Attributes:
        refusals: the candidates of the last decision that chose none, with the reasons.
    """

    def __init__(self, domain: PlanningDomain, library: Library) -> None:
        self._domain = domain
        self._library = library
        self.refusals: list[str] = []
        self._chosen: dict[tuple[str, frozenset[tuple[str, Any]]], str] = {}

    def note(self, step: Step) -> None:
        """Store the choices of a macrostep."""
        for made in step.decisions:
            decision = made.decision
            if decision.chosen is None:
                self.refusals = [f"{one.plot}: {one.reason}" for one in decision.verdicts if not one.fits]
            plot = None if decision.chosen is None else self._library.plot(decision.chosen)
            if plot is not None and plot.implements:
                self._chosen[plot.implements, frozenset(decision.arguments.items())] = plot.name

    def of(self, step: PlanStep) -> str | None:
        """Return the name of the last plot that was chosen for a step, or `None`."""
        bindings = self._domain.bindings(step)
        for plot in implementing(step, self._library):
            own = frozenset((name, value) for name, value in bindings.items() if name in plot.parameters)
            if (step.action, own) in self._chosen:
                return self._chosen[step.action, own]
        return None

    def remember(self) -> list[Any]:
        """Return the choices as plain data."""
        return [[action, dict(sorted(arguments)), plot] for (action, arguments), plot in self._chosen.items()]

    def recall(self, memory: Iterable[Any]) -> None:
        """Restore the choices that `remember` returned."""
        self._chosen = {(action, frozenset(arguments.items())): plot for action, arguments, plot in memory}


@dataclass(frozen=True, slots=True)
class Plotting:
    """Generator of the plots of plans.

    Attributes:
        derivation: the derivation of the planning domain.
        library: the plots that implement planning actions, and the plots whose rules are inherited.
        knowledge: the knowledge base with the present world.
        parallel: whether independent steps are executed in parallel.
        shared: names of components that can execute several skills concurrently.
    """

    derivation: Derivation
    library: Library
    knowledge: KnowledgeBase
    parallel: bool
    shared: Collection[str]

    def plotted(
        self,
        run: PlanRun,
        plan: Plan,
        known: PartialOrder | None = None,
        instead_of: str | None = None,
        running: int = 0,
    ) -> tuple[PartialOrder, dict[str, Any]]:
        """Return the partial order of a plan's steps and the plot of the plan as data; set the order of `run.progress`.

        Args:
            run: the plan in execution.
            plan: the steps, possibly with a schedule.
            known: the partial order of the steps; this method computes the order if `known` is omitted.
            instead_of: the candidate that the first step must try last.
            running: the number of first steps that are running already, in parallel.
        """
        order = self._order(plan, run.goal, known)
        if running:
            order = order.begun(running)
        rules = self.library.plot(run.holder).rules if run.holder in self.library else ()
        plan = Plan(plan.steps)
        layout = laid_out(plan, run.progress.domain, self.library, rules, order, self.shared)
        run.progress.take_order(layout.before)
        plot = plot_of(plan, layout, run.name, watched=True, labels=run.labels, running=running)
        self.library.expect(plot)
        form = plot.to_form()
        if instead_of is not None:
            state: Any = form
            for key in next(path for name, _, path in plot.walk() if name == "step_1"):
                state = state[key]
            state["dynamic"].sort(key=lambda name: name == instead_of)  # stable: the other candidates keep their order
        return order, form

    def _order(self, plan: Plan, goal: Expression, known: PartialOrder | None) -> PartialOrder:
        if plan.schedule:
            return linked(plan, self.derivation.original, self.knowledge, goal)
        order = known or deordered(plan, self.derivation.original, self.knowledge, goal)
        return order if self.parallel else replace(order, before=in_sequence(plan).before)


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
        ordered = await self._ordered(run)
        if self._reached(run):
            return GoalHolds()
        progress, attempt = run.progress, run.attempt
        if why.startswith(NOT_OBSERVED):
            why += self._unobserved(run)
        elif why == NO_CANDIDATE_FITS and self.choices.refusals:
            why += f" ({'; '.join(self.choices.refusals)})"
        end = self._end(run)
        failed = None if run.state is PlanState.STOPPED else self._failed_step(progress)
        if end is not None and (run.successor is not None if failed is None else failed not in end):
            attempt.completed()
            return self._continued(run, end, why, ordered=ordered)
        step, choice = self._chosen(run, failed, end, why, outage=outage)
        if step is EscalationStep.REPLAN and run.state is PlanState.MONITORED:
            self.records.failed(run.name, progress.steps_of(progress.running), why)
        if end is not None and step in (EscalationStep.RESUME, EscalationStep.OTHER_CANDIDATE):
            attempt.resumed[end[0]] += 1
            instead_of = choice if step is EscalationStep.OTHER_CANDIDATE else None
            return self._continued(run, end, why, instead_of, ordered=ordered)
        if step is EscalationStep.GIVE_UP:
            remedy = self._remedy(failed) if failed is not None and why.startswith(NOT_OBSERVED) else ""
            reason = f"{failed} has failed before, in the same way and the same situation: {why}{remedy}"
            return self._give_up(run, reason)
        disturbed = run.disturbed or (failed is None and run.successor is not None)
        if not attempt.replan(run.replans, disturbed=disturbed):
            used = f"the budget of {run.replans} new plans is used up"
            ended = f"changes by others ended {run.replans} plans before a step was completed"
            return self._give_up(run, f"{ended if disturbed else used}: {why}")
        if step is EscalationStep.EXCLUDE and failed is not None:
            self.search.exclude(failed, why)
        return Replan()

    def succeeded(self, run: PlanRun, why: str) -> GoalHolds | PlotFound | None:
        """Return the outcome with the successor's plot; `None` if the successor no longer leads to the goal."""
        if self._reached(run):
            return GoalHolds()
        end = self._end(run)
        return None if end is None else self._continued(run, end, why, keeping=True)

    def bound(self, run: PlanRun, order: PartialOrder, form: dict[str, Any]) -> PlotFound:
        """Add a plan run and record the order of its steps; return the outcome that contains its plot."""
        self.runs.add(run)
        self.records.ordered(run.name, order)
        return PlotFound(plot=form, name=run.name, steps=len(run.progress.steps))

    def _reached(self, run: PlanRun) -> bool:
        """Return whether the goal holds; delete the plan run if it does."""
        if self.plotting.derivation.recursive:
            run.renew(self.plotting.derivation.at(self._knowledge))
        reached = is_true(run.progress.goal, self._knowledge)
        if reached:
            self.runs.conclude(run.task)
            self.runs.over(run.name)
        return reached

    def _end(self, run: PlanRun) -> tuple[PlanStep, ...] | None:
        """Return the fewest last steps of the successor, or of the plan without one, that lead to the goal."""
        world, progress = self._knowledge.snapshot(), run.progress  # reads of a snapshot need no lock
        if run.successor is None:
            return progress.shortest_end(world)
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
        return attempt.failed(failure, stands=end is not None, others=others, outage=outage), choice

    def _failed_step(self, progress: PlanProgress) -> PlanStep | None:
        """Return the running step; `None` if its expected effects hold, or if several steps are running."""
        if len(progress.running) != 1:
            return None
        step, domain = progress.steps[progress.running[0] - 1], self.plotting.derivation.domain
        expected = expectation(domain.action(step).effect, domain.bindings(step))
        return None if is_true(expected, self._knowledge) else step

    def _unobserved(self, run: PlanRun) -> str:
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

    def _continued(
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
        name = self._recorded(run, steps, why, instead_of)
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

    async def _ordered(self, run: PlanRun) -> PartialOrder | None:
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

    def _recorded(self, run: PlanRun, steps: tuple[PlanStep, ...], why: str, instead_of: str | None) -> str:
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

    def _give_up(self, run: PlanRun, reason: str) -> GaveUp:
        self.runs.conclude(run.task)
        self.runs.over(run.name)
        self.records.gave_up(run.name, reason)
        return GaveUp(reason=reason)


def _as_missing(fact: Expression) -> str:
    return f"{to_text(fact.body)} is still true" if isinstance(fact, Not) else f"{to_text(fact)} is false"


def situation(domain: PlanningDomain, world: View, goal: Expression) -> str:
    """Return a digest of the facts, numbers and objects on which the problem of reaching the goal depends."""
    names = _asked.find(goal, domain) or _asked.keep(goal, domain, _asked_about(goal, domain))
    facts = sorted(str(fact) for fact in world.facts() if fact.predicate in names)
    numbers = sorted((str(number), value) for number, value in world.values().items() if number.predicate in names)
    told = repr((sorted(world.nodes().items()), facts, numbers))
    return hashlib.blake2b(told.encode(), digest_size=16).hexdigest()


_asked: IdentityCache[Expression, frozenset[str]] = IdentityCache(size=8)


def _asked_about(goal: Expression, domain: PlanningDomain) -> frozenset[str]:
    actions = relevant(goal, None, domain.actions.values()).actions
    asked = [goal, *(action.precondition for action in actions)]
    asked += [condition for action in actions for condition in effect_conditions(action.effect)]
    return frozenset(name for condition in asked for name in names_of(condition))
