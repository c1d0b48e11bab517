"""While a plan is carried out: what breaks it, what makes it shorter, and what takes its place without a break."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing
from dataclasses import dataclass
from typing import TYPE_CHECKING

from dsc.skills import Outcome
from knowledge_base.language.printer import to_text
from knowledge_base.overlay import Overlay
from planning.execution.course import Course, cost_of, shortest_end
from planning.execution.monitor import Broken, Monitor, News, Reached, Shorter
from planning.execution.search import Found, NotFound, Search
from planning.plan import PlanFound

if TYPE_CHECKING:
    from knowledge_base.facts import Change
    from knowledge_base.store import KnowledgeBase
    from planning.execution.carried import Carried
    from planning.execution.telling import Telling
    from planning.plan import Plan, PlanningOutcome, PlanStep
    from planning.posing.derived import Derivation, Settled


@dataclass(frozen=True, slots=True)
class _Better:
    """A planner that goes on has found a better plan."""

    answer: PlanFound


@dataclass(frozen=True, slots=True)
class _Ended:
    """The step that was not to be interrupted has ended."""


_Heard = News | Found | NotFound | _Better | _Ended


@dataclass(slots=True)
class Watching:
    """One plan being watched.

    Attributes:
        carried: the plan.
        derivation: of the planning domain.
        knowledge, search, telling: as in the planning component.
        new_name: names a plan.
        is_own: whether a change by this author is the running step's own doing.
    """

    carried: Carried
    derivation: Derivation
    knowledge: KnowledgeBase
    search: Search
    telling: Telling
    new_name: Callable[[], str]
    is_own: Callable[[str], bool]

    async def watch(self) -> Outcome:
        """Watch until another plan shall take the place, or none; the outcomes are those of the skill `monitor`."""
        heard: asyncio.Queue[_Heard] = asyncio.Queue()
        one = _Watch(self, heard.put_nowait)
        try:
            one.begin()
            while True:
                outcome = one.answer(await heard.get())
                if outcome is not None:
                    self.carried.stopped = True
                    return outcome
        finally:
            one.end()


class _Watch:
    """What is going on while a plan is watched."""

    def __init__(self, about: Watching, hear: Callable[[_Heard], None]) -> None:
        self._about = about
        self._carried = about.carried
        self._put = hear
        self._said_broken = False
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
        self._look("earlier")  # the world went on between the search and now
        if carried.better is not None:
            self._beside.append(asyncio.create_task(self._improve(carried.better)))

    def end(self) -> None:
        self._carried.begun = None
        self._unsubscribe()
        for task in self._beside:
            task.cancel()
        if self._monitor is not None:
            self._monitor.close()

    def answer(self, news: _Heard) -> Outcome | None:
        """What watching ends with; `None` if it goes on."""
        carried = self._carried
        outcome: Outcome | None = None
        match news:
            case Reached():
                self._about.telling.skipped(carried.name, carried.course.left_steps, "the goal holds")
                outcome = Outcome("goal_holds")
            case Shorter(steps):
                carried.following = steps
                outcome = Outcome("plan_changed", {"why": "fewer steps lead to the goal"})
            case _Ended():
                outcome = Outcome("plan_changed", {"why": "another plan takes its place"})
            case NotFound():
                outcome = Outcome("plan_invalid", {"which": "", "why": news.reason, "author": "earlier"})
            case Broken() if self._can_go_on(news):
                carried.attempt.replans += 1
                self._beside.append(asyncio.create_task(self._plan_meanwhile()))
            case Broken():
                outcome = Outcome("plan_invalid", {"which": news.needed, "why": news.why, "author": news.author})
            case Found():
                outcome = self._follow(news.answer, news.steps, news.kept)
            case _Better(answer):
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
        about = self._about
        if self._monitor is not None:
            self._monitor.close()
        course = self._carried.course
        self._monitor = Monitor(course, course.domain, about.knowledge, about.is_own, self._hear)
        self._monitor.look(author)

    def _hear(self, news: News) -> None:
        if isinstance(news, Broken):
            if self._said_broken:
                return
            self._said_broken = True
            self._about.telling.broken(self._carried.course, news)
        self._put(news)

    def _begun(self, number: int) -> None:
        if self._carried.following is not None:
            self._put(_Ended())
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

    async def _plan_meanwhile(self) -> None:
        goal, course = self._carried.goal, self._carried.course
        self._about.telling.asked(to_text(goal), self._about.knowledge.version)
        try:
            found = await self._about.search.plan(goal, self._carried.seconds, course)
            if isinstance(found, Found):
                await found.close()
        except Exception as error:  # noqa: BLE001  whatever goes wrong beside a plan must not leave it unwatched
            found = NotFound("failed", f"{type(error).__name__}: {error}")
        self._put(found)

    async def _improve(self, better: AsyncGenerator[PlanningOutcome, None]) -> None:
        async with aclosing(better):
            async for answer in better:
                if isinstance(answer, PlanFound):
                    self._put(_Better(answer))

    def _better(self, plan: Plan) -> tuple[PlanStep, ...] | None:
        """The step at work and then the end of a better plan, if that costs less than what is left."""
        about, course = self._about, self._carried.course
        if self._carried.following is not None or self._said_broken or len(course.at_work) != 1:
            return None
        step = course.steps[course.at_work[0] - 1]
        ahead = Overlay(about.knowledge)
        ahead.apply(course.domain.effects(step, ahead))
        end = shortest_end(plan.steps, course.domain, ahead, course.goal)
        if end is None or cost_of(end, course.domain, ahead) >= cost_of(course.coming(), course.domain, ahead):
            return None
        return (step, *end)

    def _follow(self, answer: PlanFound, steps: tuple[PlanStep, ...], kept: int) -> Outcome | None:
        """Let a new plan take the place, after the step at work if it begins with that one too."""
        about, carried = self._about, self._carried
        carried.following, carried.following_kept = steps, kept
        carried.following_name = about.new_name()
        about.telling.found(answer, carried.following_name)
        if [carried.course.steps[number - 1] for number in carried.course.at_work] != list(steps[:1]):
            return Outcome("plan_changed", {"why": "a new plan begins in another way"})
        carried.course = Course(steps, carried.course.domain, carried.course.goal)
        carried.course.begin(1)
        self._said_broken = False
        self._look("earlier")
        return None
