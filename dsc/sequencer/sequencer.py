"""The sequencer: takes events one by one, lets the machine run to completion, commits, then dispatches."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from dsc.components.component import Component
from dsc.dynamic.library import Library
from dsc.engine.machine import Machine
from dsc.engine.steps import Output
from dsc.events import GAVE_UP, NO_PLAN, Event
from dsc.messages import FromOutside, LateMessage, Message, SkillMessage
from dsc.runs.kept import Kept
from dsc.runs.store import RunStore
from dsc.sequencer import message_checks
from dsc.sequencer.clock import LoopClock
from dsc.sequencer.dispatcher import Dispatcher
from dsc.sequencer.inbox import Inbox, LivelockGuard
from dsc.sequencer.reactor import Reactor, StepListener
from dsc.sequencer.recovery import recover, require_components
from dsc.trace import Trace
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta
from knowledge_base.store import KnowledgeBase

_MOST_GROUPED = 100
"""Macrosteps that may share a commit."""


@dataclass(frozen=True, slots=True)
class RunEnd:
    """The end of a run.

    Attributes:
        finished: the plot reached its final state.
        emitted: outcome events of the plot, in order.
        problem: the reason of an end elsewhere, or the error of its last step; else `None`.
    """

    finished: bool
    emitted: tuple[Event, ...] = ()
    problem: str | None = None

    @property
    def reached(self) -> bool:
        """Whether it finished, and none of its goals ended with `no_plan` or `gave_up`."""
        return self.finished and not any(event.name in {NO_PLAN, GAVE_UP} for event in self.emitted)


class Sequencer:
    """Runs one plot to its end.

    Args:
        library: all plots that may be used.
        knowledge: the world model; changed only by the plot's `tell`s and by what components observe.
        components: the skills, by the names the plots use.
        clock: run time; must be made inside the loop that runs the sequencer.
        trace: records everything; a fresh one by default.
        open_ended: whether events may come from outside while nothing is pending; if not, such a run ends with a
            problem.
        store: keeps the run, so that it can resume after a crash; its knowledge is `knowledge`.
        part_of: a prefix of the action ids that components receive; an id of the run of which this one is a part.

    Attributes:
        library, knowledge, clock, trace, store: as given.
        dispatcher: carries actions to components.
    """

    def __init__(
        self,
        library: Library,
        knowledge: KnowledgeBase,
        components: Iterable[Component],
        clock: LoopClock,
        trace: Trace | None = None,
        *,
        open_ended: bool = False,
        store: RunStore | None = None,
        part_of: str = "",
    ) -> None:
        message_checks.require_parts(library, knowledge, clock, trace, store)
        self.library = library
        self.knowledge = knowledge
        self.trace = trace or Trace(clock.now)
        self._reactor: Reactor = Reactor(library, knowledge, self.trace)
        self.clock = clock
        self.store = store
        if store is not None:
            self.trace.listen(store.hear)
        self._inbox = Inbox()
        self.dispatcher = Dispatcher(components, clock, self._inbox.put, part_of)
        self._open_ended = open_ended
        self._last_late = store.last_late if store is not None else 0
        self._before_events: list[Callable[[], Awaitable[None]]] = []

    @property
    def machine(self) -> Machine:
        """The chart with its present state."""
        return self._reactor.machine

    def listen(self, listener: StepListener) -> None:
        """Call `listener` with every later macrostep, before its actions leave."""
        self._reactor.listeners.append(listener)

    def wait_before_events(self, wait: Callable[[], Awaitable[None]]) -> None:
        """Await `wait` before each event: a breakpoint holds a run so."""
        self._before_events.append(wait)

    def rearrange(self, order: Callable[[Iterable[Message]], Iterable[Message]]) -> None:
        """Put the waiting messages in another order; for tests."""
        self._inbox.rearrange(order)

    def working_for(self, action_id: str) -> frozenset[str]:
        """Return the names of the components with skills inside the state that started `action_id`."""
        started = self.dispatcher.started()
        owner = next((start.activation for start in started if start.action_id == action_id), None)
        inside = frozenset() if owner is None else self.machine.state.activations_inside(owner)
        return frozenset(start.component for start in started if start.activation in inside)

    def diagnose(self) -> dict[str, Any]:
        """Return the status of the run as plain data: active states, running actions, number of waiting messages."""
        return {
            "component": "sequencer",
            "finished": self.machine.state.finished,
            "active": list(self.machine.state.configuration()),
            "working": [f"{start.component}.{start.skill}" for start in self.dispatcher.started()],
            "in_use": sorted(self.dispatcher.in_use),
            "switched_on": sorted(self.dispatcher.activation.on),
            "waiting": len(self._inbox.waiting),
            "knowledge_version": self.knowledge.version,
        }

    def post(self, event: Event, *, after: float = 0.0) -> None:
        """Post an event from outside, e.g. an operator's `stop`; from the loop's own thread.

        A store keeps a delayed event from now on, and any other from its macrostep on.

        Args:
            event: its name and attributes.
            after: seconds until it arrives; meanwhile the run has no deadlock.

        Raises:
            InputError: only the executive itself fires the event, e.g. `done`, or an attribute is not plain data.
            StoreError: the store cannot be written.
        """
        self._hand_in(message_checks.checked_event(event), after)

    def change(self, delta: Delta, author: str, *, after: float = 0.0) -> None:
        """Post a change of knowledge from outside; from the loop's own thread.

        Args:
            delta: the change.
            author: its author.
            after: as for `post`.

        Raises:
            InputError: the change contradicts the schema; the knowledge is unchanged.
            StoreError: the store cannot be written.
        """
        self._hand_in(message_checks.checked_change(delta, author, self.knowledge), after)

    def set_parameter(self, owner: str, name: str, value: object, *, after: float = 0.0) -> None:
        """Post an operator's setting of a parameter; from the loop's own thread.

        A component takes it before its next skill begins. A plot uses it at later entries without another value for
        it. A store keeps both.

        Args:
            owner: the component, or the plot, that has the parameter.
            name: of the parameter.
            value: within its range; of a component, `None` resets it.
            after: as for `post`.

        Raises:
            UnknownNameError: there is no such component or plot, or it declares no such parameter.
            InputError: the value is out of range, breaks a relation, or operators may not set it.
            StoreError: the store cannot be written.
        """
        setting = message_checks.checked_setting(owner, name, value, self.dispatcher.components, self.library)
        self._hand_in(setting, after)

    async def run(self, plot: str, arguments: Mapping[str, Any] | None = None) -> RunEnd:
        """Run the plot until it ends, or until a deadlock.

        Raises:
            InputError: the plot is unknown, or a parameter is missing or unknown.
            StoreError: the store cannot be written; the run can resume from its last commit.
        """
        given = message_checks.checked_arguments(self.library.plot(plot), {} if arguments is None else arguments)

        async def begin() -> None:
            self._start(plot, given)

        return await self._until_end(begin)

    async def resume(self, kept: Kept) -> RunEnd:
        """Continue a run after its last macrostep.

        Args:
            kept: the run from the store; clock and trace continue from it.

        Raises:
            StoreError: the store cannot be written.
            UnknownNameError: a component that the run needs is not deployed; nothing has happened.
        """
        require_components(kept, self.dispatcher)
        return await self._until_end(lambda: self._recover(kept))

    async def _until_end(self, begin: Callable[[], Awaitable[None]]) -> RunEnd:
        reactor, machine, inbox = self._reactor, self._reactor.machine, self._inbox
        # The tracer subscribes before skills do: consequences of a change are recorded after it.
        unsubscribe = self.knowledge.subscribe(reactor.tracer.knowledge)
        livelock = LivelockGuard(self.clock) if self.clock.simulated else None
        try:
            await begin()
            while not machine.state.finished and reactor.problem is None:
                if not inbox.waiting:
                    if self._is_deadlock():
                        reactor.problem = "deadlock: no skill, timer or event is pending"
                        break
                    await inbox.arrival()
                for wait in self._before_events:
                    await wait()
                message = inbox.waiting.popleft()
                if livelock is not None and (problem := livelock.problem(message)):
                    reactor.problem = problem
                    break
                self._take(message)
        except asyncio.CancelledError:  # cancelled from outside; a crash does not get here
            reactor.problem = reactor.problem or "it was cancelled"
            self._leave()
            self._keep_end()
            raise
        finally:
            try:
                self._leave()
            finally:
                untaken = await self.dispatcher.close()
                unsubscribe()
        if untaken and reactor.problem is None:
            reactor.problem = "; ".join(untaken)
        end = RunEnd(self.machine.state.finished, tuple(reactor.emitted), reactor.problem)
        self.trace.record("end", finished=end.finished, problem=end.problem)
        self._keep_end()
        return end

    def _keep_end(self) -> None:
        if self.store is not None and self.store.begun and not self.store.lost:
            with self.store.writing:
                self.store.end(finished=self.machine.state.finished, problem=self._reactor.problem)

    async def _recover(self, kept: Kept) -> None:
        self._reactor.restore(kept)
        try:
            await recover(kept, self.dispatcher)
        except InputError as error:
            self._reactor.problem = str(error)

    # -- macrosteps: commit, then dispatch ---------------------------------------------------------------

    def _start(self, plot: str, arguments: Mapping[str, Any]) -> None:
        store, reactor = self.store, self._reactor
        if store is None:
            reactor.tracer.world(self.knowledge)
            self._carry_out(reactor.start(plot, arguments))
            return
        with store.writing:
            serials = store.begin(plot, arguments, self.library)
            reactor.tracer.world(self.knowledge)
            for late, due, _ in self.dispatcher.timers:
                if isinstance(late, LateMessage):
                    store.late(late, due)
            output = reactor.start(plot, arguments, serials)
            self._keep_step(None, output)
        self._carry_out(output)

    def _take(self, message: Message) -> None:
        if isinstance(message, SkillMessage):
            message = message_checks.validated_in_world(message, self.knowledge)
        if self.store is None:
            output = self._reactor.react(message)
        else:
            with self.store.writing:
                output = self._react_and_keep(message)
                for _ in range(_MOST_GROUPED - 1):
                    if not self._may_group(message, output):
                        break
                    message = self._inbox.waiting.popleft()
                    output = self._react_and_keep(message)
        if isinstance(message, SkillMessage) and message.final:
            if message.goes_on:
                self._inbox.drop_answers(message.start)
                self.dispatcher.dismiss(message.start)
            else:
                self.dispatcher.settle(message.start)
        elif isinstance(message, SkillMessage):
            self.dispatcher.report_taken(message.start)
        self._carry_out(output)

    def _may_group(self, message: Message, output: Collection[Output]) -> bool:
        """Return whether the next macrostep may share the commit of this one.

        It may not if an output leaves between them. Each answer of a component has a separate commit.
        """
        waiting = self._inbox.waiting
        if output or self._before_events or not waiting:
            return False
        if isinstance(message, SkillMessage) or isinstance(waiting[0], SkillMessage):
            return False
        return not self.machine.state.finished and self._reactor.problem is None

    def _react_and_keep(self, message: Message) -> tuple[Output, ...]:
        output = self._reactor.react(message)
        self._keep_step(message, output)
        return output

    def _leave(self) -> None:
        """Dispatch nothing that could not be committed: another process owns the run of a lost store."""
        if self.store is None:
            output = self._reactor.leave()
        elif self.store.lost or not self.store.begun or self.machine.state.root is None:
            return
        else:
            with self.store.writing:
                output = self._reactor.leave()
                self._keep_step(None, output)
        self._carry_out(output)

    def _keep_step(self, message: Message | None, output: Iterable[Output]) -> None:
        assert self.store is not None  # noqa: S101
        outbox = self.dispatcher.outbox
        memories = self.dispatcher.memories()
        now, refused = self.clock.now(), outbox.refused()
        self.store.step(now, message, output, self._reactor, outbox.under_way, refused, memories)

    def _carry_out(self, output: Iterable[Output]) -> None:
        try:
            for one in output:
                self.dispatcher.dispatch(one)
        except InputError as error:
            self._reactor.problem = str(error)

    # -- from outside ------------------------------------------------------------------------------------

    def _hand_in(self, message: FromOutside, after: float) -> None:
        message_checks.require_seconds(after)
        if after <= 0:
            self._inbox.put(message)
            return
        self._last_late += 1
        late, due = LateMessage(message, self._last_late), self.clock.now() + after
        if self.store is not None and self.store.begun:
            with self.store.writing:
                self.store.late(late, due)
        self.dispatcher.timers.schedule(late, due)

    def _is_deadlock(self) -> bool:
        """Return whether no message can come: periods that all have changed nothing will never change anything."""
        if self._open_ended or self.dispatcher.waiting:
            return False
        return self.dispatcher.timers.periods <= self._reactor.in_vain
