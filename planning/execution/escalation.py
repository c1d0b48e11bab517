"""How to go on when a plan did not: one rung after the other, see `planning.execution.repair.EscalationStep`."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dsc.calls import Outcome
from knowledge_base.errors import InputError
from knowledge_base.language.evaluation import holds
from planning.execution.carried import Carried
from planning.execution.progress import PlanProgress, shortest_end
from planning.execution.repair import Attempt, EscalationStep, Failure, situation
from planning.generation.carried_steps import expectation, implementing
from planning.plan import Plan

if TYPE_CHECKING:
    from knowledge_base.language.expression import Expression
    from knowledge_base.store import KnowledgeBase
    from planning.execution.choices import Choices
    from planning.execution.plan_records import PlanRecords
    from planning.execution.plans import Plans
    from planning.execution.plotting import Plotting
    from planning.execution.search import Search
    from planning.ordering.partial_order import PartialOrder
    from planning.plan import PlanStep
    from planning.problem.derived import Derivation


@dataclass(frozen=True, slots=True)
class Escalation:
    """Goes on with plans without asking the planner, or says that it has to be asked, or gives up.

    Attributes:
        derivation: of the planning domain.
        plotting, plans, choices, search, telling: of the planning component.
    """

    derivation: Derivation
    plotting: Plotting
    plans: Plans
    choices: Choices
    search: Search
    telling: PlanRecords

    @property
    def _knowledge(self) -> KnowledgeBase:
        return self.plotting.knowledge

    def climb(self, carried: Carried, why: str) -> Outcome:
        """The outcome of the skill `repair`."""
        if self.derivation.recursive:
            now = self.derivation.at(self._knowledge)
            carried.course = carried.course.renewed(now.domain, now.condition(carried.goal))
        course, attempt = carried.course, carried.attempt
        if _holds(course.goal, self._knowledge):
            self.plans.over(carried.name)
            return Outcome("goal_holds")
        if carried.following is None:
            end = course.shortest_end(self._knowledge)
        else:
            end = shortest_end(carried.following, course.domain, self._knowledge, course.goal)
        failed = None if carried.stopped else self._failed_step(course)
        if end is not None and (carried.following is not None if failed is None else failed not in end):
            return self._go_on(carried, end, why)
        rung, choice = self._rung(attempt, course, failed, end, why)
        if end is not None and rung in (EscalationStep.RESUME, EscalationStep.OTHER_CANDIDATE):
            attempt.resumed[end[0]] += 1
            return self._go_on(carried, end, why, choice if rung is EscalationStep.OTHER_CANDIDATE else None)
        if rung is EscalationStep.GIVE_UP:
            return self._give_up(carried, f"{failed} has failed before, in the same way and the same situation: {why}")
        if attempt.replans >= carried.replans:
            return self._give_up(carried, f"the budget of {carried.replans} new plans is used up: {why}")
        attempt.replans += 1
        if rung is EscalationStep.EXCLUDE and failed is not None:
            self.search.exclude(failed, why)
        return Outcome("replan")

    def found(self, carried: Carried, order: PartialOrder, form: dict[str, Any]) -> Outcome:
        """The plan will be carried out in that order, with a plot of that form."""
        self.plans.carry(carried)
        self.telling.ordered(carried.name, order)
        return Outcome("plan_found", {"plot": form, "name": carried.name, "steps": len(carried.course.steps)})

    def _rung(
        self,
        attempt: Attempt,
        course: PlanProgress,
        failed: PlanStep | None,
        end: tuple[PlanStep, ...] | None,
        why: str,
    ) -> tuple[EscalationStep, str | None]:
        """What to try, and the plot that was chosen for the failed step."""
        if failed is None:
            return attempt.interrupted(end[0] if end else None), None
        choice = self.choices.of(failed)
        others = choice is not None and len(implementing(failed, self.plotting.library)) > 1
        failure = Failure(failed, why, situation(course.domain, self._knowledge, course.goal))
        return attempt.failed(failure, stands=end is not None, others=others), choice

    def _failed_step(self, course: PlanProgress) -> PlanStep | None:
        """The step at work, unless what it was for holds."""
        if len(course.at_work) != 1:
            return None
        step, domain = course.steps[course.at_work[0] - 1], self.derivation.domain
        expected = expectation(domain.action(step).effect, domain.bindings(step))
        return None if _holds(expected, self._knowledge) else step

    def _go_on(self, carried: Carried, steps: tuple[PlanStep, ...], why: str, instead_of: str | None = None) -> Outcome:
        """Carry out `steps` without asking the planner; their first one rather not with the candidate `instead_of`."""
        left = carried.course.left_steps
        name = carried.following_name or self.plans.new_name()
        if carried.following_name is not None:
            self.telling.replaced(carried.name, name, carried.following_kept)
        elif carried.following is not None:  # it was told when that was decided
            pass
        elif len(steps) < len(left):
            self.telling.skipped(carried.name, [step for step in left if step not in steps], why)
        else:
            self.telling.resumed(carried.name, name, steps[0], why, instead_of)
        self.plans.over(carried.name)
        order, before = self.plotting.order(Plan(steps), carried.goal), carried.course
        course = PlanProgress(steps, before.domain, before.goal, order.before)
        again = Carried(name, carried.goal, course, carried.attempt, carried.holder, carried.seconds, carried.replans)
        return self.found(again, order, self.plotting.form(again, order, instead_of))

    def _give_up(self, carried: Carried, reason: str) -> Outcome:
        self.plans.over(carried.name)
        self.telling.gave_up(carried.name, reason)
        return Outcome("gave_up", {"reason": reason})


def _holds(e: Expression, world: KnowledgeBase) -> bool:
    try:
        return holds(e, world)
    except InputError:
        return False
