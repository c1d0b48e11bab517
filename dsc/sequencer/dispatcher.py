"""The dispatcher: executes actions on components and posts their answers as messages; no other part calls skills.

A skill is cancelled when the activation that started it ends (S0.15). Before a skill begins, its component has received
all earlier parameters, modes and messages. All components have then received the parameters and modes of its macrostep.
Unless the component is `concurrent`, its cancelled skills clean up first. Chart and component share no object.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import Any

from dsc.calls import Clock, Ended, SkillCall, Status
from dsc.components.assembly import require_instances
from dsc.components.component import Component
from dsc.components.hooks import abandon, active_component, bug_in, cancel_once, contained, reason_of
from dsc.components.life_cycle import Life
from dsc.components.turns import Claim, Turns
from dsc.components.wiring import Wiring
from dsc.dynamic.library import Library
from dsc.engine import steps
from dsc.errors import UncertainActionError
from dsc.events import (
    COMPONENT_FAILED,
    COMPONENT_RECOVERED,
    PROGRAMMING_ERROR,
    SKILL_ERROR,
    SKILL_FAILURES,
    Event,
    command_failure,
)
from dsc.messages import LateMessage, SkillMessage, TimerMessage, Told
from dsc.outcomes import Outcome
from dsc.run_log import run_logger
from dsc.sequencer.clock import LoopClock, PastClock
from dsc.sequencer.inbox import Timers
from dsc.sequencer.message_checks import arguments_for, encoded, late, validated
from dsc.sequencer.outbox import CLOSING, Outbox, command, failure, port_of
from dsc.sequencer.running_skills import InterruptedSkill, PendingCleanups, RunningSkill, WaitObserver
from dsc.sequencer.undeployed import Undeployed, no_component
from dsc.skills import SkillSignature
from dsc.supervision.activation import ComponentActivation
from dsc.supervision.component_registry import ComponentRegistry
from dsc.supervision.lives import ComponentLives
from dsc.supervision.skill_dependencies import SkillDependencies
from dsc.supervision.sources import Sources
from knowledge_base.errors import InputError

_LOG = run_logger(__package__)
DEFAULT_WITHIN = 300.0
"""Seconds after which a skill without `within` in its trigger is cancelled, so that every wait has a bound."""
UNKNOWN_SKILL = SkillSignature("", "", {}, {}, {}, after_crash="repeat")
"""The signature of a skill that the component lacks; the skill's execution fails."""
_FOR_COMPONENTS = steps.Start | Told
_MOST_FAULTS = 100
"""Upper bound of the number of faults that are reported at the end of a run."""


