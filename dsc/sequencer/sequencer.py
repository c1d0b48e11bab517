"""The sequencer: takes events one by one, lets the machine run to completion, commits, then dispatches."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

from dsc.dynamic.library import Library
from dsc.dynamic.situation import KnowledgeSituation
from dsc.engine.machine import Machine
from dsc.engine.steps import Start, StartTimer, Step
from dsc.errors import RunawayError
from dsc.events import EVERY, FAILURES, GAVE_UP, NO_PLAN, RESERVED, Event
from dsc.sequencer.clock import LoopClock
from dsc.sequencer.dispatcher import Dispatcher, SkillMessage, TimerMessage, broken
from dsc.sequencer.tracing import StepTracer
from dsc.skills import Component
from dsc.trace import Trace
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta
from knowledge_base.store import KnowledgeBase

CHART = "chart"
"""Author of what a plot tells the knowledge base."""


@dataclass(frozen=True, slots=True)
class KnowledgeMessage:
    """Somebody who is no skill of this run changes the knowledge."""

    delta: Delta
    author: str


@dataclass(frozen=True, slots=True)
class RunEnd:
    """How a run ended.

    Attributes:
        finished: the plot reached its final state.
        emitted: outcome events of the plot, in order.
        problem: why it ended without reaching it, or what went wrong in its last step; else `None`.
    """

    finished: bool
    emitted: tuple[Event, ...] = ()
    problem: str | None = None

    @property
    def reached(self) -> bool:
        """Whether it finished and no goal of its own was left open, by `no_plan` or `gave_up`."""
        return self.finished and not any(event.name in {NO_PLAN, GAVE_UP} for event in self.emitted)


Message = SkillMessage | TimerMessage | KnowledgeMessage | Event
StepListener = Callable[[Step], None]
"""Is told every macrostep; must not block."""


@dataclass(slots=True)
class _Progress:
    emitted: list[Event] = field(default_factory=list)
    problem: str | None = None


class Sequencer:
    """Runs one plot to its end.

    Args:
        library: all plots that may be used.
        knowledge: the world model; changed only by the plot's `tell`s and by what components observe.
        components: the skills, by the names the plots use.
        clock: run time; must be made inside the loop that runs the sequencer.
        trace: hears everything; a fresh one if left out.
        open_ended: whether events may still come from outside when nothing is going on; if not, such a
            run ends with a problem instead of waiting for ever.
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
    ) -> None:
        self.library = library
        self.knowledge = knowledge
        self.machine = Machine(library)
        self.trace = trace or Trace(clock.now)
        self._tracer = StepTracer(self.trace)
        self._inbox: asyncio.Queue[Message] = asyncio.Queue()
        self.dispatcher = Dispatcher(components, clock, self._inbox.put_nowait)
        self._open_ended = open_ended
        self._caused_by: dict[str, int] = {}
        self._listeners: list[StepListener] = []
        self._coming: set[asyncio.TimerHandle] = set()
        self._in_vain: set[tuple[int, int]] = set()
        self._before_events: list[Callable[[], Awaitable[None]]] = []

    def listen(self, listener: StepListener) -> None:
        """Tell `listener` every macrostep from now on, before its actions leave."""
        self._listeners.append(listener)

    def wait_before_events(self, wait: Callable[[], Awaitable[None]]) -> None:
        """Await `wait` before each event is taken: how a run is held still, e.g. at a breakpoint."""
        self._before_events.append(wait)

    def working_for(self, action_id: str) -> frozenset[str]:
        """Names of the components that carry out skills for the content of the state that started `action_id`."""
        started = self.dispatcher.started()
        owner = next((start.activation for start in started if start.action_id == action_id), None)
        inside = frozenset() if owner is None else self.machine.state.activations_inside(owner)
        return frozenset(start.component for start in started if start.activation in inside)

    def diagnose(self) -> dict[str, Any]:
        """How the run is going, as plain data: active states, actions under way, how much waits to be taken."""
        return {
            "component": "sequencer",
            "finished": self.machine.state.finished,
            "active": list(self.machine.state.configuration()),
            "working": [f"{start.component}.{start.skill}" for start in self.dispatcher.started()],
            "in_use": sorted(self.dispatcher.in_use),
            "waiting": self._inbox.qsize(),
            "knowledge_version": self.knowledge.version,
        }

    def post(self, event: Event, *, after: float = 0.0) -> None:
        """Hand in an event from outside, e.g. an operator's `stop`; from the loop's own thread.

        Args:
            event: what happened.
            after: seconds until it comes; meanwhile the run does not end for want of things to come.

        Raises:
            InputError: the event is one that only the executive itself fires, e.g. `done`, or an attribute is no
                plain data.
        """
        if event.name in RESERVED:
            raise InputError(f"the event '{event.name}' is fired by the executive itself", found=event.name)
        self._hand_in(event._replace(attributes=_plain_data(event)), after)

    def change(self, delta: Delta, author: str, *, after: float = 0.0) -> None:
        """Hand in a change of knowledge that somebody else made; from the loop's own thread.

        Args:
            delta: what is different now.
            author: who says so.
            after: as for `post`.

        Raises:
            InputError: the change contradicts the schema; nothing was changed.
        """
        self.knowledge.overlay().apply(delta)
        self._hand_in(KnowledgeMessage(delta, author), after)

    async def run(self, plot: str, arguments: Mapping[str, Any] | None = None) -> RunEnd:
        """Run the plot until it ends, or until nothing can happen any more.

        Raises:
            InputError: the plot is unknown, or a parameter is missing or unknown.
        """
        progress = _Progress()
        # Before anybody who is started by the run subscribes: what follows from a change is recorded after it.
        unsubscribe = self.knowledge.subscribe(self._tracer.knowledge)
        try:
            self._tracer.world(self.knowledge)
            self._start(plot, arguments or {}, progress)
            while not self.machine.state.finished and progress.problem is None:
                if self._idle():
                    progress.problem = "nothing is going on and nothing can happen any more"
                    break
                message = await self._inbox.get()
                for wait in self._before_events:
                    await wait()
                self._take(message, progress)
        finally:
            for handle in self._coming:
                handle.cancel()
            self._leave(progress)
            untaken = await self.dispatcher.close()
            unsubscribe()
        if untaken and progress.problem is None:
            progress.problem = "; ".join(untaken)
        self.trace.record("end", finished=self.machine.state.finished, problem=progress.problem)
        return RunEnd(self.machine.state.finished, tuple(progress.emitted), progress.problem)

    def _start(self, plot: str, arguments: Mapping[str, Any], progress: _Progress) -> None:
        try:
            step = self.machine.start(plot, arguments, self._situation())
        except RunawayError as error:
            progress.problem = str(error)
            return
        try:
            self._commit(step, progress)
        except InputError as error:
            progress.problem = str(error)

    def _leave(self, progress: _Progress) -> None:
        """Wherever the run ends, exit actions put the components at rest; a finished machine has nothing to leave."""
        if self.machine.state.root is None:
            return
        try:
            self._commit(self.machine.leave(self._situation()), progress)
        except InputError as error:
            progress.problem = progress.problem or str(error)

    def _hand_in(self, message: Message, after: float) -> None:
        if after <= 0:
            self._inbox.put_nowait(message)
            return

        def due() -> None:
            self._coming.discard(handle)
            self._inbox.put_nowait(message)

        handle = asyncio.get_running_loop().call_later(after, due)
        self._coming.add(handle)

    def _idle(self) -> bool:
        """Whether nothing can happen any more: periods that all have changed nothing will never change anything."""
        coming = self.dispatcher.waiting or bool(self._coming) or not self.dispatcher.periods <= self._in_vain
        return not self._open_ended and self._inbox.empty() and not coming

    def _situation(self) -> KnowledgeSituation:
        return KnowledgeSituation(self.knowledge, self.library)

    def _take(self, message: Message, progress: _Progress) -> None:
        try:
            message = self._believable(message)
            event = self._received(message)
            before = self.machine.state
            step = self.machine.send(event, self._situation())
            self._note_periods(message, in_vain=step.state == before and _is_vain(step))
            if isinstance(message, SkillMessage) and message.final:
                self.dispatcher.settle(message.start)
            self._commit(step, progress)
            if event is not None and not step.handled:
                self._unhandled(message, event, progress)
        except (RunawayError, InputError) as error:
            progress.problem = str(error)

    def _note_periods(self, message: Message, *, in_vain: bool) -> None:
        if not isinstance(message, TimerMessage) or not in_vain:
            self._in_vain.clear()
        elif message.timer.event == EVERY:
            self._in_vain.add((message.timer.activation, message.timer.index))

    def _received(self, message: Message) -> Event | None:
        """Apply what the message observed; the event the machine shall see, if any."""
        if isinstance(message, KnowledgeMessage):
            self.trace.cause = None
            self._apply(message.delta, message.author)
            return None
        if isinstance(message, Event):
            self.trace.cause = None
            self.trace.cause = self._tracer.event(message, "outside")
            return message
        if isinstance(message, TimerMessage):
            self.trace.cause = None
            timer = message.timer
            event = Event(timer.event, to=timer.activation, exact=True, number=timer.index)
            if timer.event != EVERY:  # most periods pass without anything happening; if not, the step says so
                self.trace.cause = self._tracer.event(event, "timer")
            return event
        start, outcome = message.start, message.outcome
        self._tracer.answered(start)
        name = start.names.get(outcome.event, outcome.event)
        event = Event(name, outcome.attributes, to=start.activation)
        self.trace.cause = self._caused_by.get(start.action_id)
        self.trace.cause = self._tracer.event(event, f"{start.component}.{start.skill}", outcome.event)
        self._apply(outcome.observed, start.component)
        return event

    def _believable(self, message: Message) -> Message:
        """A skill that observes what cannot be has failed, and nothing of it is believed."""
        if not isinstance(message, SkillMessage) or not message.outcome.observed:
            return message
        try:
            self.knowledge.overlay().apply(message.outcome.observed)
        except InputError as error:
            if not message.final:
                self.dispatcher.stop(message.start)
            return SkillMessage(message.start, broken(message.start, str(error)), final=True)
        return message

    def _apply(self, delta: Delta, author: str) -> None:
        if delta:
            self.knowledge.apply(delta, author)

    def _commit(self, step: Step, progress: _Progress) -> None:
        """First what the chart told becomes knowledge, then actions leave."""
        for listener in self._listeners:
            listener(step)
        self._tracer.step(step)
        self._tracer.decisions(step)
        self._apply(step.knowledge, CHART)
        for output in step.output:
            seq = self._tracer.output(output)
            if isinstance(output, Start) and seq is not None:
                self._caused_by[output.action_id] = seq
            self.dispatcher.dispatch(output)
        progress.emitted.extend(step.emitted)
        if step.errors:
            progress.problem = progress.problem or "; ".join(step.errors)

    def _unhandled(self, message: Message, event: Event, progress: _Progress) -> None:
        """An answer that its own, still active state does not take would leave that state waiting for ever."""
        if not isinstance(message, SkillMessage) or not message.final or event.to is None:
            return
        if self.machine.state.has_activation(event.to):
            skill = f"{message.start.component}.{message.start.skill}"
            whose = f": {event.attributes['reason']}" if event.name in FAILURES else f" of {skill}"
            progress.problem = f"nobody handles '{event.name}'{whose}"


def _is_vain(step: Step) -> bool:
    """Whether nothing came of it but the next period; in the same state and world, nothing ever will."""
    only_timers = all(isinstance(output, StartTimer) for output in step.output)
    return only_timers and not step.knowledge and not step.emitted


def _plain_data(event: Event) -> dict[str, Any]:
    try:
        attributes: dict[str, Any] = json.loads(json.dumps(dict(event.attributes), allow_nan=False))
    except (TypeError, ValueError) as error:
        raise InputError(f"the attributes of '{event.name}' are no plain data: {error}") from None
    return attributes
