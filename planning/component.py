"""Planning as a component: triggered like any skill, answers with events, watches the plan that is carried out."""

from __future__ import annotations

import asyncio
import itertools
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from dsc.sequencer.sequencer import CHART
from dsc.skills import Component, Outcome, SkillCall, skill
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.language.evaluation import explain, holds
from knowledge_base.language.parser import parse_condition
from planning.explain import why_unsolvable
from planning.order import PartialOrder, deordered, in_sequence, scheduled
from planning.plan import Plan, PlanFound, ProvenUnsolvable, TimedOut
from planning.plot import plot_from_plan
from planning.problem import pose
from planning.validation import validate

if TYPE_CHECKING:
    from collections.abc import Callable, Collection, Iterator

    from dsc.dynamic.library import Library
    from dsc.sequencer.clock import LoopClock
    from dsc.trace import Trace
    from knowledge_base.facts import Change
    from knowledge_base.language.expression import Expression
    from knowledge_base.store import KnowledgeBase
    from planning.domain import PlanningDomain
    from planning.planner import Planner

_CUT_SHORT = {"reproducible": False}
"""Said in the trace where a limit of real time had a part: the same seed may then give another run."""

MAX_ATTEMPTS = 3
"""How often to plan anew because the world changed while the planner worked."""


@dataclass(slots=True)
class _Running:
    """A plan on its way: the steps that are at work, and who waits to hear that the rest is of no use."""

    order: PartialOrder
    goal: Expression
    begun: set[int] = field(default_factory=set)
    broken: asyncio.Future[Outcome] | None = None

    def begin(self, number: int) -> None:
        """A step begins; those that it waits for are done."""
        self.begun.add(number)

    def ways_on(self) -> Iterator[Plan]:
        """What may be left to do: of the steps at work, each may be half done, which counts as not or as all done."""
        done = {earlier for number in self.begun for earlier in self.order.earlier[number]}
        left = [number for number in range(1, len(self.order.steps) + 1) if number not in done]
        at_work = sorted(self.begun - done)
        for count in range(len(at_work) + 1):
            for gone in itertools.combinations(at_work, count):
                yield Plan(tuple(self.order.steps[number - 1] for number in left if number not in gone))


