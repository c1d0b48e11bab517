"""Carries actions to components and their answers back as messages; the only part that touches skills.

What is started for an activation is cancelled with it (S0.15). Configuration reaches a component before a
skill that is started after it, and what was cancelled there has put things in order, unless the component is
`concurrent`. Arguments and answers are encoded, so that nothing is shared by accident.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from dsc.blocking import DeadlineError
from dsc.calls import Clock, Ended, Outcome, SkillCall, Status
from dsc.components.abandonment import GRACE, give_up
from dsc.components.component import Component
from dsc.components.component_checks import require_instances
from dsc.components.hooks import contained, is_own
from dsc.components.reports import Reports
from dsc.components.streams import Wiring
from dsc.engine.steps import (
    Cancel,
    Output,
    Revoke,
    SendLater,
    SendMessage,
    SetParameter,
    Start,
    StartTimer,
    SwitchMode,
)
from dsc.events import SKILL_ERROR
from dsc.messages import Message, SkillMessage, TimerMessage
from dsc.sequencer.cancellation import PendingCleanups, TimeLimit
from dsc.sequencer.clock import LoopClock
from dsc.sequencer.outbox import CLOSING, Outbox, failure
from dsc.sequencer.outcome_checks import Declared, broken, declared, encoded, late
from dsc.sequencer.resumed_skills import InterruptedSkill, PastClock, asked_after
from dsc.sequencer.timers import Timers
from dsc.skills import Pattern
from dsc.supervision.activation import ComponentActivation
from dsc.supervision.component_registry import ComponentRegistry
from dsc.supervision.skill_dependencies import SkillDependencies
from knowledge_base.errors import InputError, UnknownNameError, described

DEFAULT_WITHIN = 300.0
"""Seconds a skill may take if the trigger does not say: every wait has a bound."""
_MOST_FAULTS = 100
"""Things that went wrong and are said at the end."""


class Dispatcher:
    """Starts, configures and cancels; `post` receives the answers, in the order in which they come.

    Args:
        components: the skills.
        clock: run time.
        post: see above.
        part_of: stands before the action ids that components see.

    Attributes:
        activity: who is switched on.
        outbox: what components are told.
        timers: what is due later.
    """

    def __init__(
        self,
        components: Iterable[Component],
        clock: LoopClock,
        post: Callable[[SkillMessage | TimerMessage | SendLater], None],
        part_of: str = "",
    ) -> None:
        self._part_of = part_of
        self._components = {component.name: component for component in require_instances(components)}
        self._registry = ComponentRegistry(self._components)
        self.activity = ComponentActivation(self._registry, self._at_work)
        self._wiring = Wiring(self._components)
        self._given_up: list[str] = []
        self._clock = clock
        self._post = post
        self._running: dict[str, _Running] = {}
        self._endings = PendingCleanups(self.activity.look)
        self._forgetting: set[asyncio.Task[None]] = set()
        self.outbox = Outbox()
        self.timers = Timers(clock, post)

    def deploy(self, component: Component) -> None:
        """Add a component; it replaces one of the same name. Who has waited for it goes on."""
        self.activity.deployed(component)
        self._registry.deploy(component)
        self._wiring.deployed(component)

    def started(self) -> tuple[Start, ...]:
        """The skills that are being carried out, or whose answer has not been taken yet."""
        return tuple([one.start for one in self._running.values()])

    @property
    def in_use(self) -> frozenset[str]:
        """Names of the components that carry out something, the root's needs in an activation tree."""
        return frozenset(start.component for start in self.started())

    def _at_work(self) -> Iterable[str]:
        """The components that carry out something, or still put things in order after what was cancelled."""
        return (*self.in_use, *self._endings.components())

    @property
    def waiting(self) -> bool:
        """Whether any answer or timeout is still to come.

        Periods, which always are, do not count; nor do events that were activated without a bound and may never come.
        """
        return self.timers.waiting or any(math.isfinite(one.within) for one in self._running.values())

    def _within(self, start: Start) -> float:
        """Seconds that it may take; an event lasts as long as the state that activated it."""
        return start.within or (math.inf if self._is_event(start) else DEFAULT_WITHIN)

    def _id(self, start: Start) -> str:
        return self._part_of + start.action_id

    def _is_event(self, start: Start) -> bool:
        return self._pattern(start) == "event"

    def _has_to_wait(self, start: Start) -> bool:
        """Whether skills of its component that were cancelled have to be over first."""
        if not self._endings.of(start.component) or self.component(start.component).concurrent:
            return False
        return self._pattern(start) == "skill"

    def _pattern(self, start: Start) -> Pattern | None:
        signature = self.component(start.component).skills().get(start.skill)
        return None if signature is None else signature.pattern

    def dispatch(self, output: Output) -> None:
        """Carry out one output of the machine.

        Raises:
            UnknownNameError: no component of that name is deployed.
        """
        if isinstance(output, Start):
            self._start(output)
        elif isinstance(output, Cancel):
            self._cancel(output.activation)
        elif isinstance(output, StartTimer):
            self.timers.start(output, self._clock.now() + output.seconds)
        elif isinstance(output, SendLater):
            self.timers.send(output, self._clock.now() + output.seconds)
        elif isinstance(output, Revoke):
            self.timers.revoke(output)
        elif isinstance(output, SetParameter | SwitchMode | SendMessage):
            self.outbox.tell(self.component(output.component), output)
            if isinstance(output, SwitchMode):
                self.activity.switched(output.component, output.mode)
        # What is left is a note, which the trace has.

    @property
    def components(self) -> Mapping[str, Component]:
        """Those that are deployed, by name."""
        return self._components

    def component(self, name: str) -> Component:
        """The component of that name; raises `UnknownNameError`."""
        if name not in self._components:
            raise UnknownNameError(f"there is no component '{name}'", found=name, valid=self._components)
        return self._components[name]

    def attributes_of(self, message: Message) -> Declared:
        """What the attributes of a skill's outcome are declared to be; nothing for any other message."""
        if not isinstance(message, SkillMessage) or not message.outcome.attributes:
            return {}
        component = self._components.get(message.start.component)
        signature = None if component is None else component.skills().get(message.start.skill)
        return {} if signature is None else signature.outcomes.get(message.outcome.event, {})

    def memories(self) -> Iterator[tuple[str, Any]]:
        """What components have to remember, by their names; one that fails keeps what it last said."""
        for component in self._components.values():
            if component.remembers:
                try:
                    with contained():
                        memory = component.remember()
                except Exception as error:  # noqa: BLE001  # whatever it is, the others remember
                    self._fault(f"component '{component.name}' cannot say what it remembers: {described(error)}")
                else:
                    yield component.name, memory

    def _fault(self, what: str) -> None:
        """Say at the end of the run what went wrong, once; of very many things the first."""
        if what not in self._given_up and len(self._given_up) < _MOST_FAULTS:
            self._given_up.append(what)

    def settle(self, start: Start) -> None:
        """The final answer of a skill has been taken; until then its component counts as busy."""
        self._running.pop(start.action_id, None)
        self.activity.look(start.component)
        component = self._components.get(start.component)
        if component is not None and type(component).forget is not Component.forget:
            task = asyncio.get_running_loop().create_task(_forgotten(component, self._id(start)))
            self._forgetting.add(task)
            task.add_done_callback(self._forgetting.discard)

    def report_taken(self, start: Start) -> None:
        """A report of a skill has been taken, so that there is room for another."""
        running = self._running.get(start.action_id)
        if running is not None and running.reports is not None:
            running.reports.taken()

    def dismiss(self, start: Start) -> None:
        """Stop a skill that has failed by what it reported: that was its answer, and whatever it says now is none."""
        running = self._running.get(start.action_id)
        if running is not None:
            running.answered = True
        self.stop(start)

    def stop(self, start: Start) -> None:
        """Cancel a skill; nobody waits for its answer any more."""
        if start.action_id not in self._running:
            return
        stopped = self._running.pop(start.action_id)
        stopped.limit.end()
        assert stopped.task is not None  # noqa: S101
        stopped.task.cancel()
        self._endings.add(start.component, stopped.task, partial(self._not_stopped, start))

    def tell_again(self, component: str, in_force: Sequence[SetParameter | SwitchMode]) -> None:
        """Put in force what was before a restart; raises `UnknownNameError`."""
        self.outbox.tell_again(self.component(component), in_force)
        for told in in_force:
            if isinstance(told, SwitchMode):
                self.activity.switched(component, told.mode)

    def take_up(self, start: Start, earlier: InterruptedSkill) -> None:
        """Go on with a skill that was under way before a restart; raises `UnknownNameError`."""
        self._start(start, earlier)

    async def abandon(self, start: Start) -> None:
        """Let a component stop what was cancelled just before a restart; raises `InputError` if it cannot.

        If it had ended all the same, its answer was under way, and what it observed is so.
        """
        component, action_id = self.component(start.component), self._id(start)
        try:
            async with asyncio.timeout(CLOSING):
                with contained():
                    ended = await component.abandon(action_id, start.skill, encoded(start.arguments))
        except Exception as error:  # whatever a component does wrong must not end the program
            raise InputError(f"{start.component}.{start.skill} may still go on: {described(error)}") from error
        if ended is not None:
            self._post(SkillMessage(start, declared(component, start, ended.outcome), final=True))

    async def close(self) -> list[str]:
        """Cancel skills and timers, and wait until they have stopped and components are told what they were sent.

        Returns:
            What components could not take, as far as no skill has failed because of it; and which skills did not
            stop when they were told to.
        """
        for activation in {start.activation for start in self.started()}:
            self._cancel(activation)
        self.timers.close()
        tasks = [*self._endings.tasks(), *self._forgetting, *self.outbox.tasks()]
        if tasks:
            stopped, others = await asyncio.wait(tasks, timeout=CLOSING)
            for task in others:
                task.cancel()
                give_up(task)
            for task in stopped:
                failure(task)  # of a skill that was cancelled, nobody wants to hear it
        await self.activity.close()
        self._wiring.close()
        return [*self.outbox.untaken(), *self._given_up]

    def _start(self, start: Start, earlier: InterruptedSkill | None = None) -> None:
        component = self.component(start.component)
        within = self._within(start)
        due = within + (self._clock.now() if earlier is None else earlier.began)
        limit = TimeLimit(partial(self._overdue, start), self._clock, due)
        running = _Running(start, within, limit)
        running.task = asyncio.get_running_loop().create_task(self._execute(component, running, earlier))
        running.over = partial(self._over, running)
        running.task.add_done_callback(running.over)
        self._running[start.action_id] = running
        self.activity.look(start.component)
        limit.begin(running.task)

    def _report(self, start: Start, report: Outcome, conflated: int) -> None:
        failed = report.event == SKILL_ERROR
        self._post(SkillMessage(start, report, final=failed, goes_on=failed, conflated=conflated))

    def _overdue(self, start: Start) -> None:
        """It swallowed that its time is over; the chart need not wait for it."""
        running = self._running.get(start.action_id)
        if running is not None and not running.answered:
            self._not_stopped(start)
            self._answer(running, late(start, running.within))

    def _not_stopped(self, start: Start) -> None:
        skill = f"{start.component}.{start.skill}"
        self._fault(f"skill '{skill}' went on for {GRACE:g} s after it was cancelled and was given up")

    def _answer(self, running: _Running, outcome: Outcome) -> None:
        """Post how a skill ended, once; until that has succeeded its time limit stands."""
        if not running.answered:
            if running.reports is not None:
                running.reports.flush()
            self._post(SkillMessage(running.start, outcome, final=True))
            running.answered = True
            running.limit.end()

    def _over(self, running: _Running, task: asyncio.Task[None]) -> None:
        """The task of a skill has ended: without an answer the skill has failed, unless it was stopped."""
        why = asyncio.CancelledError("its task was cancelled") if task.cancelled() else task.exception()
        if why is not None and self._running.get(running.start.action_id) is running:
            self._answer(running, broken(running.start, described(why)))

    async def _execute(self, component: Component, running: _Running, earlier: InterruptedSkill | None) -> None:
        self._answer(running, await self._outcome(component, running, earlier))
        assert running.task is not None  # noqa: S101
        running.task.remove_done_callback(running.over)  # each takes a turn of the loop

    async def _outcome(self, component: Component, running: _Running, earlier: InterruptedSkill | None) -> Outcome:
        start, within, limit, heard = running.start, running.within, running.limit, 0

        def report(outcome: Outcome) -> None:
            nonlocal heard
            if heard:
                heard -= 1
            elif start.action_id in self._running:
                running.reports = running.reports or Reports(partial(self._report, start))
                running.reports.put(declared(component, start, outcome))

        support = SkillDependencies(self._registry, self.activity, component)
        clock: Clock = PastClock(self._clock, earlier.began) if earlier else self._clock
        call = SkillCall(self._id(start), clock, report, clock.now() + within, self._fault)
        try:
            await self._ready(component, start, support)
            if earlier is not None:
                status = await asked_after(component, start, self._id(start))
                if isinstance(status, Ended):
                    return declared(component, start, status.outcome)
                if status is Status.RUNNING or not self._is_event(start):  # else it is activated anew
                    heard = earlier.reports
            work = component.execute(start.skill, call, encoded(start.arguments))
            outcome = declared(component, start, await support.carrying(work))
        except BaseException as error:
            failed = _failed(error, running, support)
            if failed is None:
                raise
            return failed
        # What it observed is so, however late it says so.
        return replace(late(start, within), observed=outcome.observed) if limit.passed else outcome

    async def _ready(self, component: Component, start: Start, support: SkillDependencies) -> None:
        """Wait until the skill can begin."""
        if self._has_to_wait(start):
            await self._endings.over(component.name)
        await self.outbox.taken(component)
        await support.ready()

    def _cancel(self, activation: int) -> None:
        for start in self.started():
            if start.activation == activation:
                self.stop(start)
        self.timers.cancel(activation)


@dataclass(slots=True)
class _Running:
    """A skill that is carried out, the seconds that it may take, what it reports, and whether it has answered."""

    start: Start
    within: float
    limit: TimeLimit
    reports: Reports | None = None
    answered: bool = False
    task: asyncio.Task[None] | None = None
    over: Callable[[asyncio.Task[None]], None] = lambda _: None


async def _forgotten(component: Component, action_id: str) -> None:
    with suppress(Exception), contained():  # it is over: whatever goes wrong now must not end the run
        await component.forget(action_id)


def _failed(error: BaseException, running: _Running, support: SkillDependencies) -> Outcome | None:
    """How a skill ends that raised; `None` if others end its task."""
    start, limit = running.start, running.limit
    cancelled = issubclass(type(error), asyncio.CancelledError)
    if cancelled and limit.has_cancelled():
        return late(start, running.within, support.missing)
    if not is_own(error, running.task):
        return None
    if cancelled:
        return broken(start, "CancelledError: it cancelled itself")
    if limit.passed or issubclass(type(error), DeadlineError):
        return late(start, running.within)
    return broken(start, described(error))
