"""Monitoring of a running plan: handles broken causal links, superfluous steps and better plans."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import aclosing
from dataclasses import replace
from typing import TYPE_CHECKING

from dsc.sequencer.clock import PastClock
from knowledge_base.language.syntax.text import to_text
from knowledge_base.user_objects import described
from knowledge_base.world.overlay import Overlay
from planning.execution.link_monitor import OVERTAKING, OWN_STEPS, Broken, GoalReached, LinkMonitor, News, Shorter
from planning.execution.outcomes import GoalHolds, Monitored, PlanInvalid
from planning.execution.plan_ends import shortest_end
from planning.execution.plan_run import Better, PlanNews, PlanRun, PlanState, Successor
from planning.execution.reassessment import foresee_failure
from planning.execution.search_results import Found, NotFound
from planning.model.plan import PlanFound

if TYPE_CHECKING:
    from dsc.sequencer.clock import LoopClock
    from knowledge_base.facts import Change
    from planning.execution.escalation import Escalation
    from planning.execution.planner_call import Improvements
    from planning.model.plan import Plan, PlanStep
    from planning.problem.derived import Settled


class MonitorSkill:
    """The monitoring of one plan, as long as the skill `monitor` runs.

    Args:
        run: the plan.
        escalation: replaces the plan; its attributes are also used here.
        clock: the clock of the run.
        is_own: returns whether a change by this author is an effect of the running step.
        cancelled: receives the tasks that are cancelled and have not ended.
    """

    def __init__(
        self,
        run: PlanRun,
        escalation: Escalation,
        clock: LoopClock,
        is_own: Callable[[str], bool],
        cancelled: set[asyncio.Task[None]],
    ) -> None:
        self._run = run
        self._escalation = escalation
        self._clock = clock
        self._is_own = is_own
        self._cancelled = cancelled
        self._derivation = escalation.plotting.derivation
        self._knowledge = escalation.plotting.knowledge
        self._records = escalation.records
        self._new = asyncio.Event()
        self._settled: Settled | None = None
        self._unsubscribe: Callable[[], None] = lambda: None
        self._monitor: LinkMonitor | None = None
        self._tasks: list[asyncio.Task[None]] = []

    async def outcome(self) -> Monitored:
        """Monitor the plan until its end, and return the outcome of the skill `monitor`."""
        try:
            self._begin()
            while True:
                outcome = self._answer(await self._next_news())
                if outcome is not None:
                    self._run.state = PlanState.STOPPED
                    return outcome
        finally:
            self._end()

    def _begin(self) -> None:
        run = self._run
        run.on_begin = self._begun
        self._escalation.runs.begin(run)
        if self._derivation.recursive:
            self._settled = self._derivation.at(self._knowledge)
            self._unsubscribe = self._knowledge.subscribe(self._check_expansion)
        if run.state is PlanState.BOUND:
            run.state = PlanState.MONITORED
            if run.overtaken:
                self._install().update()
            else:
                self._install().look_first()  # the world may have changed since the search
        else:
            self._resume()
        if self._escalation.search.reads:
            self._tasks.append(asyncio.create_task(self._reassess()))
        if run.improvements is not None:
            self._tasks.append(asyncio.create_task(self._improve(run.improvements)))

    def _resume(self) -> None:
        """Continue after a restart; the running step may be half done, and its effects are validated at its end."""
        run = self._run
        self._install().update()
        if run.searching_since is not None:
            self._search_meanwhile(run.searching_since)
        while run.missed:
            self._begun(run.number(run.missed.pop(0)))

    async def _next_news(self) -> PlanNews:
        """Wait for the next news and return it."""
        while not self._run.news:
            self._new.clear()
            await self._new.wait()
        return self._run.news.popleft()

    def _put(self, heard: PlanNews) -> None:
        self._run.news.append(heard)
        self._new.set()

    def _end(self) -> None:
        self._run.on_begin = None
        self._unsubscribe()
        for task in self._tasks:
            if task.cancel():  # `False` if the task has ended
                self._cancelled.add(task)
                task.add_done_callback(self._cancelled.discard)
        if self._monitor is not None:
            self._monitor.close()

    def _answer(self, news: PlanNews) -> Monitored | None:
        """Handle the news; return the outcome with which monitoring ends, or `None` if monitoring continues."""
        run = self._run
        outcome: Monitored | None = None
        if isinstance(news, Found | NotFound):
            run.searching_since = None
        match news:
            case GoalReached():
                self._records.skipped(run.name, run.progress.remaining_steps, "the goal holds")
                outcome = GoalHolds()
            case Shorter(steps):
                outcome = self._shorten(steps)
            case NotFound():
                outcome = _invalid("", news.reason, "earlier")
            case Broken() if self._may_continue(news):
                run.attempt.replans += not news.foreign
                if news.user in run.progress.running:
                    run.withdraw(news.user)
                    self._install().update()
                self._search_meanwhile(self._clock.now())
            case Broken():
                run.disturbed = news.foreign
                outcome = _invalid(news.needed, news.why, news.author)
            case Found():
                outcome = self._follow(news.answer, Successor(news.steps, kept=news.kept, found=news))
            case Better(answer):
                better = self._better(answer.plan)
                outcome = None if better is None else self._follow(answer, Successor(better))
        return outcome

    def _check_expansion(self, change: Change) -> None:
        """Validate the plan again if recursive predicates now expand to other conditions."""
        settled = self._derivation.at(self._knowledge)
        if settled != self._settled:
            self._settled = settled
            self._run.renew(settled)
            self._look(change.author)

    def _look(self, author: str) -> None:
        self._install().look(author)

    def _install(self) -> LinkMonitor:
        progress = self._run.progress
        if self._monitor is not None:
            self._monitor.close()
        self._monitor = LinkMonitor(progress, progress.domain, self._knowledge, self._is_own, self._receive)
        return self._monitor

    def _receive(self, news: News) -> None:
        if isinstance(news, Broken):
            if self._run.state is PlanState.BROKEN:
                return
            self._run.state, self._run.rejected = PlanState.BROKEN, news.foreseen
            self._records.broken(self._run.progress, news)
        self._put(news)

    def _begun(self, number: int) -> None:
        run, progress = self._run, self._run.progress
        remaining = len(progress.remaining)
        progress.begin(number)
        if len(progress.remaining) < remaining:
            run.attempt.completed()
        if self._monitor is not None:
            self._monitor.look(OVERTAKING if run.overtaken else OWN_STEPS)
        run.overtaken = False

    def _may_continue(self, news: Broken) -> bool:
        """Return whether running steps may continue during a search, since the break does not concern them."""
        run = self._run
        others = set(run.progress.running) - {news.user}
        return (
            bool(others)
            and (bool(news.needed) or news.foreseen)
            and (news.foreign or run.attempt.replans < run.replans)
        )

    def _search_meanwhile(self, since: float) -> None:
        self._run.searching_since = since
        self._tasks.append(asyncio.create_task(self._plan_meanwhile(PastClock(self._clock, since))))

    async def _plan_meanwhile(self, clock: PastClock) -> None:
        run, goal, progress = self._run, self._run.goal, self._run.progress
        self._records.asked(to_text(goal), self._knowledge.version)
        try:
            found = await self._escalation.search.plan_during(goal, run.seconds, progress, clock.sleep)
        except Exception as error:  # noqa: BLE001  an error of the search must not end the monitoring
            found = NotFound("failed", described(error))
        self._put(found)

    async def _reassess(self) -> None:
        self._receive(await foresee_failure(self._run, self._escalation.search, self._knowledge, self._is_own))

    async def _improve(self, improvements: Improvements) -> None:
        async with aclosing(improvements):
            async for answer in improvements:
                if isinstance(answer, PlanFound):
                    self._put(Better(answer))

    def _better(self, plan: Plan) -> tuple[PlanStep, ...] | None:
        """Return the running step and the end of a better plan; `None` if that costs no less than the present steps."""
        run, progress = self._run, self._run.progress
        if run.successor is not None or run.state is PlanState.BROKEN or len(progress.running) != 1:
            return None
        (step,) = progress.steps_of(progress.running)
        ahead = Overlay(self._knowledge)
        ahead.apply(progress.domain.effects(step, ahead))
        end = shortest_end(plan.steps, progress.domain, ahead, progress.goal)
        cost = self._escalation.search.costs.total
        if end is None or cost(end, progress.domain, ahead) >= cost(progress.coming(), progress.domain, ahead):
            return None
        return (step, *end)

    def _shorten(self, steps: tuple[PlanStep, ...]) -> Monitored | None:
        """Omit steps; running steps with which the shorter plan begins continue."""
        run, why = self._run, "fewer steps lead to the goal"
        skipped = [step for step in run.progress.remaining_steps if step not in steps]
        self._records.skipped(run.name, skipped, why)
        run.successor = run.shortened(steps)
        return self._replace(why)

    def _follow(self, answer: PlanFound, successor: Successor) -> Monitored | None:
        """Replace the plan by a new plan; running steps with which the new plan begins continue."""
        run, name = self._run, self._escalation.runs.new_name()
        self._records.found(answer, name)
        run.successor = replace(successor, name=name)
        return self._replace("another plan takes its place")

    def _replace(self, why: str) -> Monitored | None:
        """Return the outcome with the successor's plot.

        If the successor no longer leads to the goal, running steps continue during another search; without a running
        step, return `plan_invalid`.
        """
        run = self._run
        outcome = self._escalation.succeeded(run, why)
        if outcome is None and run.progress.running:
            run.successor, run.state = None, PlanState.BROKEN
            self._search_meanwhile(self._clock.now())
            return None
        run.disturbed = outcome is None
        return outcome or _invalid("", why, "earlier")


def _invalid(which: str, why: str, author: str) -> PlanInvalid:
    return PlanInvalid(which=which, why=why, author=author)
