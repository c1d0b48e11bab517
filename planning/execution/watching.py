"""While a plan is carried out: what breaks it, what makes it shorter, and what takes its place without a break."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import aclosing
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dsc.calls import Outcome
from dsc.sequencer.resumed_skills import PastClock
from knowledge_base.errors import described
from knowledge_base.language.printer import to_text
from knowledge_base.world.overlay import Overlay
from planning.execution.monitor import Broken, GoalReached, Monitor, News, Shorter
from planning.execution.progress import PlanProgress, cost_of, shortest_end
from planning.execution.search import Found, NotFound, Search
from planning.execution.watched import Better, Heard, StepEnded, Watched
from planning.plan import PlanFound

if TYPE_CHECKING:
    from dsc.sequencer.clock import LoopClock
    from knowledge_base.facts import Change
    from knowledge_base.store import KnowledgeBase
    from planning.execution.carried import Carried
    from planning.execution.improvements import Improvements
    from planning.execution.plan_records import PlanRecords
    from planning.plan import Plan, PlanStep
    from planning.problem.derived import Derivation, Settled


@dataclass(slots=True)
class Watching:
    """One plan being watched.

    Attributes:
        carried: the plan.
        derivation: of the planning domain.
        knowledge, search, telling, clock: as in the planning component.
        new_name: names a plan.
        is_own: whether a change by this author is the running step's own doing.
        ending: is told who was told to stop and has not yet.
    """

    carried: Carried
    derivation: Derivation
    knowledge: KnowledgeBase
    search: Search
    telling: PlanRecords
    clock: LoopClock
    new_name: Callable[[], str]
    is_own: Callable[[str], bool]
    ending: set[asyncio.Task[None]]

    async def watch(self) -> Outcome:
        """Watch until another plan shall take the place, or none; the outcomes are those of the skill `monitor`."""
        one = _Watch(self)
        try:
            one.begin()
            while True:
                outcome = one.answer(await one.heard())
                if outcome is not None:
                    self.carried.stopped = True
                    return outcome
        finally:
            one.end()


class _Watch:
    """What is going on while a plan is watched."""

    def __init__(self, about: Watching) -> None:
        self._about = about
        self._carried = about.carried
        self._resumes = about.carried.watched is not None
        self._state = about.carried.watched = about.carried.watched or Watched()
        self._news = asyncio.Event()
        self._settled: Settled | None = None
        self._unsubscribe: Callable[[], None] = lambda: None
        self._monitor: Monitor | None = None
        self._beside: list[asyncio.Task[None]] = []

    def begin(self) -> None:
        carried = self._carried
        carried.begun = self._begun
        if self._about.derivation.recursive:
            self._settled = self._about.derivation.at(self._about.knowledge)
            self._unsubscribe = self._about.knowledge.subscribe(self._changed)
        if self._resumes:
            self._go_on()
        else:
            self._look("earlier")  # the world went on between the search and now
        if carried.better is not None:
            self._beside.append(asyncio.create_task(self._improve(carried.better)))

    def _go_on(self) -> None:
        """As before a restart; the step at work may be half done, and is judged when it has ended."""
        state = self._state
        self._install().watch()
        if state.searching_since is not None:
            self._search_beside(state.searching_since)
        while state.missed:
            self._begun(state.missed.pop(0))

    async def heard(self) -> Heard:
        """The next thing that has to be answered."""
        while not self._state.heard:
            self._news.clear()
            await self._news.wait()
        return self._state.heard.popleft()

    def _put(self, heard: Heard) -> None:
        self._state.heard.append(heard)
        self._news.set()

    def end(self) -> None:
        self._carried.begun = None
        self._unsubscribe()
        for task in self._beside:
            if task.cancel():  # else it is over
                self._about.ending.add(task)
                task.add_done_callback(self._about.ending.discard)
        if self._monitor is not None:
            self._monitor.close()

    def answer(self, news: Heard) -> Outcome | None:
        """What watching ends with; `None` if it goes on."""
        carried = self._carried
        outcome: Outcome | None = None
        if isinstance(news, Found | NotFound):
            self._state.searching_since = None
        match news:
            case GoalReached():
                self._about.telling.skipped(carried.name, carried.course.left_steps, "the goal holds")
                outcome = Outcome("goal_holds")
            case Shorter(steps):
                outcome = self._shorten(steps)
            case StepEnded():
                outcome = Outcome("plan_changed", {"why": "another plan takes its place"})
            case NotFound():
                outcome = Outcome("plan_invalid", {"which": "", "why": news.reason, "author": "earlier"})
            case Broken() if self._can_go_on(news):
                carried.attempt.replans += 1
                self._search_beside(self._about.clock.now())
            case Broken():
                outcome = Outcome("plan_invalid", {"which": news.needed, "why": news.why, "author": news.author})
            case Found():
                outcome = self._follow(news.answer, news.steps, news.kept)
            case Better(answer):
                better = self._better(answer.plan)
                outcome = None if better is None else self._follow(answer, better, 0)
        return outcome

    def _changed(self, change: Change) -> None:
        """What recursive predicates stand for may be another now, so that the plan has to be looked at anew."""
        settled = self._about.derivation.at(self._about.knowledge)
        if settled != self._settled:
            self._settled, carried = settled, self._carried
            carried.course = carried.course.renewed(settled.domain, settled.condition(carried.goal))
            self._look(change.author)

    def _look(self, author: str) -> None:
        self._install().look(author)

    def _install(self) -> Monitor:
        about, course = self._about, self._carried.course
        if self._monitor is not None:
            self._monitor.close()
        self._monitor = Monitor(course, course.domain, about.knowledge, about.is_own, self._hear)
        return self._monitor

    def _hear(self, news: News) -> None:
        if isinstance(news, Broken):
            if self._state.said_broken:
                return
            self._state.said_broken = True
            self._about.telling.broken(self._carried.course, news)
        self._put(news)

    def _begun(self, number: int) -> None:
        if self._carried.following is not None:
            self._put(StepEnded())
            return
        self._carried.course.begin(number)
        if self._monitor is not None:
            self._monitor.look("the steps before")

    def _can_go_on(self, news: Broken) -> bool:
        """Whether the step at work may go on while a new plan is looked for: it is a later one that is hit."""
        carried = self._carried
        within_budget = carried.attempt.replans < carried.replans
        at_work = carried.course.at_work
        later = len(at_work) == 1 and bool(news.needed) and news.user > at_work[0]
        return later and within_budget and carried.following is None

    def _search_beside(self, since: float) -> None:
        self._state.searching_since = since
        self._beside.append(asyncio.create_task(self._plan_meanwhile(PastClock(self._about.clock, since))))

    async def _plan_meanwhile(self, clock: PastClock) -> None:
        goal, course = self._carried.goal, self._carried.course
        self._about.telling.asked(to_text(goal), self._about.knowledge.version)
        try:
            found = await self._about.search.plan(goal, self._carried.seconds, course, clock.sleep)
            if isinstance(found, Found):
                await found.close()
        except Exception as error:  # noqa: BLE001  whatever goes wrong beside a plan must not leave it unwatched
            found = NotFound("failed", described(error))
        self._put(found)

    async def _improve(self, better: Improvements) -> None:
        async with aclosing(better):
            async for answer in better:
                if isinstance(answer, PlanFound):
                    self._put(Better(answer))

    def _better(self, plan: Plan) -> tuple[PlanStep, ...] | None:
        """The step at work and then the end of a better plan, if that costs less than what is left."""
        about, course = self._about, self._carried.course
        if self._carried.following is not None or self._state.said_broken or len(course.at_work) != 1:
            return None
        step = course.steps[course.at_work[0] - 1]
        ahead = Overlay(about.knowledge)
        ahead.apply(course.domain.effects(step, ahead))
        end = shortest_end(plan.steps, course.domain, ahead, course.goal)
        if end is None or cost_of(end, course.domain, ahead) >= cost_of(course.coming(), course.domain, ahead):
            return None
        return (step, *end)

    def _shorten(self, steps: tuple[PlanStep, ...]) -> Outcome | None:
        """Leave steps out, after the step at work if that is not one of them."""
        carried, why = self._carried, "fewer steps lead to the goal"
        left_out = [step for step in carried.course.left_steps if step not in steps]
        self._about.telling.skipped(carried.name, left_out, why)
        if not self._takes_over(steps):
            return Outcome("plan_changed", {"why": why})
        self._install().watch()  # it was judged just now, as if the step at work were done
        return None

    def _follow(self, answer: PlanFound, steps: tuple[PlanStep, ...], kept: int) -> Outcome | None:
        """Let a new plan take the place, after the step at work if it begins with that one too."""
        about, carried = self._about, self._carried
        carried.following_kept = kept
        carried.following_name = about.new_name()
        about.telling.found(answer, carried.following_name)
        if not self._takes_over(steps):
            return Outcome("plan_changed", {"why": "a new plan begins in another way"})
        self._look("earlier")
        return None

    def _takes_over(self, steps: tuple[PlanStep, ...]) -> bool:
        """These steps take the place; whether the step at work is the first of them, and may go on."""
        carried = self._carried
        carried.following = steps
        if carried.course.steps_of(carried.course.at_work) != steps[:1]:
            return False
        carried.course = PlanProgress(steps, carried.course.domain, carried.course.goal)
        carried.course.begin(1)
        carried.superseded.set()
        self._state.said_broken = False
        return True