class Dispatcher:
    """Executor of actions: starts and cancels skills, and sends commands to components.

    Args:
        components: the owners of the skills.
        clock: run time.
        post: receives skills' answers and timers' messages, in the order of their arrival.
        observer: names the states of skills, and records which skills wait.
        part_of: a prefix of the action ids that components receive.
        run_id: identifies the run, see `SkillCall.key`.
        library: the plots, whose records the types of skills may name; it receives the records of skills.

    Attributes:
        components: the deployed components by name.
        activation: keeps required components alive and active.
        sources: the components whose values watched conditions read.
        lives: notices failures and restarts of components.
        outbox: one-way outputs to components.
        timers: timeouts, periods, delayed events and scheduled input from outside.
        wiring: the wires between components.
    """

    def __init__(
        self,
        components: Iterable[Component],
        clock: LoopClock,
        post: Callable[[SkillMessage | TimerMessage | steps.SendLater | LateMessage | Event], None],
        observer: WaitObserver,
        part_of: str = "",
        run_id: str = "",
        library: Library | None = None,
    ) -> None:
        self._library = library or Library()
        self._observer = observer
        self._part_of = part_of
        self._run_id = run_id
        self.components = {component.name: component for component in require_instances(components)}
        self.activation = ComponentActivation(ComponentRegistry(self.components), self._in_use)
        self.sources = Sources(self.activation)
        self.outbox = Outbox(self._post_refusal)
        self.lives = ComponentLives(self.components.values(), self._post_failure, self._post_recovery)
        self._undeployed = Undeployed(clock, post, self._post_refusal, self.components.keys())
        self.wiring = Wiring(self.components)
        self.wiring.listen(self.activation.look)
        self._faults: list[str] = []
        self._failures: dict[str, str] = {}  # reasons of the components that have failed and not recovered
        self._unreported: dict[str, list[str]] = {}  # reasons of failed components, which their skills may report
        self._closing = False
        self._clock = clock
        self._post = post
        self._running: dict[str, RunningSkill] = {}
        self._cleanups = PendingCleanups(self.activation.changed)
        self._asked: list[Turns] = []
        self._forget_tasks: set[asyncio.Task[None]] = set()
        self.timers = Timers(clock, post)
        clock.attend(self._tasks_of)

    def deploy(self, component: Component, *, last: bool = False) -> None:
        """Add a component, which replaces one with an equal name; skills and commands that wait for it begin.

        After the `last` component, a skill or command for a missing component fails without waiting.
        """
        self._undeployed.complete = last
        self.lives.add(component)
        self.activation.deploy(component)
        self.wiring.deployed(component)
        for held in self._undeployed.release(component.name):
            if isinstance(held.output, steps.Start):
                self._start(held.output, InterruptedSkill(held.at, None, 0))
            else:
                self._send(held.output)
        if self._asked:
            self.give_turns()

    def skills(self) -> list[SkillSignature] | None:
        """Return the signatures of all deployed skills; `None` if more components may be deployed."""
        if not self._undeployed.complete:
            return None
        return [skill for component in self.components.values() for skill in component.skills().values()]

    @property
    def is_part(self) -> bool:
        """Whether the run is a part of another run."""
        return bool(self._part_of)

    def started(self) -> tuple[steps.Start, ...]:
        """Return the starts of skills that are running, or whose final answer was not handled yet."""
        return tuple([one.start for one in self._running.values()])

    def running(self) -> tuple[tuple[RunningSkill, str], ...]:
        """Return the running skills, each with the component that it waits for as text; empty if it executes."""
        return tuple([(one, one.missing) for one in [*self._running.values()]])  # also for other threads

    @property
    def in_use(self) -> frozenset[str]:
        """Names of the components with running skills, which the root of the activation tree needs."""
        return frozenset(one.start.component for one in self._running.values())

    def _in_use(self) -> Iterable[str]:
        """Return the components with running skills, those with cancelled skills that clean up, and sources."""
        return (*self.in_use, *self._cleanups.pending, *self.sources.names)

    @property
    def waiting(self) -> bool:
        """Whether an answer or timeout is pending.

        Periods do not count, as they are always pending. Skills without a deadline do not count, as they may never end.
        """
        return (
            self.timers.waiting
            or self._undeployed.waiting
            or any(math.isfinite(one.due) for one in self._running.values())
        )

    @property
    def watching(self) -> Iterator[RunningSkill]:
        """The skills and activated events without a time limit, which may answer at any time, or never."""
        return (one for one in self._running.values() if math.isinf(one.due))

    def dispatch_all(self, outputs: Iterable[steps.Output]) -> None:
        """Execute the outputs of a macrostep."""
        self.outbox.begin_step()
        for output in outputs:
            self.dispatch(output)
        if self._asked:
            self.give_turns()

    def dispatch(self, output: steps.Output) -> None:
        """Execute one output of the machine; an output for a component that is not deployed waits, or fails."""
        if isinstance(output, _FOR_COMPONENTS) and output.component not in self.components:
            within = output.within if isinstance(output, steps.Start) else None
            self._undeployed.hold(output, within or DEFAULT_WITHIN)
            return
        match output:
            case steps.Start():
                self._start(output)
            case steps.Cancel():
                self._cancel(output.activation)
            case steps.StartTimer():
                self.timers.schedule(TimerMessage(output), self._clock.now() + output.seconds)
            case steps.SendLater():
                self.timers.schedule(output, self._clock.now() + output.seconds)
            case steps.Revoke():
                self.timers.revoke(output)
            case steps.SetWire():
                self._wire(output)
            case steps.SetParameter() | steps.SwitchMode() | steps.SendMessage():
                self._send(output)
            case steps.Note():
                pass  # the trace records notes

    def _wire(self, wire: steps.SetWire) -> None:
        try:
            self.wiring.wire(f"{wire.component}.{wire.port}", wire.to, wire.activation)
        except InputError as error:
            self._post_refusal(wire, error)

    def _send(self, told: Told) -> None:
        self.outbox.send(self.component(told.component), told)
        if isinstance(told, steps.SwitchMode):
            self.activation.switched(told.component, told.mode)

    @property
    def undelivered(self) -> Collection[Told]:
        """Commands that were neither received nor refused yet."""
        return [*self.outbox.undelivered, *self._undeployed.commands] if self._undeployed else self.outbox.undelivered

    def component(self, name: str) -> Component:
        """Return the component of that name; raise `UnknownNameError` if it is missing."""
        if name not in self.components:
            raise no_component(name, self.components)
        return self.components[name]

    def unfinished(self) -> Iterator[str]:
        """Yield the skills that have not ended, and the components whose `stop` is due, as texts."""
        for running in self._running.values():
            yield f"skill {running.describe()} has not ended"
        for name in self._cleanups.pending:
            yield f"a cancelled skill of component '{name}' has not ended"
        for component in self.components.values():
            if component.life.started:
                yield f"component '{component.name}' was not stopped"

    def _tasks_of(self, component: str) -> list[asyncio.Task[None]]:
        return [one.task for one in self._running.values() if one.start.component == component]

    def skill_of(self, task: asyncio.Task[Any]) -> str | None:
        """Return the skill whose execution is this task, as `arm.grasp`; `None` for other tasks."""
        starts = (one.start for one in tuple(self._running.values()) if one.task is task)
        return next((f"{start.component}.{start.skill}" for start in starts), None)

    def signature(self, start: steps.Start) -> SkillSignature:
        """Return the signature of a skill with all known records; `UNKNOWN_SKILL` for a skill that is missing."""
        component = self.components.get(start.component)
        found = UNKNOWN_SKILL if component is None else component.skills().get(start.skill, UNKNOWN_SKILL)
        if found.records:
            self._library.declare(found.records)
        return replace(found, records=self._library.records) if self._library.records else found

    def memories(self) -> Iterator[tuple[str, Any]]:
        """Yield names and memories of components.

        A component whose `remember` fails is skipped, and keeps its last memory.
        """
        for component in self.components.values():
            if type(component).remember is not Component.remember:
                try:
                    with contained(f"{component.name}.remember", component.device_errors):
                        memory = component.remember()
                except Exception as error:  # noqa: BLE001  # the other components remember
                    self._fault(f"component '{component.name}' cannot return its memory: {reason_of(error)}")
                else:
                    yield component.name, memory

    def _fault(self, what: str) -> None:
        """Add a fault for the end of the run, one time; only the first `_MOST_FAULTS` faults are kept."""
        if what not in self._faults and len(self._faults) < _MOST_FAULTS:
            self._faults.append(what)

    def settle(self, start: steps.Start) -> None:
        """End a skill whose final answer was handled; until then, its component counts as in use."""
        ended = self._running.pop(start.action_id, None)
        if ended is not None and ended.claim is not None:
            self._free(ended.claim)
            ended.claim = None  # it refers to the skill
        if start.component in self.activation.concerned:
            self.activation.look()
        component = self.components.get(start.component)
        if component is not None and type(component).forget is not Component.forget:
            task = asyncio.get_running_loop().create_task(self._forget(component, self._part_of + start.action_id))
            self._forget_tasks.add(task)
            task.add_done_callback(self._forget_tasks.discard)

    def report_taken(self, start: steps.Start) -> None:
        """Count a report of a skill as handled, so that the skill may post another."""
        running = self._running.get(start.action_id)
        if running is not None and running.reports is not None:
            running.reports.taken()

    def dismiss(self, start: steps.Start) -> None:
        """Stop a skill that counts as ended: its time is over, it was preempted, or it failed by an invalid report."""
        if (running := self._running.get(start.action_id)) is not None:
            running.disbelieve()
        self.stop(start)

    def stop(self, start: steps.Start) -> None:
        """Cancel a skill and drop its answer."""
        if start.action_id not in self._running:
            return
        stopped = self._running.pop(start.action_id)
        stopped.stopped = True
        stopped.end_limit()
        cancel_once(stopped.task)
        if stopped.claim is not None:
            stopped.claim.end()
        self._cleanups.add(stopped)

    def restore(self, component: str, effective: Sequence[steps.SetParameter | steps.SwitchMode]) -> None:
        """Restore a component's effective settings after a restart; raise `UnknownNameError` if it is not deployed."""
        self.outbox.restore(self.component(component), effective)
        for one in effective:
            if isinstance(one, steps.SwitchMode):
                self.activation.switched(component, one.mode)

    def resume(self, start: steps.Start, interrupted: InterruptedSkill) -> None:
        """Continue a skill that a restart interrupted; raise `UnknownNameError` if its component is missing."""
        self._start(start, interrupted)
        if interrupted.began is not None and self._asked:
            self.give_turns()

    # -- turns: one skill at a time --------------------------------------------------------------------------

    async def settled(self) -> None:
        """Wait until nothing more happens at the present simulated time; in real time, for one loop iteration."""
        await self._clock.settled()

    def has_turns(self, start: steps.Start) -> bool:
        """Return whether the skill waits for its turn, see `Component.takes_turns`."""
        component = self.components.get(start.component)
        signature = None if component is None else component.skills().get(start.skill)
        return component is not None and signature is not None and component.takes_turns(signature)

    def _free(self, claim: Claim) -> None:
        """Free the turn of a skill that has ended; skills of the present macrostep, dispatched next, may get it."""
        turns = claim.turns
        if turns.holder is not claim:
            claim.leave()
            return
        turns.holder = None
        if turns.waiting:
            self._asked.append(turns)

    def give_turns(self) -> None:
        """Compare the claims of the skills that were started since the last call."""
        asked, self._asked = self._asked, []
        for turns in asked:
            turns.give()

    @property
    def waits(self) -> Iterator[str]:
        """Each skill that waits for its component, with the skill that the component executes, as text.

        Skills and commands whose component is not deployed follow.
        """
        for running in self._running.values():
            if running.holder is not None:
                component = self.components[running.start.component]
                yield f"{running.describe()} waits for {self._missing(running, component)}"
        yield from self._undeployed.describe()

    async def abandon(self, start: steps.Start) -> None:
        """Request that a component stops a skill that was cancelled just before a restart.

        If the skill had ended before, its answer is posted, as its observations are true.

        Raises:
            InputError: the component failed to stop the skill.
        """
        component, action_id = self.component(start.component), self._part_of + start.action_id
        try:
            async with asyncio.timeout(CLOSING):
                with contained(f"{component.name}.abandon", component.device_errors):
                    ended = await component.abandon(action_id, start.skill, encoded(start.arguments))
        except Exception as error:  # an error of a component must not end the program
            raise InputError(f"{start.component}.{start.skill} may continue: {reason_of(error)}") from error
        if ended is not None:
            signature = self.signature(start)
            outcome = validated(ended.outcome, start, signature)
            self._post(SkillMessage(start, outcome, final=True, declared=signature.outcomes.get(outcome.event)))

    async def close(self) -> list[str]:
        """Cancel skills and timers, and wait until skills have stopped and components have received their outputs.

        Returns:
            Errors of deliveries that made no skill fail, and the faults of the run.
        """
        self._closing = True
        self._clock.disregard(self._tasks_of)
        for activation in {start.activation for start in self.started()}:
            self._cancel(activation)
        self.timers.close()
        tasks = [*self._cleanups.tasks(), *self._forget_tasks, *self.outbox.close()]
        if tasks:
            stopped, others = await asyncio.wait(tasks, timeout=CLOSING)
            for task in others:
                task.cancel()
                abandon(task)
            for task in stopped:
                failure(task)  # marks the error as retrieved; the skill was cancelled
        await self.activation.close()
        self.wiring.close()
        unstopped = await self.lives.close(None if self.is_part else self.activation.needed)
        problems = [*self.outbox.failures(), *self._undeployed.close(), *self._faults, *unstopped]
        for problem in problems:
            _LOG.warning("%s", problem)  # a cancelled run has no `RunEnd`
        return problems

    def _start(self, start: steps.Start, interrupted: InterruptedSkill | None = None) -> None:
        component = self.component(start.component)
        signature = self.signature(start)
        endless = signature.unlimited or signature.pattern == "event"
        within = start.within or signature.within or (math.inf if endless else DEFAULT_WITHIN)
        since = self._clock.now() if interrupted is None else interrupted.asked
        running = RunningSkill(
            start, signature, component.device_errors, within, since,
            self._clock, self._post, self._fault, self._observer,
        )  # fmt: skip
        running.configuring = self.outbox.configuring
        if component.takes_turns(signature):
            running.claim, running.begun = Claim(component.turns, running, start.rank), False
            component.turns.waiting.append(running.claim)
            self._asked.append(component.turns)
        running.task = asyncio.get_running_loop().create_task(self._execute(component, running, interrupted))
        running.task.add_done_callback(running.ended)
        self._running[start.action_id] = running
        if start.component in self.activation.concerned:
            self.activation.look()
        running.begin_limit()

    async def _execute(self, component: Component, running: RunningSkill, interrupted: InterruptedSkill | None) -> None:
        active_component.set(component.name)
        dependencies = SkillDependencies(self.activation, component)
        running.waits_for = lambda one: dependencies.missing or self._missing(one, component)
        try:
            outcome = await self._outcome(component, running, dependencies, interrupted)
        except BaseException as error:
            failed = running.failed(error)
            if failed is None:
                self._report_failures(component.name)
                raise
            outcome = failed
        running.answer(outcome)
        if self._unreported:
            if outcome.event in SKILL_FAILURES and not running.stopped:
                self._forget_failures(component.name, str(outcome.attributes["reason"]))
            self._report_failures(component.name)
        running.task.remove_done_callback(running.ended)  # each callback costs a turn of the loop

    async def _outcome(
        self,
        component: Component,
        running: RunningSkill,
        dependencies: SkillDependencies,
        interrupted: InterruptedSkill | None,
    ) -> Outcome:
        start, signature = running.start, running.signature
        taken = 0  # number of reports from before the restart that the skill repeats

        def report(outcome: Outcome) -> None:
            nonlocal taken
            if taken:
                taken -= 1
            else:
                running.report(outcome)

        began = None if interrupted is None else interrupted.began
        clock: Clock = self._clock if began is None else PastClock(self._clock, began)
        action_id = self._part_of + start.action_id
        call = SkillCall(action_id, clock, report, running.due, self._fault, start.rank, running.held, self._run_id)
        if not running.begun:
            await running.turn()
        await self.outbox.configured(component, running.configuring)
        if dependencies.concerned or component.life.state is not Life.ALIVE:
            await dependencies.ready()
            await self.outbox.configured(component, {})  # the component may have started again, without its settings
        if interrupted is not None and began is not None:
            status = await component.status(call.action_id, start.skill, start.arguments)
            if isinstance(status, Ended):
                return validated(status.outcome, start, signature)
            if status is Status.UNKNOWN and signature.after_crash == "sense":
                raise UncertainActionError(f"the run was interrupted, and the effect of {call.action_id} is unknown")
            if status is Status.RUNNING or signature.pattern != "event":  # else the event is activated again
                taken = interrupted.reports
        work = component.execute(start.skill, call, arguments_for(start, signature) if start.arguments else {})
        outcome = validated(await dependencies.carrying(work), start, signature)
        # The observations are true, also if they arrive late.
        return late(start, running.within, observed=outcome.observed) if running.is_late else outcome

    def _missing(self, running: RunningSkill, component: Component) -> str:
        """Return, as text, the component for whose turn, outputs or start a skill waits; empty if it waits for none."""
        holder = running.holder
        if holder is not None:
            doing = f", which executes {holder}" if holder else ""
            return f"component '{running.start.component}'{doing}"
        unconfigured = self.outbox.unconfigured(running.start, running.configuring, self.components)
        if unconfigured or component.life.state is Life.ALIVE:
            return unconfigured
        return component.life.describe() + component.life.hook

    def _post_refusal(self, told: Told | steps.SetWire, error: Exception) -> None:
        """Post an event for the state whose command has failed; at the end of the run, report the failure."""
        bug, failed = bug_in(error), f"{command(told)}: {reason_of(error)}"
        reason = " ".join((failed if bug is None else str(bug)).split())
        self._forget_failures(told.component, reason)
        if self._closing:
            self._fault(failed)
        else:
            name = SKILL_ERROR if bug is None else PROGRAMMING_ERROR
            self._post(command_failure(name, told.component, port_of(told), reason, told.activation))

    def _post_failure(self, component: Component) -> None:
        """Post an event about a failed component, unless its skill, or a command to it, reports the failure."""
        name, reason = component.name, component.life.reason
        if self._failures.get(name) == reason:  # another attempt to start has failed
            return
        self._failures[name] = reason
        delivery = self.outbox.untaken.get(name)
        if name in self.in_use:
            self._unreported.setdefault(name, []).append(reason)
        elif delivery is not None and not delivery.done():
            self._unreported.setdefault(name, []).append(reason)
            delivery.add_done_callback(lambda _: self._report_failures(name))
        else:
            self._report_failure(name, reason)

    def _post_recovery(self, component: Component) -> None:
        """Post an event about the end of a failure, and deliver the settings again to a component that has started."""
        if component.life.state is Life.ALIVE:
            self.outbox.repeat(component)
        if self._failures.pop(component.name, None) is not None and not self._closing:
            self._post(Event(COMPONENT_RECOVERED, {"component": component.name}))

    def _forget_failures(self, name: str, told: str) -> None:
        """Forget the failures of a component that the reason of another failure contains."""
        unreported = self._unreported.pop(name, ())
        if kept := [reason for reason in unreported if reason not in told]:
            self._unreported[name] = kept

    def _report_failures(self, name: str) -> None:
        """Post the failures of a component that nothing else has reported."""
        for reason in self._unreported.pop(name, ()):
            self._report_failure(name, reason)

    def _report_failure(self, name: str, reason: str) -> None:
        if self._closing:  # no state receives an event any longer
            self._fault(f"component '{name}' has failed: {reason}")
        else:
            self._post(Event(COMPONENT_FAILED, {"component": name, "reason": reason}))

    async def _forget(self, component: Component, action_id: str) -> None:
        try:
            with contained(f"{component.name}.forget", component.device_errors):
                await component.forget(action_id)
        except Exception:  # noqa: BLE001  # the action has ended: a later failure must not end the run
            _LOG.info("component '%s' could not forget the action '%s'", component.name, action_id)

    def _cancel(self, activation: int) -> None:
        self._undeployed.cancel(activation)
        for running in tuple(self._running.values()):
            if running.start.activation == activation:
                self.stop(running.start)
        self.timers.cancel(activation)
        if self.wiring.changes:
            self.wiring.revert(activation)
