"""Planning as a component: triggered like any skill, answers with events, watches the plan that is carried out."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Mapping
from typing import TYPE_CHECKING, Any

from dsc.calls import Ended, Outcome, SkillCall, Status
from dsc.components.component import Component
from dsc.sequencer.reactor import CHART
from dsc.skills import skill
from knowledge_base.errors import InputError
from knowledge_base.language.evaluation import explain, holds
from knowledge_base.language.parser import parse_condition
from planning.execution.carried import Carried
from planning.execution.choices import Choices
from planning.execution.escalation import Escalation
from planning.execution.plan_records import PlanRecords
from planning.execution.plans import Plans
from planning.execution.plotting import Plotting
from planning.execution.progress import PlanProgress
from planning.execution.repair import Attempt
from planning.execution.search import NotFound, Search
from planning.execution.watching import Watching
from planning.problem.derived import derivation

if TYPE_CHECKING:
    from dsc.dynamic.library import Library
    from dsc.engine.steps import Step
    from dsc.sequencer.clock import LoopClock
    from dsc.trace import Trace
    from knowledge_base.store import KnowledgeBase
    from planning.domain import PlanningDomain
    from planning.engines.planner import Planner
    from planning.execution.foresight import Foresight

_PLAN_FOUND = {"plot": "plot", "name": "symbol", "steps": "number"}


class PlanningComponent(Component):
    """The skills behind the plot `achieve` and the plots of plans: `plan`, `monitor`, `hold`, `repair`, `judge`.

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
        self._knowledge = knowledge
        self._clock = clock
        self._working_for = working_for
        self._telling = PlanRecords(trace)
        self._search = Search(domain, knowledge, planner, clock, self._telling, foresight)
        self._plans = Plans()
        self._plotting = Plotting(self._derivation, library, knowledge, parallel, {self.name, *shared})
        self._choices = Choices(self._derivation.domain, library)
        self._ladder = Escalation(
            self._derivation, self._plotting, self._plans, self._choices, self._search, self._telling
        )
        self._answers: dict[str, Outcome] = {}  # by action; of some it is not known yet whether they were heard
        self._ending: set[asyncio.Task[None]] = set()  # searches that were told to stop

    async def over(self) -> None:
        """Wait until planners have stopped that were told to, as a program has to before its loop ends.

        Those that do not stop are left behind after `bounds.STOPPING` seconds.
        """
        if self._ending:
            await asyncio.wait(self._ending)

    def note_choices(self, step: Step) -> None:
        """Remember which plots were chosen to carry out planning actions; for the sequencer to call."""
        self._choices.note(step)

    def remember(self) -> Any:
        """The plans that are on their way, what has been tried, and what was answered and has not been heard."""
        self._answers = {one: answer for one, answer in self._answers.items() if self._working_for(one)}
        return {
            **self._plans.remember(),
            "excluded": self._search.remember(),
            "chosen": self._choices.remember(),
            "answers": {one: [answer.event, dict(answer.attributes)] for one, answer in self._answers.items()},
        }

    def recall(self, memory: Any) -> None:
        """The inverse of `remember`, in the world as it is now."""
        self._plans.recall(memory, self._derivation.at(self._knowledge))
        self._search.recall(memory["excluded"])
        self._choices.recall(memory["chosen"])
        self._answers = {one: Outcome(event, attributes) for one, (event, attributes) in memory["answers"].items()}

    async def execute(self, skill_name: str, call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
        """As every component does; an answer is kept until it has been heard, since plans have changed with it."""
        answer = self._answers[call.action_id] = await super().execute(skill_name, call, arguments)
        return answer

    async def forget(self, action_id: str) -> None:
        """The answer has been heard."""
        self._answers.pop(action_id, None)

    async def status(self, action_id: str, skill_name: str, arguments: Mapping[str, Any]) -> Status | Ended:
        """What was answered before a restart; any other action goes on where its plan is."""
        answer = self._answers.get(action_id)
        return await super().status(action_id, skill_name, arguments) if answer is None else Ended(answer)

    async def configure(self, parameter: str, value: Any) -> None:
        """The plan named `parameter` begins step number `value`; what earlier steps did is judged at this moment."""
        await super().configure(parameter, value)
        carried = self._plans.get(parameter)
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
            return await self._planned(call, goal, holder, seconds, replans, self._plans.get(after))
        finally:  # not before: a search that is broken off has to find it again
            self._plans.over(after)

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
        self._plans.over(plan)
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
            self._plans.required(plan), self._derivation, self._knowledge, self._search, self._telling, self._clock,
            self._plans.new_name, is_own, self._ending,
        )  # fmt: skip
        outcome = await watching.watch()
        if outcome.event == "goal_holds":
            self._plans.over(plan)
        return outcome

    @skill(outcomes={"held": {}}, after_crash="repeat")
    async def hold(self, call: SkillCall, plan: str) -> Outcome:  # noqa: ARG002
        """End when no more steps of that plan shall begin: others take their place, after the one at work."""
        carried = self._plans.get(plan)
        superseded = asyncio.Event() if carried is None else carried.superseded
        await superseded.wait()
        return Outcome("held")

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
        return self._ladder.climb(self._plans.required(plan), why)

    async def _planned(
        self, call: SkillCall, goal: str, holder: str, seconds: float, replans: int, before: Carried | None
    ) -> Outcome:
        wanted, now = parse_condition(goal), self._derivation.at(self._knowledge)
        if holds(now.condition(wanted), self._knowledge):
            return Outcome("goal_holds")
        self._telling.asked(goal, self._knowledge.version)
        try:
            left = None if before is None else before.course
            found = await self._search.plan(wanted, seconds, left, call.clock.sleep)
            if isinstance(found, NotFound):
                return self._none(found.kind, found.reason)
            now = self._derivation.at(self._knowledge)
            known = found.order if found.version == self._knowledge.version else None
            order = self._plotting.order(found.answer.plan, wanted, known)
            course = PlanProgress(found.steps, now.domain, now.condition(wanted), order.before)
            attempt = Attempt() if before is None else before.attempt
            carried = Carried(self._plans.new_name(), wanted, course, attempt, holder, seconds, replans, found.better)
            form = self._plotting.form(carried, order)
        except InputError as error:
            return self._none("failed", str(error))
        self._telling.found(found.answer, carried.name)
        if before is not None:
            self._telling.replaced(before.name, carried.name, found.kept)
        return self._ladder.found(carried, order, form)

    def _none(self, kind: str, reason: str) -> Outcome:
        self._telling.none(kind, reason)
        return Outcome("no_plan", {"reason": reason, "kind": kind})