class PlanningComponent(Component):
    """The skills behind the plot `achieve`: `plan`, `judge`, `monitor`.

    Several plans may be on their way, side by side in regions or one inside a step of another. Each has a
    name, and the component's parameter of that name says how far it is.

    Args:
        domain: the planning domain.
        library: plots that implement its actions, and the holders whose rules are inherited.
        knowledge: read only.
        planner: finds plans.
        clock: holds simulated time while the planner works.
        trace: hears `plan.asked`, `plan.found`, `plan.none`, `plan.broken`.
        parallel: whether steps that need not wait for each other are carried out side by side.
        shared: names of components that can carry out several skills at once.
        working_for: names of the components that carry out skills for the state that started an action, by the
            action's id; what they observe is the running step's own doing and is judged when the step ends.
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
        parallel: bool = True,
        shared: Collection[str] = (),
    ) -> None:
        super().__init__()
        self._domain = domain
        self._library = library
        self._knowledge = knowledge
        self._planner = planner
        self._clock = clock
        self._trace = trace
        self._working_for = working_for
        self._parallel = parallel
        self._shared = {self.name, *shared}
        self._running: dict[str, _Running] = {}
        self._plans = 0

    async def configure(self, parameter: str, value: Any) -> None:
        """The plan named `parameter` begins step number `value`; what earlier steps did is judged at this moment."""
        await super().configure(parameter, value)
        running = self._running.get(parameter)
        if running is not None:
            running.begin(int(value))
            self._judge_plan(running, "the steps before")

    @skill(
        outcomes={
            "plan_found": {"plot": "plot", "name": "symbol", "steps": "number"},
            "goal_holds": {},
            "no_plan": {"reason": "text", "kind": "symbol"},
        }
    )
    async def plan(self, call: SkillCall, goal: str, holder: str, seconds: float) -> Outcome:
        """Find a plan for the goal and make a plot of it.

        `no_plan` has the kind `unsolvable`, `timed_out` or `failed`.
        """
        wanted = parse_condition(goal)
        if holds(wanted, self._knowledge):
            return Outcome("goal_holds")
        self._trace.record("plan.asked", goal=goal, version=self._knowledge.version)
        try:
            return await self._search(call, wanted, holder, seconds)
        except InputError as error:
            return self._none("failed", str(error))

    @skill(outcomes={"goal_holds": {}, "goal_open": {"reason": "text"}})
    async def judge(self, call: SkillCall, goal: str) -> Outcome:  # noqa: ARG002
        """Say whether the goal holds, and if not, which part of it is missing."""
        try:
            why = explain(parse_condition(goal), self._knowledge)
        except InputError as error:  # what the goal is about is not there any more
            return Outcome("goal_open", {"reason": str(error)})
        return Outcome("goal_holds") if why.truth else Outcome("goal_open", {"reason": str(why.deciding)})

    @skill(outcomes={"plan_invalid": {"reason": "text", "author": "symbol"}})
    async def monitor(self, call: SkillCall, plan: str) -> Outcome:
        """Watch the plan of that name being carried out; ends when the rest of it no longer leads to the goal.

        What somebody else changes is judged at once, what the running step changes when it has ended.
        """
        running = self._running.get(plan)
        if running is None:
            raise UnknownNameError(f"there is no plan '{plan}'", found=plan, valid=self._running)
        running.broken = asyncio.get_running_loop().create_future()

        def judge_change(change: Change) -> None:
            if change.author != CHART and change.author not in self._working_for(call.action_id):
                self._judge_plan(running, change.author)

        unsubscribe = self._knowledge.subscribe(judge_change)
        self._judge_plan(running, "earlier")  # the world went on between the search and now
        try:
            return await running.broken
        finally:
            unsubscribe()
            self._running.pop(plan, None)

    async def _search(self, call: SkillCall, goal: Expression, holder: str, seconds: float) -> Outcome:
        for _ in range(MAX_ATTEMPTS):
            version = self._knowledge.version
            snapshot = self._knowledge.snapshot()
            with self._clock.hold():  # grounding takes its time as well: in a thread, so that a stop is obeyed
                problem = await asyncio.to_thread(pose, self._domain, snapshot, goal)
                answer = await self._planner.solve(problem, seconds)
            if isinstance(answer, ProvenUnsolvable):
                with self._clock.hold():
                    missing = await asyncio.to_thread(why_unsolvable, self._domain, snapshot, goal)
                return self._none("unsolvable", "; ".join(missing) or answer.reason)
            if isinstance(answer, TimedOut):
                return self._none("timed_out", f"no plan within {answer.seconds:g} s")
            if not isinstance(answer, PlanFound):
                return self._none("failed", answer.message)
            if self._clock.simulated:
                await call.clock.sleep(answer.simulated_seconds)
            verdict = validate(answer.plan, self._domain, self._knowledge, goal)
            if verdict.valid:
                return self._found(answer, goal, holder)
            if version == self._knowledge.version:
                return self._none("failed", f"the plan found does not lead to the goal: {verdict.why}")
        return self._none("failed", f"the world changes faster than plans are made: {verdict.why}")

    def _found(self, answer: PlanFound, goal: Expression, holder: str) -> Outcome:
        self._plans += 1
        rules = self._library.plot(holder).rules if holder in self._library else ()
        name = f"plan_{self._plans}"
        plan, domain = answer.plan, self._domain
        if plan.schedule:
            order = scheduled(plan)
        elif self._parallel:
            order = deordered(plan, domain, self._knowledge, goal)
        else:
            order = in_sequence(plan)
        plot = plot_from_plan(plan, domain, self._library, rules, name, order, self._shared)
        self._running[name] = _Running(order, goal)
        steps = [str(step) for step in answer.plan.steps]
        limit = {} if answer.reproducible else _CUT_SHORT
        self._trace.record("plan.found", plot=name, steps=steps, engine=answer.engine, **limit)
        return Outcome("plan_found", {"plot": plot.to_form(), "name": name, "steps": len(steps)})

    def _none(self, kind: str, reason: str) -> Outcome:
        self._trace.record("plan.none", kind=kind, reason=reason, **(_CUT_SHORT if kind == "timed_out" else {}))
        return Outcome("no_plan", {"reason": reason, "kind": kind})

    def _judge_plan(self, running: _Running, author: str) -> None:
        why = None if running.broken is None or running.broken.done() else self._why_broken(running)
        if why is not None and running.broken is not None:
            self._trace.record("plan.broken", reason=why, author=author, step=max(running.begun, default=1))
            running.broken.set_result(Outcome("plan_invalid", {"reason": why, "author": author}))

    def _why_broken(self, running: _Running) -> str | None:
        """Why what is left of the plan no longer leads to the goal."""
        found = [validate(plan, self._domain, self._knowledge, running.goal) for plan in running.ways_on()]
        return None if any(one.valid for one in found) else found[0].why
