"""Dispatcher executes actions on components and posts their answers as messages; no other part calls skills.

A skill is cancelled with the activation that started it (S0.15). A component takes earlier configuration before a
skill begins. Unless it is `concurrent`, its cancelled skills clean up first. Arguments and answers are encoded, so
that nothing is shared by accident.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from dsc.blocking import DeadlineError
from dsc.calls import Clock, Ended, Outcome, Reports, SkillCall, Status
from dsc.components.component import Component
from dsc.components.hooks import GRACE, contained, give_up, is_own
from dsc.components.life_cycle import Life
from dsc.components.robot import Wiring, require_instances
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
from dsc.messages import SkillMessage, TimerMessage
from dsc.sequencer.cancellation import PendingCleanups, TimeLimit
from dsc.sequencer.clock import LoopClock
from dsc.sequencer.outbox import CLOSING, Outbox, failure
from dsc.sequencer.outcome_checks import broken, encoded, late, validated
from dsc.sequencer.resumed_skills import InterruptedSkill, PastClock, required_status
from dsc.sequencer.timers import Timers
from dsc.skills import SkillSignature
from dsc.supervision.activation import ComponentActivation
from dsc.supervision.component_registry import ComponentRegistry
from dsc.supervision.skill_dependencies import SkillDependencies
from knowledge_base.errors import InputError, UnknownNameError, described

DEFAULT_WITHIN = 300.0
"""Seconds a skill may take if the trigger does not say: every wait has a bound."""
UNKNOWN_SKILL = SkillSignature("", "", {}, {}, {}, after_crash="repeat")
"""Of a skill that the component does not have: its execution fails."""
_MOST_FAULTS = 100
"""Faults that the end of a run reports."""


class Dispatcher:
    """Starts, configures and cancels.

    Args:
        components: the owners of the skills.
        clock: run time.
        post: receives the answers, in the order of their arrival.
        part_of: a prefix of the action ids that components receive.

    Attributes:
        activation: keeps required components alive and active.
        outbox: one-way outputs to components.
        timers: timeouts, periods and delayed events.
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
        self.activation = ComponentActivation(self._registry, self._in_use)
        self._wiring = Wiring(self._components)
        self._faults: list[str] = []
        self._clock = clock
        self._post = post
        self._running: dict[str, _Running] = {}
        self._cleanups = PendingCleanups(self.activation.changed)
        self._forget_tasks: set[asyncio.Task[None]] = set()
        self.outbox = Outbox()
        self.timers = Timers(clock, post)

    def deploy(self, component: Component) -> None:
        """Add a component; it replaces one of the same name, and skills that need it begin."""
        self.activation.deployed(component)
        self._registry.deploy(component)
        self._wiring.deployed(component)

    def started(self) -> tuple[Start, ...]:
        """The skills that run, or whose answer was not taken yet."""
        return tuple([one.start for one in self._running.values()])

    @property
    def in_use(self) -> frozenset[str]:
        """Names of the components with skills that run, the root's needs in an activation tree."""
        return frozenset(one.start.component for one in self._running.values())

    def _in_use(self) -> Iterable[str]:
        """The components in use, and those whose cancelled skills still clean up."""
        return (*self.in_use, *self._cleanups.pending)

    @property
    def waiting(self) -> bool:
        """Whether an answer or timeout is pending.

        Periods do not count, as they are always pending, nor do events without a bound, as they may never come.
        """
        return self.timers.waiting or any(math.isfinite(one.due) for one in self._running.values())

    def dispatch(self, output: Output) -> None:
        """Execute one output of the machine.

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
            self.outbox.send(self.component(output.component), output)
            if isinstance(output, SwitchMode):
                self.activation.switched(output.component, output.mode)
        # The rest are notes, which the trace has.

    @property
    def components(self) -> Mapping[str, Component]:
        """The deployed components by name."""
        return self._components

    def component(self, name: str) -> Component:
        """The component of that name; raises `UnknownNameError`."""
        if name not in self._components:
            raise UnknownNameError(f"there is no component '{name}'", found=name, valid=self._components)
        return self._components[name]

    def memories(self) -> Iterator[tuple[str, Any]]:
        """Memories of components by their names; a component that fails keeps its last one."""
        for component in self._components.values():
            if type(component).remember is not Component.remember:
                try:
                    with contained():
                        memory = component.remember()
                except Exception as error:  # noqa: BLE001  # the others remember
                    self._fault(f"component '{component.name}' cannot say what it remembers: {described(error)}")
                else:
                    yield component.name, memory

    def _fault(self, what: str) -> None:
        """Report a fault at the end of the run, one time; of very many the first `_MOST_FAULTS`."""
        if what not in self._faults and len(self._faults) < _MOST_FAULTS:
            self._faults.append(what)

    def settle(self, start: Start) -> None:
        """The final answer of a skill was taken; until then its component counts as in use."""
        self._running.pop(start.action_id, None)
        if start.component in self.activation.concerned:
            self.activation.look()
        component = self._components.get(start.component)
        if component is not None and type(component).forget is not Component.forget:
            task = asyncio.get_running_loop().create_task(_forgotten(component, self._id(start)))
            self._forget_tasks.add(task)
            task.add_done_callback(self._forget_tasks.discard)

    def report_taken(self, start: Start) -> None:
        """A report of a skill was taken, so that there is room for another."""
        running = self._running.get(start.action_id)
        if running is not None and running.reports is not None:
            running.reports.taken()

    def dismiss(self, start: Start) -> None:
        """Stop a skill whose report was its failure; a later answer does not count."""
        running = self._running.get(start.action_id)
        if running is not None:
            running.answered = True
        self.stop(start)

    def stop(self, start: Start) -> None:
        """Cancel a skill and drop its answer."""
        if start.action_id not in self._running:
            return
        stopped = self._running.pop(start.action_id)
        stopped.limit.end()
        stopped.task.cancel()
        self._cleanups.add(start.component, stopped.task, partial(self._not_stopped, start))

    def restore(self, component: str, effective: Sequence[SetParameter | SwitchMode]) -> None:
        """Restore the effective settings of before a restart; raises `UnknownNameError`."""
        self.outbox.restore(self.component(component), effective)
        for one in effective:
            if isinstance(one, SwitchMode):
                self.activation.switched(component, one.mode)

    def resume(self, start: Start, interrupted: InterruptedSkill) -> None:
        """Continue a skill that a restart interrupted; raises `UnknownNameError`."""
        self._start(start, interrupted)

    async def abandon(self, start: Start) -> None:
        """Let a component stop a skill that was cancelled just before a restart.

        If the skill had ended before, its answer is posted, as its observations are true.

        Raises:
            InputError: the component failed to stop it.
        """
        component, action_id = self.component(start.component), self._id(start)
        try:
            async with asyncio.timeout(CLOSING):
                with contained():
                    ended = await component.abandon(action_id, start.skill, encoded(start.arguments))
        except Exception as error:  # an error of a component must not end the program
            raise InputError(f"{start.component}.{start.skill} may still go on: {described(error)}") from error
        if ended is not None:
            signature = component.skills().get(start.skill, UNKNOWN_SKILL)
            outcome = validated(ended.outcome, start, signature)
            self._post(SkillMessage(start, outcome, final=True, declared=signature.outcomes.get(outcome.event)))

    async def close(self) -> list[str]:
        """Cancel skills and timers, and wait until skills have stopped and components have taken their outputs.

        Returns:
            Deliveries that failed without failing a skill, and the faults of the run.
        """
        for activation in {start.activation for start in self.started()}:
            self._cancel(activation)
        self.timers.close()
        tasks = [*self._cleanups.tasks(), *self._forget_tasks, *self.outbox.tasks()]
        if tasks:
            stopped, others = await asyncio.wait(tasks, timeout=CLOSING)
            for task in others:
                task.cancel()
                give_up(task)
            for task in stopped:
                failure(task)  # marks it as retrieved; the skill was cancelled
        await self.activation.close()
        self._wiring.close()
        return [*self.outbox.failures(), *self._faults]

    def _start(self, start: Start, interrupted: InterruptedSkill | None = None) -> None:
        component = self.component(start.component)
        signature = component.skills().get(start.skill, UNKNOWN_SKILL)
        within = start.within or (math.inf if signature.pattern == "event" else DEFAULT_WITHIN)
        due = within + (self._clock.now() if interrupted is None else interrupted.began)
        running = _Running(start, signature, within, due)
        running.task = asyncio.get_running_loop().create_task(self._execute(component, running, interrupted))
        running.over = partial(self._over, running)
        running.task.add_done_callback(running.over)
        self._running[start.action_id] = running
        if start.component in self.activation.concerned:
            self.activation.look()
        running.limit = TimeLimit(running.task, partial(self._overdue, start), self._clock, due)

    def _id(self, start: Start) -> str:
        return self._part_of + start.action_id

    def _report(self, running: _Running, report: Outcome, conflated: int) -> None:
        if report.event == SKILL_ERROR:
            self._post(SkillMessage(running.start, report, final=True, goes_on=True, conflated=conflated))
            return
        declared = running.signature.outcomes.get(report.event)
        self._post(SkillMessage(running.start, report, final=False, conflated=conflated, declared=declared))

    def _overdue(self, start: Start) -> None:
        """A skill ignored its time limit; the chart need not wait for it."""
        running = self._running.get(start.action_id)
        if running is not None and not running.answered:
            self._not_stopped(start)
            self._answer(running, late(start, running.within))

    def _not_stopped(self, start: Start) -> None:
        skill = f"{start.component}.{start.skill}"
        self._fault(f"skill '{skill}' went on for {GRACE:g} s after it was cancelled and was given up")

    def _answer(self, running: _Running, outcome: Outcome) -> None:
        """Post the end of a skill, one time; its time limit ends only after that."""
        if not running.answered:
            if running.reports is not None:
                running.reports.flush()
            declared = running.signature.outcomes.get(outcome.event) if outcome.attributes else None
            self._post(SkillMessage(running.start, outcome, final=True, declared=declared))
            running.answered = True
            running.limit.end()

    def _over(self, running: _Running, task: asyncio.Task[None]) -> None:
        """The task of a skill has ended: without an answer the skill has failed, unless it was stopped."""
        why = asyncio.CancelledError("its task was cancelled") if task.cancelled() else task.exception()
        if why is not None and self._running.get(running.start.action_id) is running:
            self._answer(running, broken(running.start, described(why)))

    async def _execute(self, component: Component, running: _Running, interrupted: InterruptedSkill | None) -> None:
        self._answer(running, await self._outcome(component, running, interrupted))
        running.task.remove_done_callback(running.over)  # each takes a turn of the loop

    async def _outcome(self, component: Component, running: _Running, interrupted: InterruptedSkill | None) -> Outcome:
        start, signature, taken = running.start, running.signature, 0

        def report(outcome: Outcome) -> None:
            nonlocal taken
            if taken:  # before the restart
                taken -= 1
            elif start.action_id in self._running:
                running.reports = running.reports or Reports(partial(self._report, running))
                running.reports.put(validated(outcome, start, signature))

        dependencies = SkillDependencies(self._registry, self.activation, component)
        clock: Clock = PastClock(self._clock, interrupted.began) if interrupted else self._clock
        call = SkillCall(self._part_of + start.action_id, clock, report, running.due, self._fault)
        try:
            if component.name in self._cleanups.pending and not component.concurrent and signature.pattern == "skill":
                await self._cleanups.over(component.name)
            if component.name in self.outbox.untaken:
                await self.outbox.taken(component)
            if dependencies.concerned or component.life.state is not Life.ALIVE:
                await dependencies.ready()
            if interrupted is not None:
                status = await required_status(component, signature, start, call.action_id)
                if isinstance(status, Ended):
                    return validated(status.outcome, start, signature)
                if status is Status.RUNNING or signature.pattern != "event":  # else it is activated again
                    taken = interrupted.reports
            work = component.execute(start.skill, call, encoded(start.arguments) if start.arguments else {})
            outcome = validated(await dependencies.carrying(work), start, signature)
        except BaseException as error:
            failed = _failed(error, running, dependencies)
            if failed is None:
                raise
            return failed
        # Its observations are true, however late they arrive.
        return replace(late(start, running.within), observed=outcome.observed) if running.limit.passed else outcome

    def _cancel(self, activation: int) -> None:
        for running in tuple(self._running.values()):
            if running.start.activation == activation:
                self.stop(running.start)
        self.timers.cancel(activation)


@dataclass(slots=True)
class _Running:
    """A skill that runs.

    Attributes:
        start, signature: of the skill.
        within, due: seconds that it may take, and the second of run time at which they are over.
        task, limit: its execution, and the bound of that.
        over: the callback at the end of the task.
        reports: its intermediate events.
        answered: whether its end was posted.
    """

    start: Start
    signature: SkillSignature
    within: float
    due: float
    task: asyncio.Task[None] = field(init=False)
    limit: TimeLimit = field(init=False)
    over: Callable[[asyncio.Task[None]], None] = field(init=False)
    reports: Reports | None = None
    answered: bool = False


async def _forgotten(component: Component, action_id: str) -> None:
    with suppress(Exception), contained():  # the action is over: an error now must not end the run
        await component.forget(action_id)


def _failed(error: BaseException, running: _Running, dependencies: SkillDependencies) -> Outcome | None:
    """The outcome of a skill that raised; `None` if its task was cancelled from outside."""
    start, limit = running.start, running.limit
    cancelled = issubclass(type(error), asyncio.CancelledError)
    if cancelled and limit.has_cancelled():
        return late(start, running.within, dependencies.missing)
    if not is_own(error, running.task):
        return None
    if cancelled:
        return broken(start, "CancelledError: it cancelled itself")
    if limit.passed or issubclass(type(error), DeadlineError):
        return late(start, running.within)
    return broken(start, described(error))
