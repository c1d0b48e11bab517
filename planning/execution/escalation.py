"""Escalation answers a failed plan, one step after another; `planning.execution.repair` chooses the step."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dsc.calls import Outcome
from knowledge_base.errors import InputError
from knowledge_base.language.evaluation.evaluator import holds
from planning.execution.plan_run import PlanRun, PlanState
from planning.execution.progress import PlanProgress, shortest_end
from planning.execution.repair import EscalationStep, Failure, situation
from planning.generation.carried_steps import expectation, implementing
from planning.plan import Plan

if TYPE_CHECKING:
    from collections.abc import Iterable

    from dsc.dynamic.library import Library
    from dsc.engine.steps import Step
    from knowledge_base.language.syntax.expression import Expression
    from knowledge_base.store import KnowledgeBase
    from planning.domain import PlanningDomain
    from planning.execution.plan_records import PlanRecords
    from planning.execution.plan_run import PlanRuns
    from planning.execution.plotting import Plotting
    from planning.execution.search import Search
    from planning.ordering.partial_order import PartialOrder
    from planning.plan import PlanStep
    from planning.problem.derived import Derivation


class Choices:
    """The last chosen plot for each planning action and its arguments, so that another candidate can follow a failure.

    Args:
        domain: has the planning actions.
        library: has the plots.
    """

    def __init__(self, domain: PlanningDomain, library: Library) -> None:
        self._domain = domain
        self._library = library
        self._chosen: dict[tuple[str, frozenset[tuple[str, Any]]], str] = {}

    def note(self, step: Step) -> None:
        """Note the choices of a macrostep."""
        for made in step.decisions:
            decision = made.decision
            plot = None if decision.chosen is None else self._library.plot(decision.chosen)
            if plot is not None and plot.implements:
                self._chosen[plot.implements, frozenset(decision.arguments.items())] = plot.name

    def of(self, step: PlanStep) -> str | None:
        """The last plot chosen for a step."""
        bindings = self._domain.bindings(step)
        for plot in implementing(step, self._library):
            own = frozenset((name, value) for name, value in bindings.items() if name in plot.parameters)
            if (step.action, own) in self._chosen:
                return self._chosen[step.action, own]
        return None

    def remember(self) -> list[Any]:
        """Plain data."""
        return [[action, dict(sorted(arguments)), plot] for (action, arguments), plot in self._chosen.items()]

    def recall(self, memory: Iterable[Any]) -> None:
        """The inverse of `remember`."""
        self._chosen = {(action, frozenset(arguments.items())): plot for action, arguments, plot in memory}


@dataclass(frozen=True, slots=True)
class Escalation:
    """Continues a plan without a planner call, requests a new plan, or abandons the goal.

    Attributes:
        derivation: of the planning domain.
        plotting, runs, choices, search, records: parts of the planning component.
    """

    derivation: Derivation
    plotting: Plotting
    runs: PlanRuns
    choices: Choices
    search: Search
    records: PlanRecords

    @property
    def _knowledge(self) -> KnowledgeBase:
        return self.plotting.knowledge

    def answer(self, run: PlanRun, why: str) -> Outcome:
        """Answer the failure of a plan.

        Returns:
            The outcome of the skill `repair`.
        """
        if self._reached(run):
            return Outcome("goal_holds")
        progress, attempt = run.progress, run.attempt
        end = self._end(run)
        failed = None if run.state is PlanState.STOPPED else self._failed_step(progress)
        if end is not None and (run.successor is not None if failed is None else failed not in end):
            return self._continued(run, end, why)
        step, choice = self._chosen(run, failed, end, why)
        if end is not None and step in (EscalationStep.RESUME, EscalationStep.OTHER_CANDIDATE):
            attempt.resumed[end[0]] += 1
            return self._continued(run, end, why, choice if step is EscalationStep.OTHER_CANDIDATE else None)
        if step is EscalationStep.GIVE_UP:
            return self._give_up(run, f"{failed} has failed before, in the same way and the same situation: {why}")
        if attempt.replans >= run.replans:
            return self._give_up(run, f"the budget of {run.replans} new plans is used up: {why}")
        attempt.replans += 1
        if step is EscalationStep.EXCLUDE and failed is not None:
            self.search.exclude(failed, why)
        return Outcome("replan")

    def succeeded(self, run: PlanRun, why: str) -> Outcome | None:
        """Return the outcome with the plot of the successor; `None` if that no longer leads to the goal."""
        if self._reached(run):
            return Outcome("goal_holds")
        end = self._end(run)
        return None if end is None else self._continued(run, end, why)

    def found(self, run: PlanRun, order: PartialOrder, form: dict[str, Any]) -> Outcome:
        """Keep a plan and return the outcome that carries its plot.

        Args:
            run: the plan.
            order: of its steps.
            form: of its plot.
        """
        self.runs.add(run)
        self.records.ordered(run.name, order)
        return Outcome("plan_found", {"plot": form, "name": run.name, "steps": len(run.progress.steps)})

    def _reached(self, run: PlanRun) -> bool:
        """Whether the goal holds, so that the plan is over."""
        if self.derivation.recursive:
            run.renew(self.derivation.at(self._knowledge))
        reached = _holds(run.progress.goal, self._knowledge)
        if reached:
            self.runs.over(run.name)
        return reached

    def _end(self, run: PlanRun) -> tuple[PlanStep, ...] | None:
        """The fewest last steps of the successor, or of the plan without one, that lead to the goal."""
        world, progress = self._knowledge.snapshot(), run.progress  # its reads need no lock
        if run.successor is None:
            return progress.shortest_end(world)
        return shortest_end(run.successor.steps, progress.domain, world, progress.goal)

    def _chosen(
        self, run: PlanRun, failed: PlanStep | None, end: tuple[PlanStep, ...] | None, why: str
    ) -> tuple[EscalationStep, str | None]:
        """The escalation step, and the plot that was chosen for the failed plan step."""
        attempt, progress = run.attempt, run.progress
        if failed is None:
            return attempt.interrupted(end[0] if end else None), None
        choice = self.choices.of(failed)
        others = choice is not None and len(implementing(failed, self.plotting.library)) > 1
        failure = Failure(failed, why, situation(progress.domain, self._knowledge, progress.goal))
        return attempt.failed(failure, stands=end is not None, others=others), choice

    def _failed_step(self, progress: PlanProgress) -> PlanStep | None:
        """The running step, unless its expected effects hold."""
        if len(progress.running) != 1:
            return None
        step, domain = progress.steps[progress.running[0] - 1], self.derivation.domain
        expected = expectation(domain.action(step).effect, domain.bindings(step))
        return None if _holds(expected, self._knowledge) else step

    def _continued(self, run: PlanRun, steps: tuple[PlanStep, ...], why: str, instead_of: str | None = None) -> Outcome:
        """Continue with `steps` without a planner call; their first one prefers other candidates to `instead_of`."""
        name = self._recorded(run, steps, why, instead_of)
        known = None if run.successor is None else run.successor.order(steps, self._knowledge.version)
        order = self.plotting.order(Plan(steps), run.goal, known)
        progress = PlanProgress(steps, run.progress.domain, run.progress.goal, order.before)
        again = PlanRun(name, run.goal, progress, run.attempt, run.holder, run.seconds, run.replans, replaces=run.name)
        return self.found(again, order, self.plotting.form(again, order, instead_of))

    def _recorded(self, run: PlanRun, steps: tuple[PlanStep, ...], why: str, instead_of: str | None) -> str:
        """Record why other steps continue a plan; return the name of their plot."""
        successor, remaining = run.successor, run.progress.remaining_steps
        if successor is not None and successor.name is not None:
            self.records.replaced(run.name, successor.name, successor.kept)
            return successor.name
        name = self.runs.new_name()
        if successor is not None:
            return name  # monitoring recorded the shorter plan
        if len(steps) < len(remaining):
            self.records.skipped(run.name, [step for step in remaining if step not in steps], why)
        else:
            self.records.resumed(run.name, name, steps[0], why, instead_of)
        return name

    def _give_up(self, run: PlanRun, reason: str) -> Outcome:
        self.runs.over(run.name)
        self.records.gave_up(run.name, reason)
        return Outcome("gave_up", {"reason": reason})


def _holds(e: Expression, world: KnowledgeBase) -> bool:
    try:
        return holds(e, world)
    except InputError:
        return False
