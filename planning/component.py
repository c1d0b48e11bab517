"""Planning as a component: triggered like any skill, answers with events, watches the plan that is carried out."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from dsc.sequencer.reactor import CHART
from dsc.skills import Component, Outcome, SkillCall, skill
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.language.evaluation import explain, holds
from knowledge_base.language.parser import parse_condition
from knowledge_base.language.printer import to_text
from planning.explain import why_unsolvable
from planning.plan import Plan, PlanFound, PlanStep, ProvenUnsolvable, TimedOut
from planning.plot import plot_from_plan
from planning.problem import pose
from planning.validation import validate

if TYPE_CHECKING:
    from collections.abc import Callable

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
MOST_REMEMBERED = 16
"""Of the plans that are of no use any more, and of the names that were given, as many are remembered: somebody may
still have to hear of them after a restart."""


@dataclass(slots=True)
class _Running:
    """A plan on its way.

    Attributes:
        plan, goal: what is to be done, and for what.
        step: the one that is at work.
        watched: whether it has been judged since it was found.
        verdict: why the rest is of no use, and whose change made it so.
        broken: who waits to hear that.
    """

    plan: Plan
    goal: Expression
    step: int = 1
    watched: bool = False
    verdict: tuple[str, str] | None = None
    broken: asyncio.Future[None] | None = None


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
    ) -> None:
        super().__init__()
        self._domain = domain
        self._library = library
        self._knowledge = knowledge
        self._planner = planner
        self._clock = clock
        self._trace = trace
        self._working_for = working_for
        self._running: dict[str, _Running] = {}
        self._plans = 0
        self._names: dict[str, str] = {}  # of plans, by the action that found them: after a restart it finds it again

    def remember(self) -> Any:
        """The plans that are on their way, and what they are named."""
        running = {
            name: {
                "goal": to_text(one.goal),
                "steps": [[step.action, *step.args] for step in one.plan.steps],
                "watched": one.watched,
                "verdict": one.verdict,
            }
            for name, one in self._running.items()
        }
        return {"plans": self._plans, "names": self._names, "running": running}

    def recall(self, memory: Any) -> None:
        """The inverse of `remember`; how far each plan is, its parameter says."""
        self._plans, self._names = memory["plans"], memory["names"]
        for name, kept in memory["running"].items():
            plan = Plan(tuple(PlanStep(action, tuple(args)) for action, *args in kept["steps"]))
            verdict = tuple(kept["verdict"]) if kept["verdict"] else None
            self._running[name] = _Running(plan, parse_condition(kept["goal"]), 1, kept["watched"], verdict)

    async def configure(self, parameter: str, value: Any) -> None:
        """The plan named `parameter` begins step number `value`; what earlier steps did is judged at this moment."""
        await super().configure(parameter, value)
        running = self._running.get(parameter)
        if running is not None:
            running.step = int(value)
            self._judge_plan(running, "the steps before")

    @skill(
        outcomes={
            "plan_found": {"plot": "plot", "name": "symbol", "steps": "number"},
            "goal_holds": {},
            "no_plan": {"reason": "text", "kind": "symbol"},
        },
        after_crash="repeat",
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

    @skill(outcomes={"goal_holds": {}, "goal_open": {"reason": "text"}}, after_crash="repeat")
    async def judge(self, call: SkillCall, goal: str) -> Outcome:  # noqa: ARG002
        """Say whether the goal holds, and if not, which part of it is missing."""
        try:
            why = explain(parse_condition(goal), self._knowledge)
        except InputError as error:  # what the goal is about is not there any more
            return Outcome("goal_open", {"reason": str(error)})
        return Outcome("goal_holds") if why.truth else Outcome("goal_open", {"reason": str(why.deciding)})

    @skill(outcomes={"plan_invalid": {"reason": "text", "author": "symbol"}}, after_crash="repeat")
    async def monitor(self, call: SkillCall, plan: str) -> Outcome:
        """Watch the plan of that name being carried out; ends when the rest of it no longer leads to the goal.

        What somebody else changes is judged at once, what the running step changes when it has ended.
        """
        running = self._running.get(plan)
        if running is None:
            raise UnknownNameError(f"there is no plan '{plan}'", found=plan, valid=self._running)
        running.broken = asyncio.get_running_loop().create_future()
        if running.verdict is not None:
            return _invalid(*running.verdict)

        def judge_change(change: Change) -> None:
            if change.author != CHART and change.author not in self._working_for(call.action_id):
                self._judge_plan(running, change.author)

        unsubscribe = self._knowledge.subscribe(judge_change)
        if not running.watched:  # after a restart a step may be half done, which is judged when it has ended
            running.watched = True
            self._judge_plan(running, "earlier")  # the world went on between the search and now
        try:
            await running.broken
        except asyncio.CancelledError:
            self._running.pop(plan, None)
            raise
        finally:
            unsubscribe()
        return _invalid(*running.verdict or ("", ""))

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
                return self._found(call.action_id, answer, goal, holder)
            if version == self._knowledge.version:
                return self._none("failed", f"the plan found does not lead to the goal: {verdict.why}")
        return self._none("failed", f"the world changes faster than plans are made: {verdict.why}")

    def _found(self, action_id: str, answer: PlanFound, goal: Expression, holder: str) -> Outcome:
        rules = self._library.plot(holder).rules if holder in self._library else ()
        name = self._name(action_id)
        plot = plot_from_plan(answer.plan, self._domain, self._library, rules, name)
        self._running[name] = _Running(answer.plan, goal)
        steps = [str(step) for step in answer.plan.steps]
        limit = {} if answer.reproducible else _CUT_SHORT
        self._trace.record("plan.found", plot=name, steps=steps, engine=answer.engine, **limit)
        return Outcome("plan_found", {"plot": plot.to_form(), "name": name, "steps": len(steps)})

    def _name(self, action_id: str) -> str:
        """A name for the plan that this action has found; old ones are forgotten."""
        if action_id not in self._names:
            self._plans += 1
            self._names[action_id] = f"plan_{self._plans}"
            judged = [plan for plan, one in self._running.items() if one.verdict is not None]
            for plan in judged[:-MOST_REMEMBERED]:
                del self._running[plan]
            for action in list(self._names)[:-MOST_REMEMBERED]:
                del self._names[action]
        return self._names[action_id]

    def _none(self, kind: str, reason: str) -> Outcome:
        self._trace.record("plan.none", kind=kind, reason=reason, **(_CUT_SHORT if kind == "timed_out" else {}))
        return Outcome("no_plan", {"reason": reason, "kind": kind})

    def _judge_plan(self, running: _Running, author: str) -> None:
        if running.broken is None or running.verdict is not None:
            return
        why = self._why_broken(running)
        if why is not None:
            self._trace.record("plan.broken", reason=why, author=author, step=running.step)
            running.verdict = why, author
            running.broken.set_result(None)

    def _why_broken(self, running: _Running) -> str | None:
        """Why what is left of the plan no longer leads to the goal; the step at work may be half done."""
        left = running.plan.steps[running.step - 1 :]
        whole = validate(Plan(left), self._domain, self._knowledge, running.goal)
        if whole.valid or validate(Plan(left[1:]), self._domain, self._knowledge, running.goal).valid:
            return None
        return whole.why


def _invalid(reason: str, author: str) -> Outcome:
    return Outcome("plan_invalid", {"reason": reason, "author": author})
