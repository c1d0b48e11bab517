"""Planning as a component: triggered like any skill, answers with events, watches the plan that is carried out."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from typing import TYPE_CHECKING, Any

from dsc.sequencer.reactor import CHART
from dsc.skills import Component, Ended, Outcome, SkillCall, Status, skill
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.language.evaluation import explain, holds
from knowledge_base.language.parser import parse_condition
from planning.execution.carried import Carried
from planning.execution.choices import Choices
from planning.execution.course import Course, shortest_end
from planning.execution.repair import Attempt, Failure, Rung, situation
from planning.execution.search import NotFound, Search
from planning.execution.telling import Telling
from planning.execution.watching import Watching
from planning.generation.plot import plot_from_plan
from planning.generation.steps import expectation, implementing
from planning.ordering.order import PartialOrder, deordered, in_sequence, scheduled
from planning.plan import Plan
from planning.posing.derived import derivation

if TYPE_CHECKING:
    from dsc.dynamic.library import Library
    from dsc.engine.steps import Step
    from dsc.model.plot import ActionPlot
    from dsc.sequencer.clock import LoopClock
    from dsc.trace import Trace
    from knowledge_base.language.expression import Expression
    from knowledge_base.store import KnowledgeBase
    from planning.domain import PlanningDomain
    from planning.engines.planner import Planner
    from planning.execution.foresight import Foresight
    from planning.plan import PlanStep

_PLAN_FOUND = {"plot": "plot", "name": "symbol", "steps": "number"}
MOST_UNWATCHED = 64
"""Plans that nobody watches are kept, since new ones may have to take their places; but of those that were left for
good, nobody says so, and only as many."""


class PlanningComponent(Component):
    """The skills behind the plot `achieve`: `plan`, `monitor`, `repair`, `judge`.

    Several plans may be on their way, side by side in regions or one inside a step of another. Each has a
    name, and the component's parameter of that name says which step has begun.

    Args:
        domain: the planning domain.
        library: plots that implement its actions, and the holders whose rules are inherited.
        knowledge: read only.
        planner: finds plans; if it is `Improving`, better plans that it finds later are taken.
        clock: holds simulated time while the planner works.
        trace: hears `plan.*`.
        parallel: whether steps that need not wait for each other are carried out side by side.
        shared: names of components that can carry out several skills at once.
        working_for: names of the components that carry out skills for the state that started an action, by the
            action's id; what they observe is the running step's own doing and is judged when the step ends.
        foresight: tries out plans before they are carried out.
    """

    name = "planner"

    def __init__(
        self,
        domain: PlanningDomain,
        library: Library,
        knowledge: KnowledgeBase,
        planner: Planner,
        clock: LoopClock,
        trace: Trace,
        working_for: Callable[[str], frozenset[str]],
        *,
        foresight: Foresight | None = None,
        parallel: bool = True,
        shared: Collection[str] = (),
    ) -> None:
        super().__init__()
        self._derivation = derivation(domain)
        self._domain = self._derivation.domain
        self._library = library
        self._knowledge = knowledge
        self._clock = clock
        self._working_for = working_for
        self._parallel = parallel
        self._shared = {self.name, *shared}
        self._telling = Telling(trace)
        self._search = Search(domain, knowledge, planner, clock, self._telling, foresight)
        self._carried: dict[str, Carried] = {}
        self._choices = Choices(self._domain, library)
        self._plans = 0
        self._answers: dict[str, Outcome] = {}  # by action; of some it is not known yet whether they were heard

    def note_choices(self, step: Step) -> None:
        """Remember which plots were chosen to carry out planning actions; for the sequencer to call."""
        self._choices.note(step)

    def remember(self) -> Any:
        """The plans that are on their way, what has been tried, and what was answered and has not been heard."""
        self._answers = {one: answer for one, answer in self._answers.items() if self._working_for(one)}
        return {
            "plans": self._plans,
            "carried": [one.to_json() for one in self._carried.values()],
            "excluded": self._search.remember(),
            "chosen": self._choices.remember(),
            "answers": {one: [answer.event, dict(answer.attributes)] for one, answer in self._answers.items()},
        }

    def recall(self, memory: Any) -> None:
        """The inverse of `remember`, in the world as it is now."""
        now = self._derivation.at(self._knowledge)
        self._plans = memory["plans"]
        self._carried = {form["name"]: Carried.from_json(form, now) for form in memory["carried"]}
        self._search.recall(memory["excluded"])
        self._choices.recall(memory["chosen"])
        self._answers = {one: Outcome(event, attributes) for one, (event, attributes) in memory["answers"].items()}

    async def execute(self, skill_name: str, call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
        """As every component does; an answer is kept until it has been heard, since plans have changed with it."""
        answer = self._answers[call.action_id] = await super().execute(skill_name, call, arguments)
        return answer

    async def status(self, action_id: str, skill_name: str, arguments: Mapping[str, Any]) -> Status | Ended:
        """What was answered before a restart; any other action goes on where its plan is."""
        answer = self._answers.get(action_id)
        return await super().status(action_id, skill_name, arguments) if answer is None else Ended(answer)

    async def configure(self, parameter: str, value: Any) -> None:
        """The plan named `parameter` begins step number `value`; what earlier steps did is judged at this moment."""
        await super().configure(parameter, value)
        carried = self._carried.get(parameter)
        if carried is not None:
            carried.begin(int(value))

    @skill(
        outcomes={
            "plan_found": _PLAN_FOUND,
            "goal_holds": {},
            "no_plan": {"reason": "text", "kind": "symbol"},
        },
        after_crash="repeat",
    )
    async def plan(
        self,
        call: SkillCall,
        goal: str,
        holder: str,
        seconds: float,
        replans: int,
        after: str,
    ) -> Outcome:
        """Find a plan for the goal and make a plot of it.

        `after` is the name of the plan that it takes the place of, if there is one. `no_plan` has the kind
        `unsolvable`, `timed_out` or `failed`.
        """
        try:
            return await self._planned(call, goal, holder, seconds, replans, self._carried.get(after))
        finally:  # not before: a search that is broken off has to find it again
            self._carried.pop(after, None)

    @skill(outcomes={"goal_holds": {}, "goal_open": {"reason": "text"}}, after_crash="repeat")
    async def judge(self, call: SkillCall, goal: str, plan: str = "") -> Outcome:  # noqa: ARG002
        """Say whether the goal holds, and if not, which part of it is missing; `plan` was carried out for it."""
        try:
            wanted = self._derivation.at(self._knowledge).condition(parse_condition(goal))
            why = explain(wanted, self._knowledge)
        except InputError as error:  # what the goal is about is not there any more
            return Outcome("goal_open", {"reason": str(error)})
        if not why.truth:
            return Outcome("goal_open", {"reason": str(why.deciding)})
        self._carried.pop(plan, None)
        return Outcome("goal_holds")

    @skill(
        outcomes={
            "goal_holds": {},
            "plan_changed": {"why": "text"},
            "plan_invalid": {"which": "text", "why": "text", "author": "symbol"},
        },
        after_crash="repeat",
    )
    async def monitor(self, call: SkillCall, plan: str) -> Outcome:
        """Watch the plan of that name being carried out; ends when another one shall take its place, or none.

        What somebody else changes is judged at once, what the running step changes when it has ended. A step that
        a new plan begins with as well is not interrupted.
        """

        def is_own(author: str) -> bool:
            return author == CHART or author in self._working_for(call.action_id)

        watching = Watching(
            self._required(plan), self._derivation, self._knowledge, self._search, self._telling, self._clock,
            self._new_name, is_own,
        )  # fmt: skip
        outcome = await watching.watch()
        if outcome.event == "goal_holds":
            del self._carried[plan]
        return outcome

    @skill(
        outcomes={
            "plan_found": _PLAN_FOUND,
            "goal_holds": {},
            "replan": {},
            "gave_up": {"reason": "text"},
        },
        after_crash="repeat",
    )
    async def repair(self, call: SkillCall, plan: str, why: str) -> Outcome:  # noqa: ARG002
        """Find out how to go on when the plan of that name did not, see `planning.execution.repair.Rung`.

        `plan_found` goes on without asking the planner, `replan` says that it has to be asked.
        """
        carried = self._required(plan)
        if self._derivation.recursive:
            now = self._derivation.at(self._knowledge)
            carried.course = carried.course.renewed(now.domain, now.condition(carried.goal))
        course, attempt = carried.course, carried.attempt
        if _holds(course.goal, self._knowledge):
            del self._carried[plan]
            return Outcome("goal_holds")
        if carried.following is None:
            end = course.shortest_end(self._knowledge)
        else:
            end = shortest_end(carried.following, course.domain, self._knowledge, course.goal)
        failed = None if carried.stopped else self._failed_step(course)
        if end is not None and (carried.following is not None if failed is None else failed not in end):
            return self._go_on(carried, end, why)
        rung, choice = self._rung(attempt, course, failed, end, why)
        if end is not None and rung in (Rung.RESUME, Rung.OTHER_CANDIDATE):
            attempt.resumed[end[0]] += 1
            return self._go_on(carried, end, why, choice if rung is Rung.OTHER_CANDIDATE else None)
        if rung is Rung.GIVE_UP:
            return self._give_up(carried, f"{failed} has failed before, in the same way and the same situation: {why}")
        if attempt.replans >= carried.replans:
            return self._give_up(carried, f"the budget of {carried.replans} new plans is used up: {why}")
        attempt.replans += 1
        if rung is Rung.EXCLUDE and failed is not None:
            self._search.exclude(failed, why)
        return Outcome("replan")

    async def _planned(
        self, call: SkillCall, goal: str, holder: str, seconds: float, replans: int, before: Carried | None
    ) -> Outcome:
        wanted, now = parse_condition(goal), self._derivation.at(self._knowledge)
        if holds(now.condition(wanted), self._knowledge):
            return Outcome("goal_holds")
        self._telling.asked(goal, self._knowledge.version)
        try:
            left = () if before is None else before.course.left_steps
            found = await self._search.plan(wanted, seconds, left, call.clock.sleep)
            if isinstance(found, NotFound):
                return self._none(found.kind, found.reason)
            now = self._derivation.at(self._knowledge)
            order = self._order(found.answer.plan, wanted)
            course = Course(found.steps, now.domain, now.condition(wanted), order.before)
            attempt = Attempt() if before is None else before.attempt
            carried = Carried(self._new_name(), wanted, course, attempt, holder, seconds, replans, found.better)
            form = self._plot(carried, order)
        except InputError as error:
            return self._none("failed", str(error))
        self._telling.found(found.answer, carried.name)
        if before is not None:
            self._telling.replaced(before.name, carried.name, found.kept)
        return self._carry(carried, form)

    def _rung(
        self, attempt: Attempt, course: Course, failed: PlanStep | None, end: tuple[PlanStep, ...] | None, why: str
    ) -> tuple[Rung, str | None]:
        """What to try, and the plot that was chosen for the failed step."""
        if failed is None:
            return attempt.interrupted(end[0] if end else None), None
        choice = self._choices.of(failed)
        others = choice is not None and len(implementing(failed, self._library)) > 1
        failure = Failure(failed, why, situation(course.domain, self._knowledge, course.goal))
        return attempt.failed(failure, stands=end is not None, others=others), choice

    def _failed_step(self, course: Course) -> PlanStep | None:
        """The step at work, unless what it was for holds."""
        if len(course.at_work) != 1:
            return None
        step = course.steps[course.at_work[0] - 1]
        expected = expectation(self._domain.action(step).effect, self._domain.bindings(step))
        return None if _holds(expected, self._knowledge) else step

    def _go_on(self, carried: Carried, steps: tuple[PlanStep, ...], why: str, instead_of: str | None = None) -> Outcome:
        """Carry out `steps` without asking the planner; their first one rather not with the candidate `instead_of`."""
        left = carried.course.left_steps
        name = carried.following_name or self._new_name()
        if carried.following_name is not None:
            self._telling.replaced(carried.name, name, carried.following_kept)
        elif len(steps) < len(left):
            self._telling.skipped(name, [step for step in left if step not in steps], why)
        else:
            self._telling.resumed(carried.name, name, steps[0], why, instead_of)
        del self._carried[carried.name]
        order, before = self._order(Plan(steps), carried.goal), carried.course
        course = Course(steps, before.domain, before.goal, order.before)
        again = Carried(name, carried.goal, course, carried.attempt, carried.holder, carried.seconds, carried.replans)
        return self._carry(again, self._plot(again, order, instead_of))

    def _give_up(self, carried: Carried, reason: str) -> Outcome:
        del self._carried[carried.name]
        self._telling.gave_up(carried.name, reason)
        return Outcome("gave_up", {"reason": reason})

    def _none(self, kind: str, reason: str) -> Outcome:
        self._telling.none(kind, reason)
        return Outcome("no_plan", {"reason": reason, "kind": kind})

    def _plot(self, carried: Carried, order: PartialOrder, instead_of: str | None = None) -> dict[str, Any]:
        rules = self._library.plot(carried.holder).rules if carried.holder in self._library else ()
        plan, domain = Plan(carried.course.steps), carried.course.domain
        plot = plot_from_plan(plan, domain, self._library, rules, carried.name, order, self._shared)
        form = plot.to_form()
        if instead_of is not None:
            _put_last(instead_of, _state(plot, form, "step_1")["dynamic"])
        return form

    def _order(self, plan: Plan, goal: Expression) -> PartialOrder:
        """Which steps wait for which."""
        if plan.schedule:
            return scheduled(plan)
        if not self._parallel:
            return in_sequence(plan)
        return deordered(plan, self._derivation.original, self._knowledge, goal)

    def _carry(self, carried: Carried, form: dict[str, Any]) -> Outcome:
        unwatched = [name for name, one in self._carried.items() if one.begun is None]
        for name in unwatched[:-MOST_UNWATCHED]:
            del self._carried[name]
        self._carried[carried.name] = carried
        return Outcome("plan_found", {"plot": form, "name": carried.name, "steps": len(carried.course.steps)})

    def _new_name(self) -> str:
        self._plans += 1
        return f"plan_{self._plans}"

    def _required(self, plan: str) -> Carried:
        if plan not in self._carried:
            raise UnknownNameError(f"there is no plan '{plan}'", found=plan, valid=self._carried)
        return self._carried[plan]


def _state(plot: ActionPlot, form: dict[str, Any], name: str) -> dict[str, Any]:
    """The form of a state, wherever it stands in the plot's."""
    path = next(path for own, _, path in plot.walk() if own == name)
    found: Any = form
    for key in path:
        found = found[key]
    state: dict[str, Any] = found
    return state


def _put_last(candidate: str, candidates: list[str]) -> None:
    candidates.sort(key=lambda name: name == candidate)  # the others stay in their order


def _holds(e: Expression, world: KnowledgeBase) -> bool:
    try:
        return holds(e, world)
    except InputError:
        return False
