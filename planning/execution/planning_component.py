"""Planning as skills of a component: search, monitoring and repair of plans, and the test of the goal at the end."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Mapping
from functools import partial
from typing import TYPE_CHECKING, Any

from dsc.calls import Ended, SkillCall, Status
from dsc.engine.steps import Cancel, Start
from dsc.events import LED_AWAY
from dsc.model.states import DynamicState
from dsc.outcomes import Outcome
from dsc.sequencer.reactor import CHART
from dsc.skills import skill
from knowledge_base.errors import InputError, Place
from knowledge_base.language.evaluation.evaluator import holds
from knowledge_base.language.evaluation.explanation import explain
from knowledge_base.language.syntax.text import parse_condition, to_text
from planning.analysis.explanation import unmet
from planning.execution.attempt import Attempt
from planning.execution.choices import Choices
from planning.execution.escalation import Escalation
from planning.execution.goal_skills import GoalSkills
from planning.execution.monitor_skill import MonitorSkill
from planning.execution.outages import Outages
from planning.execution.outcomes import (
    GaveUp,
    GoalHolds,
    GoalOpen,
    Monitored,
    NoPlan,
    NoPlanKind,
    PlotFound,
    Repaired,
    Withdrawn,
)  # fmt: skip
from planning.execution.plan_progress import PlanProgress
from planning.execution.plan_records import PlanRecords
from planning.execution.plan_run import PlanRun, task_of
from planning.execution.plan_runs import PlanRuns
from planning.execution.plotting import Plotting
from planning.execution.search import Search
from planning.execution.search_results import NotFound
from planning.execution.step_costs import StepCosts
from planning.problem.construction import check_goal
from planning.problem.derived import derivation

if TYPE_CHECKING:
    from dsc.components.component import Component
    from dsc.dynamic.library import Library
    from dsc.engine.steps import Step
    from dsc.sequencer.clock import LoopClock
    from dsc.trace import Trace
    from knowledge_base.language.syntax.expression import Expression
    from knowledge_base.store import KnowledgeBase
    from planning.engines.planner import Planner
    from planning.execution.foresight import Foresight
    from planning.execution.goals import GoalQueue
    from planning.execution.search_results import Found
    from planning.model.domain import PlanningDomain


class PlanningComponent(GoalSkills):
    """The component whose skills the shipped plots call: `plan`, `monitor`, `hold`, `repair`, `judge`, and for goals.

    Several plans may be executed in parallel regions, or one plan inside a step of another plan. Each plan has a name.
    The component has a parameter of that name, whose value is the number of the step that has begun.

    Args:
        domain: the planning domain.
        library: the plots that implement planning actions, and the plots whose rules the plots of plans inherit.
        knowledge: the knowledge base; the component only reads it.
        planner: the planner; an `Improving` planner may find better plans later.
        clock: the clock of the run; a search stops simulated time.
        trace: receives the records `plan.*`.
        parallel: whether independent steps are executed in parallel.
        shared: names of components that can execute several skills concurrently.
        components: the components of the run by name, for whose return a failed plan waits.
        working_for: returns, for the id of an action, the names of the components that execute skills for the state
            that started the action. Their observations count as effects of the running step, and are validated at the
            step's end.
        goals: see `GoalSkills`.
        foresight: simulates each plan before its execution.
    """

    def __init__(
        self,
        domain: PlanningDomain,
        library: Library,
        knowledge: KnowledgeBase,
        planner: Planner,
        clock: LoopClock,
        trace: Trace,
        components: Mapping[str, Component],
        working_for: Callable[[str], frozenset[str]],
        goals: Callable[[], GoalQueue],
        *,
        foresight: Foresight | None = None,
        parallel: bool = True,
        shared: Collection[str] = (),
    ) -> None:
        super().__init__(goals)
        self._derivation = derivation(domain)
        self._knowledge = knowledge
        self._clock = clock
        self._working_for = working_for
        self._records = PlanRecords(trace)
        costs = StepCosts(domain, library)
        self._search = Search(domain, knowledge, planner, clock, self._records, costs, foresight)
        self._runs = PlanRuns()
        self._outages = Outages(components, self._records)
        self._library = library
        plotting = Plotting(self._derivation, library, knowledge, parallel, {self.name, *shared})
        self._choices = Choices(self._derivation.domain, library)
        self._escalation = Escalation(plotting, self._runs, self._choices, self._search, self._records)
        self._cancelled: set[asyncio.Task[None]] = set()  # searches that have been cancelled and have not ended
        self._answers: dict[str, Outcome] = {}  # outcomes by action id, until `forget`

    def plans(self) -> dict[str, tuple[str, ...]]:
        """Return the remaining steps of each plan in execution as text, by its goal."""
        return {to_text(one.goal): tuple(map(str, one.progress.remaining_steps)) for one in self._runs.monitored()}

    async def over(self) -> None:
        """Wait until cancelled searches have ended; called before the event loop of the run ends.

        A search that ignores its cancellation is abandoned after `planner_call.STOPPING` seconds.
        """
        if self._cancelled:
            await asyncio.wait(self._cancelled)

    def note(self, step: Step) -> None:
        """Store the plots chosen for planning actions; the sequencer calls this method after each macrostep.

        A rule that leaves a plan for another state ends the attempt, since the plot bounds how often it does that.
        """
        self._choices.note(step)
        self._outages.note(step)
        for one in step.output:
            if isinstance(one, Start) and (one.component, one.skill) == (self.name, "monitor"):
                self._runs.required(one.arguments["plan"]).monitored_for = one.activation
        if any(micro.event is not None and micro.event.name.startswith(LED_AWAY) for micro in step.microsteps):
            self._runs.conclude_monitored({one.activation for one in step.output if isinstance(one, Cancel)})

    def remember(self) -> Any:
        """Return plans, excluded steps, choices and outcomes that the sequencer has not received, as data."""
        self._answers = {one: answer for one, answer in self._answers.items() if self._working_for(one)}
        return {
            **self._runs.remember(),
            "excluded": self._search.remember(),
            "chosen": self._choices.remember(),
            "errors": self._outages.remember(),
            "answers": {one: [answer.event, dict(answer.attributes)] for one, answer in self._answers.items()},
        }

    def recall(self, memory: Any) -> None:
        """Restore the data that `remember` returned, with the conditions of plans expanded for the present world."""
        self._runs.recall(memory, self._derivation.at(self._knowledge))
        self._search.recall(memory["excluded"])
        self._choices.recall(memory["chosen"])
        self._outages.recall(memory["errors"])
        self._answers = {one: Outcome(event, attributes) for one, (event, attributes) in memory["answers"].items()}

    async def execute(self, skill_name: str, call: SkillCall[Any], arguments: Mapping[str, Any]) -> Outcome:
        """Execute a skill, and keep its outcome until `forget`, so that `status` can return it after a restart."""
        answer = self._answers[call.action_id] = await super().execute(skill_name, call, arguments)
        return answer

    async def forget(self, action_id: str) -> None:
        """Delete the outcome of an action after the sequencer has received it."""
        self._answers.pop(action_id, None)

    async def status(self, action_id: str, skill_name: str, arguments: Mapping[str, Any]) -> Status | Ended:
        """Return the outcome that was kept before a restart, or report that the action is still running."""
        answer = self._answers.get(action_id)
        return await super().status(action_id, skill_name, arguments) if answer is None else Ended(answer)

    async def configure(self, parameter: str, value: Any) -> None:
        """Begin step number `value` of the plan `parameter`; the monitor then validates effects of earlier steps."""
        await super().configure(parameter, value)
        for run in self._runs.carrying(parameter):
            run.begin(int(value))

    @skill(after_crash="repeat")
    async def plan(
        self,
        call: SkillCall,
        goal: str,
        holder: str,
        seconds: float,
        replans: int,
        after: str,
    ) -> PlotFound | GoalHolds | NoPlan | GaveUp:
        """Find a plan for the goal and generate the plot of the plan.

        `after` is the name of the plan that the new one replaces; empty for the first plan. The attribute `kind` of
        `no_plan` is `unsolvable`, `timed_out`, `failed`, or `invalid` for a goal that is not a condition of the domain.
        """
        try:
            return await self._plan(call, goal, holder, seconds, replans, self._runs.get(after))
        finally:  # at the end, since an interrupted search needs the replaced plan again
            self._runs.over(after)

    @skill(after_crash="repeat")
    async def judge(self, call: SkillCall, goal: str, plan: str = "") -> GoalHolds | GoalOpen:  # noqa: ARG002
        """Test the goal after the end of `plan`; `goal_open` contains the part of the goal that does not hold."""
        try:
            wanted = self._derivation.at(self._knowledge).condition(parse_condition(goal))
            why = explain(wanted, self._knowledge)
        except InputError as error:  # an object of the goal no longer exists
            return GoalOpen(reason=str(error))
        if not why.truth:
            return GoalOpen(reason=str(why.deciding))
        self._conclude(plan)
        return GoalHolds()

    @skill(after_crash="repeat", unlimited=True)
    async def monitor(self, call: SkillCall, plan: str) -> Monitored:
        """Monitor a plan until another plan replaces it, its goal holds, or it no longer leads to the goal.

        The monitor validates a change by another author immediately. It validates a change by the running step at the
        end of that step. If a new plan begins with the running step, that step continues.
        """

        def is_own(author: str) -> bool:
            return author == CHART or author in self._working_for(call.action_id)

        run = self._runs.required(plan)
        outcome = await MonitorSkill(run, self._escalation, self._clock, is_own, self._cancelled).outcome()
        if outcome.event == "goal_holds":
            self._conclude(plan)
        return outcome

    @skill(after_crash="repeat", unlimited=True)
    async def hold(self, call: SkillCall, plan: str, step: int) -> Withdrawn:  # noqa: ARG002
        """End when the step, given by its number in the plot, must end while parallel steps continue."""
        carrying = self._runs.carrying(plan)
        if not carrying:
            unending: asyncio.Future[Withdrawn] = asyncio.get_running_loop().create_future()
            return await unending
        return await carrying[-1].hold(step)

    @skill(after_crash="repeat")
    async def repair(self, call: SkillCall, plan: str, why: str) -> Repaired:
        """Return the answer to the failure of a plan, see `planning.execution.attempt.EscalationStep`.

        `plan_found` contains a plan that needs no planner call; `replan` requests a planner call. After a failure of a
        device, the answer comes when the device is back, or after a pause.
        """
        run = self._runs.required(plan)
        outage = await self._outages.over(run, why, call.clock)
        return await self._escalation.answer(run, why, outage=outage)

    async def _plan(
        self, call: SkillCall, goal: str, holder: str, seconds: float, replans: int, before: PlanRun | None
    ) -> PlotFound | GoalHolds | NoPlan | GaveUp:
        now = self._derivation.at(self._knowledge)
        try:
            wanted = parse_condition(goal, f"goal of '{holder}'" if holder else "goal")
            if before is None:  # later, an object of the goal may be missing
                check_goal(wanted, self._knowledge)
            reached = holds(now.condition(wanted), self._knowledge)
        except InputError as error:
            error.place = _place_of(goal, holder, self._library) or error.place
            return self._none("invalid", str(error))
        task = task_of(wanted, holder)
        if reached:
            self._runs.conclude(task)
            return GoalHolds()
        left: int | None = None
        if before is not None:
            attempt: Attempt | None = before.attempt
        else:
            attempt, left = self._find_interrupted(task, now.condition(wanted))
        if before is None and attempt is not None and attempt.disturbances >= replans:
            self._runs.conclude(task)
            return GaveUp(reason=f"interruptions ended {replans} plans before a step was completed")
        self._records.asked(goal, self._knowledge.version)
        try:
            earlier = None if before is None else before.progress
            found = await self._search.plan(wanted, seconds, earlier, call.clock.sleep)
            if isinstance(found, NotFound):
                self._runs.conclude(task)
                return self._none(found.kind, found.reason)
            known = found.known_order(found.steps, self._knowledge.version)
            progress = found.known_progress(found.steps, self._knowledge.version) or self._progress(found, wanted)
            if attempt is None:
                attempt = self._runs.attempt(task, left)
            elif before is None:
                attempt.unmet = left
                attempt.disturbances += 1
            run = PlanRun(self._runs.new_name(), wanted, progress, attempt, holder, seconds, replans, found.better)
            plotted = partial(self._escalation.plotting.plotted, run, found.answer.plan, known)
            order, form = await self._search.aside(plotted)
        except InputError as error:
            self._runs.conclude(task)
            return self._none("failed", str(error))
        run.overtaken = found.overtaken
        self._records.found(found.answer, run.name)
        if before is not None:
            self._records.replaced(before.name, run.name, found.kept)
        return self._escalation.bound(run, order, form)

    def _progress(self, found: Found, goal: Expression) -> PlanProgress:
        now = self._derivation.at(self._knowledge)
        return PlanProgress(found.steps, now.domain, now.condition(goal))

    def _find_interrupted(self, task: str, goal: Expression) -> tuple[Attempt | None, int | None]:
        """Return the interrupted attempt at a task, unless the goal has gained a fact since the last interruption.

        The second value is the number of false parts of the goal; `None` without an interruption.
        """
        attempt = self._runs.interrupted(task)
        if attempt is None:
            return None, None
        left = sum(1 for _ in unmet(goal, self._knowledge))
        return (None if attempt.unmet is not None and left < attempt.unmet else attempt), left

    def _conclude(self, plan: str) -> None:
        run = self._runs.get(plan)
        if run is not None:
            self._runs.conclude(run.task)
        self._runs.over(plan)

    def _none(self, kind: NoPlanKind, reason: str) -> NoPlan:
        self._records.none(kind, reason)
        return NoPlan(reason=reason, kind=kind)


def _place_of(goal: str, holder: str, library: Library) -> Place | None:
    """Return the place of a goal in the file of the plot that has it; `None` for a goal from elsewhere."""
    plot = library.plot(holder) if holder in library else None
    states = () if plot is None else plot.walk()
    goals = (
        (path, state.goal) for _, state, path in states if isinstance(state, DynamicState) and state.goal is not None
    )
    path = next((path for path, own in goals if to_text(own) == goal), None)
    return None if plot is None or path is None else plot.place((*path, "goal"))
