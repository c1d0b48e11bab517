"""The sequencer: handles events one by one; each runs the machine to completion, is committed, then dispatched."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable, Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from functools import partial
from typing import Any, cast

from dsc.calls import Outputs, PlotCall
from dsc.components.component import Component
from dsc.components.hooks import GRACE, bug_in, programming_errors, unheard_errors
from dsc.dynamic.library import Library
from dsc.engine.machine import Machine
from dsc.engine.steps import Output, Start
from dsc.messages import FromOutside, KnowledgeMessage, LateMessage, Message, PlotsMessage, SkillMessage
from dsc.run_log import logged_run
from dsc.runs.kept import Kept
from dsc.runs.store import RunStore
from dsc.sensing.condition_handler import ConditionHandler
from dsc.sequencer import message_checks
from dsc.sequencer.clock import LoopClock
from dsc.sequencer.component_relations import ComponentRelations
from dsc.sequencer.component_tracing import ComponentTracer
from dsc.sequencer.dispatcher import Dispatcher
from dsc.sequencer.inbox import Inbox, LivelockGuard
from dsc.sequencer.outside_input import OutsideInput
from dsc.sequencer.phase_watch import PhaseWatch
from dsc.sequencer.reactor import Reactor, StepListener
from dsc.sequencer.recovery import recover, require_components
from dsc.sequencer.run_end import SUSPENDED, RunEnd
from dsc.sequencer.signals import OnSignal, unfinished_at_second_signal
from dsc.sequencer.watchdog import watched
from dsc.trace import Trace
from knowledge_base.errors import InputError, StoreError
from knowledge_base.facts import Change, Delta
from knowledge_base.sources import DataSource
from knowledge_base.store import KnowledgeBase

_MOST_GROUPED = 100
"""Maximum number of macrosteps that share one commit."""


class Sequencer(OutsideInput):
    """Executor of one plot, from its start to its end.

    Args:
        library: all plots that the run may use; later changes of it concern later runs.
        knowledge: the world model. Only the plot's `tell`s, observations of components, and changes from outside modify
            it.
        components: the components, whose names plots use.
        clock: run time; create it inside the loop that runs the sequencer.
        trace: receives all records; by default a new one.
        open_ended: whether the run waits for events from outside while no skill, timer or event is pending. Otherwise,
            such a run ends with a problem.
        store: keeps the run, so that the run can resume after a crash; the store must belong to `knowledge`.
        part_of: a prefix of the action ids that components receive: an id from the run of which this run is a part.
        run_id: identifies the run for the services that skills call, see `SkillCall.key`.
        until: second of run time at which a run that has not ended ends with a problem; `math.inf` means never.
        phases: reports coordination phases that take long.
        failures: outcome events with which the plot does not reach its goal, although it finishes.

    Attributes:
        library: all plots that the run may use.
        knowledge: the world model.
        clock: run time.
        trace: the trace of the run.
        store: the run store, or `None`.
        on_signal: whether Ctrl-C, SIGTERM, SIGHUP and a cancellation of its task suspend a run with a store, or end it.
        dispatcher: sends actions to components.
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
        run_id: str = "",
        until: float = math.inf,
        phases: PhaseWatch | None = None,
        failures: Collection[str] = (),
    ) -> None:
        message_checks.require_parts(library, knowledge, clock, trace, store)
        super().__init__()
        self.knowledge = knowledge
        self.trace = trace or Trace(clock.now)
        self._reactor: Reactor = Reactor(library, knowledge, self.trace, phases, run="" if clock.simulated else run_id)
        self.library = self._reactor.library
        self.clock = clock
        self.store = store
        self.on_signal: OnSignal = "suspend"
        if store is not None:
            self.trace.listen(store.receive)
        self._inbox = Inbox()
        self.dispatcher = Dispatcher(components, clock, self._inbox.put, self, part_of, run_id, self.library)
        self.dispatcher.deploy(ConditionHandler(self.dispatcher.components, self.dispatcher.sources.work, knowledge))
        self._live = knowledge.live_rows
        self._relations = ComponentRelations(
            self.dispatcher, lambda: self.machine.state, self._live, self._reactor.renew
        )
        self._tracer = ComponentTracer(self.trace, self.dispatcher.wiring, self.dispatcher.activation)
        self._open_ended = open_ended
        self._over = False
        self._stopped: str | None = None  # the reason to end the run, from outside; not kept with its state
        self._reacts = False  # changes of knowledge are then the run's own
        self._wake_up: KnowledgeMessage | None = None  # the latest message for waiting guards
        self._until = until
        self._failures = failures
        self._last_late = store.last_late if store is not None else 0
        self._before_events: list[Callable[[], Awaitable[None]]] = []

    @property
    def machine(self) -> Machine:
        """The chart with its present state."""
        return self._reactor.machine

    def listen(self, listener: StepListener) -> None:
        """Call `listener` with every later macrostep, before the macrostep's actions are dispatched."""
        self._reactor.listeners.append(listener)

    def wait_before_events(self, wait: Callable[[], Awaitable[None]]) -> None:
        """Await `wait()` before each event; a breakpoint pauses a run in this manner."""
        self._before_events.append(wait)

    def rearrange(self, order: Callable[[Iterable[Message]], Iterable[Message]]) -> None:
        """Replace the waiting messages by the result of `order`; for tests."""
        self._inbox.rearrange(order)

    def working_for(self, action_id: str) -> frozenset[str]:
        """Return the names of the components with running skills inside the state that started `action_id`."""
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
            "waits": list(self.dispatcher.waits),
            "waits_for_resources": dict(self.dispatcher.activation.waiting),
            "waiting": len(self._inbox.waiting),
            "knowledge_version": self.knowledge.version,
        }

    def stop(self, reason: str) -> None:
        """End the run with a problem, after its exit actions, from any thread; a run that has ended stays unchanged."""
        self.clock.calls.call(self._stop, reason)

    def _stop(self, reason: str) -> None:
        if not self._over and not self.machine.state.finished:
            self._stopped = self._stopped or reason
            self._inbox.wake()

    def suspend(self) -> None:
        """Stop the components as at an end, so that another program can resume the run, from any thread.

        The end of the run has the problem `SUSPENDED`; the store keeps the run as unfinished.

        Raises:
            StoreError: there is no store.
        """
        if self.store is None:
            raise StoreError("only a run with a store can be suspended")
        self.clock.calls.call(self._stop, SUSPENDED)

    async def run(self, plot: str | PlotCall[Outputs], arguments: Mapping[str, Any] | None = None) -> RunEnd[Outputs]:
        """Run the plot until it ends, or until a deadlock; return the end of the run.

        Raises:
            InputError: the plot or a parameter is unknown, a parameter is missing, or an argument has another type.
            StoreError: the store cannot be written; the run can resume from its last commit.
        """
        if isinstance(plot, PlotCall):
            arguments = {**plot.arguments, **(arguments or {})}
        wanted = self.library.plot(plot.plot if isinstance(plot, PlotCall) else plot)
        given = message_checks.checked_arguments(wanted, arguments, self.knowledge, self.library)

        async def begin() -> None:
            self._start(wanted.name, given)

        return cast("RunEnd[Outputs]", await self._watch(begin))

    async def resume(self, kept: Kept) -> RunEnd:
        """Continue a run after its last macrostep, and return the end of the run.

        Args:
            kept: the run from the store; clock and trace must continue from its time and its last record.

        Raises:
            StoreError: the store cannot be written.
            UnknownNameError: a component that the run needs is not deployed; the run is unchanged.
        """
        require_components(kept, self.dispatcher)
        return await self._watch(lambda: self._recover(kept))

    async def _watch(self, begin: Callable[[], Awaitable[None]]) -> RunEnd:
        is_part = self.dispatcher.is_part  # the sequencer around it has a watchdog
        watch = nullcontext() if is_part else watched(self.dispatcher.skill_of, Sequencer._until_end.__code__)
        unfinished = unfinished_at_second_signal(self.dispatcher.unfinished)
        with programming_errors() as bugs, unheard_errors(bugs), watch, unfinished, self._receiving():
            return await self._until_end(begin, bugs)

    @contextmanager
    def _receiving(self) -> Iterator[None]:
        """Receive events and changes of knowledge inside the block."""
        self._over = False
        self._reacts = True  # until the start is complete
        knowledge = self.knowledge
        ends = [
            knowledge.subscribe(self._receive_change), knowledge.subscribe_to_sources(self._receive_value),
            knowledge.subscribe_to_relations(partial(self.clock.calls.call, self._wake, "relations")),
        ]  # fmt: skip
        if not self.dispatcher.is_part:  # the run around it provides the relations
            ends.append(knowledge.provide({**self._reactor.relations, **self._relations.rows}))
            self._relations.listen()
        try:
            yield
        finally:
            self._relations.close()
            for end in ends:
                end()
            self._over = True

    async def _until_end(self, begin: Callable[[], Awaitable[None]], bugs: Iterable[str]) -> RunEnd:
        reactor, machine, inbox = self._reactor, self._reactor.machine, self._inbox
        # The tracer subscribes before skills do, so that consequences of a change are recorded after it.
        unsubscribe = self.knowledge.subscribe(reactor.tracer.knowledge)
        livelock = LivelockGuard(self.clock) if self.clock.simulated else None
        limit = self.clock.call_at(self._until, self._expire) if math.isfinite(self._until) else None
        reactor.know_skills(self.dispatcher.skills())
        self._tracer.listen()
        try:
            await begin()
            self._reacts = False
            self._wake("another program")  # a resumed run may have missed a change
            while not machine.state.finished and reactor.problem is None and self._stopped is None:
                if not inbox.waiting:
                    await self._news()
                    continue
                for wait in self._before_events:
                    await wait()
                message = inbox.waiting.popleft()
                if livelock is not None and (problem := livelock.problem(message)):
                    reactor.problem = problem
                    break
                self._reacts = True
                self._take(message)
                self._reacts = False
            if not machine.state.finished:
                reactor.problem = reactor.problem or self._stopped
            if reactor.problem == SUSPENDED:
                self._suspend()
        except asyncio.CancelledError:  # cancelled from outside; after a crash, this handler does not run
            reactor.problem = reactor.problem or "it was cancelled"
            if self.store is not None and self.on_signal == "suspend":
                self._suspend()
            else:
                self._leave()
                self._keep_end()
            raise
        finally:
            if limit is not None:
                limit.cancel()
            try:
                self._leave()
            finally:
                untaken = await self.dispatcher.close()
                self._tracer.close()
                unsubscribe()
        return self._end([*bugs], untaken)

    def _end(self, bugs: list[str], untaken: Iterable[str]) -> RunEnd:
        """Record, keep and return the end of the run; a suspended run has none in the store."""
        reactor = self._reactor
        if reactor.problem == SUSPENDED:
            return RunEnd(finished=False, emitted=reactor.emitted, problem=SUSPENDED)
        self._take_late_observations()
        if (unheard := [*reactor.unheard, *untaken]) and reactor.problem is None:
            reactor.problem = "; ".join(unheard)
        unanswered = (bug for bug in bugs if bug not in reactor.answered_bugs)
        bug = reactor.programming_error = reactor.programming_error or next(unanswered, None)
        outputs = reactor.outputs if reactor.finished else {}
        end = RunEnd(reactor.finished, reactor.emitted, reactor.problem, outputs, bug, self._failure())
        self.trace.record(
            "end", finished=end.finished, reached=end.reached, problem=end.problem, reason=end.reason,
            outputs=end.outputs, programming_error=bug,
        )  # fmt: skip
        self._keep_end()
        return end

    def _take_late_observations(self) -> None:
        """Apply what skills observed during their clean-up after the last macrostep."""
        messages = [one for one in self._inbox.waiting if isinstance(one, SkillMessage) and one.outcome.observed]
        if not messages or (self.store is not None and self.store.lost):
            return
        with nullcontext() if self.store is None else self.store.writing:
            for message in messages:
                self._reactor.observe(self._validate(message))

    def _failure(self) -> str | None:
        """Return the last outcome of the plot if it is declared as a failure."""
        last = self._reactor.emitted[-1].name if self._reactor.emitted else None
        return last if last in self._failures else None

    async def _news(self) -> None:
        """Wait for the next message, or for the end of the run; a deadlock is the problem of the run.

        A skill that only watches, such as the monitor of a plan, ends in a deadlock if nothing else can happen in
        simulated time.
        """
        if self._is_deadlock():
            if not await self._delivers():
                self._reactor.problem = self._deadlock()
            return
        arrival = self._inbox.arrival()
        if self._open_ended or self.dispatcher.waiting or not any(self.dispatcher.watching):
            await arrival
            return
        idle = self.clock.idle(self._until)
        await asyncio.wait([arrival, idle], return_when=asyncio.FIRST_COMPLETED)
        idle.cancel()
        if not arrival.done():
            self._reactor.problem = self._deadlock()

    async def _delivers(self) -> bool:
        """Wait for the end of a delivery, as its failure is an event; return `False` without a delivery."""
        awaited: list[asyncio.Future[Any]] = [*self.dispatcher.outbox.busy]
        if not awaited:
            return False
        awaited.append(self._inbox.arrival())
        done, _ = await asyncio.wait(awaited, timeout=GRACE, return_when=asyncio.FIRST_COMPLETED)
        return bool(done)

    def _expire(self) -> None:
        self._stop(f"the run has not ended within {self._until:,.10g} s of run time (until)")

    def _keep_end(self) -> None:
        if self.store is not None and self.store.begun and not self.store.lost:
            with self.store.writing:
                self.store.end(self._reactor)

    async def _recover(self, kept: Kept) -> None:
        self._reactor.restore(kept)
        try:
            await recover(kept, self.dispatcher)
        except InputError as error:
            self._reactor.problem = str(error)
            if (bug := bug_in(error)) is not None:
                self._reactor.fail(str(bug))

    # -- macrosteps: commit, then dispatch ---------------------------------------------------------------

    def _record_world(self) -> None:
        named = () if self.clock.simulated else zip(("robot", "run"), logged_run.get(), strict=True)
        self._reactor.tracer.world(self.knowledge, **dict(named))
        self._tracer.record_wires()

    def _start(self, plot: str, arguments: Mapping[str, Any]) -> None:
        store, reactor = self.store, self._reactor
        if store is None:
            self._record_world()
            self.dispatcher.dispatch_all(reactor.start(plot, arguments))
            return
        with store.writing:
            serials = store.begin(plot, arguments, self.library, self.dispatcher.skills())
            self._record_world()
            for late, due, _ in self.dispatcher.timers:
                if isinstance(late, LateMessage):
                    store.late(late, due)
            output = reactor.start(plot, arguments, serials)
            self._keep_step(None, output)
        self.dispatcher.dispatch_all(output)

    def _receive_change(self, change: Change) -> None:
        """Receive a change of knowledge from any thread."""
        self.clock.calls.call(self._wake, change.author)

    def _receive_value(self, source: DataSource) -> None:
        """Receive a new value of a source from any thread."""
        self.clock.calls.call(self._wake, source.reference)

    def _wake(self, author: str) -> None:
        """Let waiting guards be evaluated after a change of knowledge that is not the run's own.

        Sources may change at high rates, so only a change with an effect causes a macrostep.
        """
        root = self.machine.state.root
        if self._reacts or root is None or not any(frame.configuration.spontaneous for frame in root.frames()):
            return
        if any(one is self._wake_up for one in self._inbox.waiting) or not self._reactor.is_enabled():
            return
        self._wake_up = KnowledgeMessage(Delta(), author)
        self._inbox.put(self._wake_up)

    def _take(self, message: Message) -> None:
        if isinstance(message, SkillMessage):
            message = self._validate(message)
        if self.store is None:
            output = self._react(message)
        else:
            with self.store.writing:
                output = self._react_and_keep(message)
                for _ in range(_MOST_GROUPED - 1):
                    if not self._may_group(message, output):
                        break
                    message = self._inbox.waiting.popleft()
                    output = self._react_and_keep(message)
        if isinstance(message, SkillMessage) and message.final:
            if message.continues:
                self._inbox.drop_answers(message.start)
                self.dispatcher.dismiss(message.start)
            else:
                self.dispatcher.settle(message.start)
        elif isinstance(message, SkillMessage):
            self.dispatcher.report_taken(message.start)
        self.dispatcher.dispatch_all(output)
        if self._live.read:
            self._relations.renew()
        if self._reactor.renewed:
            self._reactor.renewed = self._reacts = False
            self._wake("relations")

    def _validate(self, message: SkillMessage) -> SkillMessage:
        return message_checks.validated_in_world(message, self.knowledge, self.dispatcher.signature)

    def _may_group(self, message: Message, output: Collection[Output]) -> bool:
        """Return whether the next macrostep may share the commit of this one.

        Macrosteps with outputs may not share a commit with the next one, as outputs are dispatched after the commit.
        Each answer of a component has a separate commit.
        """
        waiting = self._inbox.waiting
        if output or self._before_events or not waiting:
            return False
        if isinstance(message, SkillMessage) or isinstance(waiting[0], SkillMessage):
            return False
        return not self.machine.state.finished and self._reactor.problem is None and self._stopped is None

    def _react(self, message: Message) -> tuple[Output, ...]:
        output = self._reactor.react(message)
        if isinstance(message, PlotsMessage):
            self._changes.pop(0)
        return output

    def _react_and_keep(self, message: Message) -> tuple[Output, ...]:
        output = self._react(message)
        self._keep_step(message, output)
        return output

    def _leave(self) -> None:
        """Exit the active states, and dispatch the outputs of exit actions after their commit.

        With a lost store, nothing is dispatched, as another process owns the run.
        """
        if self.store is None:
            output = self._reactor.leave()
        elif self.store.lost or not self.store.begun or self.machine.state.root is None:
            return
        else:
            with self.store.writing:
                output = self._reactor.leave()
                self._keep_step(None, output)
        self.dispatcher.dispatch_all(output)

    def _suspend(self) -> None:
        """Send the actions of a leave, which stop the components, without a change of the kept configuration.

        A resume sends the messages of the entry again, as the exit may have revoked them.
        """
        assert self.store is not None  # noqa: S101
        if self.store.begun and not self.store.lost:
            with self.store.writing:
                self.store.suspend(self._reactor.entry_messages(), self.clock.now())
            self.dispatcher.dispatch_all(self._reactor.suspend())

    def _keep_step(self, message: Message | None, output: Iterable[Output]) -> None:
        assert self.store is not None  # noqa: S101
        dispatcher = self.dispatcher
        memories = dispatcher.memories()
        refused = dispatcher.outbox.refused()
        relations = self._live.new and self._reactor.new_rows()
        self.store.step(
            self._reactor.moment(), message, output, self._reactor, dispatcher.undelivered, refused, memories, relations
        )

    # -- from outside ------------------------------------------------------------------------------------

    def _hand_in(self, message: FromOutside, after: float) -> None:
        message_checks.require_seconds(after)
        if after <= 0:
            self.clock.calls.call(self._inbox.put, message)
        else:
            self.clock.calls.call(self._delay, message, after)

    def _hand_in_components(self, components: Iterable[Component]) -> None:
        for component in components:
            self.clock.calls.call(self._deploy, component)

    def _deploy(self, component: Component) -> None:
        self.dispatcher.deploy(component, last=self.dispatcher.skills() is not None)

    def _delay(self, message: FromOutside, after: float) -> None:
        self._last_late += 1
        late, due = LateMessage(message, self._last_late), self.clock.now() + after
        if self.store is not None and self.store.begun:
            with self.store.writing:
                self.store.late(late, due)
        self.dispatcher.timers.schedule(late, due)

    # -- skills that wait for their components -----------------------------------------------------------------

    def asker(self, activation: int) -> str:
        """Return the state of an activation as the end of a phrase, as ` of state 'look'`; empty if it was left."""
        found = self.machine.state.state_of(activation)
        return "" if found is None else f" of state '{found[0]}'"

    def note_wait(self, start: Start, holder: str) -> None:
        """Record that a skill waits for the end of the skill `holder`."""
        self._reactor.tracer.waits(start, holder)
        self._relations.renew()
        self._keep_wait(start, None)

    def note_turn(self, start: Start) -> bool:
        """Record that a skill gets its turn after a wait, and return whether the skill may begin."""
        self._reactor.tracer.turn(start)
        self._relations.renew()
        return self._keep_wait(start, self.clock.now())

    def _keep_wait(self, start: Start, turn: float | None) -> bool:
        """Store that a skill waits or begins, so that a restart distinguishes the two; return whether it is stored."""
        if self.store is None:
            return True
        if self.store.lost:
            return False
        try:
            with self.store.writing:
                self.store.wait(start, turn)
        except StoreError:  # the next macrostep cannot be written either, and ends the run
            return False
        return True

    def _deadlock(self) -> str:
        events = (one for one in self.dispatcher.watching if one.signature.pattern == "event")
        watching = (f"{one.describe()} waits for the outside (open_ended)" for one in events)
        return "; ".join(["deadlock: no skill, timer or event is pending", *self.dispatcher.waits, *watching])

    def _is_deadlock(self) -> bool:
        """Return whether no further message can arrive.

        Periods that have all changed nothing will never change anything.
        """
        if self._open_ended or self.dispatcher.waiting or any(self.dispatcher.watching):
            return False
        return self.dispatcher.timers.periods <= self._reactor.in_vain
