"""Faults of components, planners, sequencers and networks, and permutations of simultaneous messages.

Each fault is a function of the seed and of the fault's subject; no draw depends on the number of earlier draws. A
resumed run keeps the ids of its actions, and therefore has the same faults again. A seed suffices to reproduce a
failure.
"""

from __future__ import annotations

import asyncio
import hashlib
import math
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from enum import StrEnum
from functools import partial
from typing import Any, NoReturn, TypeVar

from dsc.calls import SkillCall
from dsc.chance import choose, uniform
from dsc.components.component import Component
from dsc.components.life_cycle import Life, LifeCycle
from dsc.engine.steps import SendLater, Start, Step
from dsc.errors import SkillError
from dsc.events import Event
from dsc.messages import (
    KnowledgeMessage,
    LateMessage,
    Message,
    ParameterMessage,
    PlotsMessage,
    SkillMessage,
    TimerMessage,
    WireMessage,
)
from dsc.outcomes import Outcome
from dsc.sequencer.sequencer import Sequencer
from dsc.wire.endpoint import LocalTransport
from dsc.wire.presence import Presence
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta

OUTSIDER = "somebody"
"""Author of the changes by others."""
LATE = 5.0
"""Maximum delay in seconds of an answer, an event or a change by another author."""
AT_THE_END = 0.5
"""Share of external changes and events that arrive exactly at the end of an action; the others arrive during it."""
DEAD = 20.0
"""Seconds until a dead component is alive again."""


class Fault(StrEnum):
    """Kinds of faults."""

    SKILL_FAILS = "skill fails"
    SKILL_HANGS = "skill hangs"
    COMPONENT_DIES = "component dies"
    ANSWER_LATE = "answer late"
    ANSWER_TWICE = "answer twice"
    ANSWER_LOST = "answer lost"
    EVENT_LATE = "event late"
    EVENT_TWICE = "event twice"
    KNOWLEDGE_CHANGED = "knowledge changed"
    INTERRUPTED = "interrupted"
    PLANNER_FAILS = "planner fails"
    PLANNER_HANGS = "planner hangs"
    PLANNER_DIES = "planner dies"
    PLANNER_LIES = "planner lies"


USUAL = frozenset(Fault) - {Fault.ANSWER_LOST}
"""Faults after which the plot can determine the action's effect: either no effect, or the effect in a late answer."""
_OF_SKILLS = (
    Fault.SKILL_FAILS, Fault.SKILL_HANGS, Fault.COMPONENT_DIES, Fault.ANSWER_LATE, Fault.ANSWER_TWICE,
    Fault.ANSWER_LOST,
)  # fmt: skip
_OF_EVENTS = (Fault.EVENT_LATE, Fault.EVENT_TWICE)
_Component = TypeVar("_Component", bound=Component)


class InjectedError(SkillError):
    """The injected failure of a skill."""


class Faults:
    """Source of faults: draws faults, injects them, and records them.

    A skill that fails or hangs, or whose component dies, has no effect. A skill with a lost answer has its full effect,
    and then hangs. Events (`@event`) may arrive late, and so reordered, or twice. Events are never lost, because a plot
    might wait for an event without end; `LossyTransport` simulates such losses.

    Args:
        seed: the seed of all draws.
        chance: probability of a fault for each call, each event and each planning problem, in [0, 1].
        kinds: the possible faults.

    Attributes:
        fired: faults by subject; a fault that a resumed run repeats adds no entry.

    Raises:
        InputError: the chance is outside its range.
    """

    def __init__(self, seed: int, chance: float = 0.1, kinds: Collection[Fault] = USUAL) -> None:
        if not 0.0 <= chance <= 1.0:
            raise InputError(f"the chance of a fault is between 0 and 1, not {chance}", found=str(chance))
        self.seed = seed
        self.chance = chance
        self.kinds = frozenset(kinds)
        self.fired: dict[str, Fault] = {}
        self._at_end: dict[str, list[Callable[[], None]]] = {}

    def draw(self, subject: str, possible: Collection[Fault], part: float = 1.0) -> Fault | None:
        """Return the fault of a subject, e.g. of an action by its id, or `None`; record the fault in `fired`.

        Args:
            subject: identifies the object of the draw.
            possible: the kinds that apply to the subject.
            part: factor for the probability.
        """
        kinds = [kind for kind in possible if kind in self.kinds]
        if not kinds or uniform(self.seed, subject, "fault") >= self.chance * part:
            return None
        self.fired[subject] = choose(self.seed, subject, "kind", kinds)
        return self.fired[subject]

    def share(self, subject: str) -> float:
        """Return the subject's number in [0, 1), which determines the extent of its fault."""
        return uniform(self.seed, subject, "share")

    def counts(self) -> Counter[str]:
        """Return the number of drawn faults of each kind."""
        return Counter(map(str, self.fired.values()))

    def inject(self, component: _Component) -> _Component:
        """Inject faults into all later actions of this component; return the component."""
        component.execute = _Injected(component, self)  # type: ignore[method-assign]
        return component

    def meddle(self, sequencer: Sequencer, changes: Callable[[], Sequence[Delta]]) -> None:
        """Let another author change the knowledge during actions, or exactly at their end.

        Args:
            sequencer: the sequencer of the run, before the run starts.
            changes: returns true changes that another author might make at that time; one of them is applied.
        """

        def hand_in(subject: str) -> None:
            options = changes()
            if options:
                sequencer.change(choose(self.seed, subject, "change", options), OUTSIDER)

        self._during_actions(sequencer, Fault.KNOWLEDGE_CHANGED, "during", hand_in)

    def interrupt(self, sequencer: Sequencer, event: Event, part: float = 0.3) -> None:
        """Post an event from outside during actions or exactly at their end, e.g. an operator's `stop`.

        Args:
            sequencer: the sequencer of the run, before the run starts.
            event: the event.
            part: factor for the probability, as a stopped run has few remaining faults.
        """
        self._during_actions(
            sequencer, Fault.INTERRUPTED, f"{event.name} during", lambda _: sequencer.post(event), part
        )

    def ended(self, action_id: str) -> None:
        """Report the end of an action of a component with faults, which triggers the faults at its end."""
        for happen in self._at_end.pop(action_id, ()):
            asyncio.get_running_loop().call_soon(happen)

    def _during_actions(
        self, sequencer: Sequencer, fault: Fault, when: str, happen: Callable[[str], None], part: float = 1.0
    ) -> None:
        def listen(step: Step) -> None:
            for start in (one for one in step.output if isinstance(one, Start)):
                subject = f"{when} {start.action_id}"
                if not self.draw(subject, (fault,), part):
                    continue
                if uniform(self.seed, subject, "when") < AT_THE_END:
                    self._at_end.setdefault(start.action_id, []).append(partial(happen, subject))
                else:
                    asyncio.get_running_loop().call_later(LATE * self.share(subject), happen, subject)

        sequencer.listen(listen)


class _Injected:
    """Replacement of a component's method `execute`."""

    def __init__(self, component: Component, faults: Faults) -> None:
        self._component = component
        self._execute = component.execute
        self._faults = faults

    async def __call__(self, skill_name: str, call: SkillCall[Any], arguments: Mapping[str, Any]) -> Outcome:
        signature = self._component.skills().get(skill_name)
        if signature is not None and signature.pattern == "event":
            return await self._execute(skill_name, replace(call, report=self._events(call)), arguments)
        fault = self._faults.draw(call.action_id, _OF_SKILLS)
        await self._before(fault, call)
        outcome = await self._execute(skill_name, call, arguments)
        self._faults.ended(call.action_id)
        if fault is Fault.ANSWER_LOST:
            await _never(call)
        if fault is Fault.ANSWER_LATE:
            with suppress(asyncio.CancelledError):  # the skill is done: a cancellation can only return its outcome
                await call.clock.sleep(min(LATE, call.remaining / 2) * self._faults.share(call.action_id))
        if fault is Fault.ANSWER_TWICE:
            call.report(outcome)
        return outcome

    async def _before(self, fault: Fault | None, call: SkillCall[Any]) -> None:
        if fault is Fault.SKILL_FAILS:
            raise InjectedError("it was to fail")
        if fault is Fault.SKILL_HANGS:
            await _never(call)
        if fault is Fault.COMPONENT_DIES:
            life = self._component.life
            asyncio.get_running_loop().call_later(DEAD, _revive, life)
            life.become(Life.FATAL_ERROR, "it was to die")
            await _never(call)

    def _events(self, call: SkillCall[Any]) -> Callable[[Outcome], None]:
        """Return a report function that posts each event with its drawn delay or repetition."""
        number = 0

        def report(outcome: Outcome) -> None:
            nonlocal number
            number += 1
            subject = f"event {number} of {call.action_id}"
            fault = self._faults.draw(subject, _OF_EVENTS)
            late = LATE * self._faults.share(subject) if fault is Fault.EVENT_LATE else 0.0
            for _ in range(2 if fault is Fault.EVENT_TWICE else 1):
                if late:
                    asyncio.get_running_loop().call_later(late, call.report, outcome)
                else:
                    call.report(outcome)

        return report


def _revive(life: LifeCycle) -> None:
    if life.state is Life.FATAL_ERROR:
        life.become(Life.ALIVE)


async def _never(call: SkillCall[Any]) -> NoReturn:
    """Wait for the deadline, or for the dispatcher's reaction to the component's death."""
    if math.isinf(call.deadline):
        raise InjectedError("it was to hang, and has no deadline")
    await asyncio.get_running_loop().create_future()
    raise AssertionError


class Interleaving:
    """Permutation of the messages of one simulated time, by a seed.

    Before each macrostep, the permutation waits for all messages of that time, and draws the source of the next
    message. Messages of one source keep their order, as every communication pattern guarantees. Sources are the events
    and the answer of one action, the chart's timers, the changes of one author, and events from outside. Messages of
    different sources may arrive in any order, e.g. an answer and its timeout.

    Args:
        seed: the seed of all draws.

    Attributes:
        turned: number of messages handled before an earlier one.
    """

    def __init__(self, seed: int) -> None:
        self.turned = 0
        self._seed = seed
        self._turn = 0

    def attach(self, sequencer: Sequencer) -> None:
        """Permute the messages of this sequencer; call this method before its run starts or is resumed."""

        async def settle() -> None:
            await sequencer.clock.settled()
            sequencer.rearrange(self._shuffle)

        sequencer.wait_before_events(settle)

    def _shuffle(self, waiting: Iterable[Message]) -> Iterable[Message]:
        """Choose a source by the seed and move its first message to the front; the other messages keep their order."""
        messages = list(waiting)
        sources = list(dict.fromkeys(map(_source, messages)))
        if len(sources) > 1:
            self._turn += 1
            turn = str(self._turn)
            first = min(sources, key=lambda source: uniform(self._seed, source, turn))
            self.turned += first != sources[0]
            messages.insert(0, messages.pop(next(n for n, one in enumerate(messages) if _source(one) == first)))
        return messages


def _source(message: Message) -> str:
    """Return the source of a message; messages of one source keep their order."""
    match message:
        case LateMessage():
            return _source(message.message)
        case SkillMessage():
            return f"action {message.start.action_id}"
        case KnowledgeMessage():
            return f"author {message.author}"
        case TimerMessage() | SendLater():
            return "timers"
        case ParameterMessage() | WireMessage() | PlotsMessage():
            return "operator"
        case Event():
            return "outside"


class LossyTransport(LocalTransport):
    """Transport that loses, duplicates, delays and so reorders frames; in simulated time, a seed reproduces the faults.

    Args:
        seed: the seed of all draws.
        loss: probability that a frame is lost.
        double: probability that a frame arrives twice.
        delay: maximum delay of a frame in seconds; the delay of each report to a watch.
    """

    def __init__(self, seed: int, *, loss: float = 0.2, double: float = 0.2, delay: float = 0.1) -> None:
        super().__init__()
        self._seed = seed
        self._loss = loss
        self._double = double
        self._delay = delay
        self._presence = Presence(delay)
        self._sent: Counter[str] = Counter()

    def send(self, sender: str, to: str, frame: bytes) -> None:
        """Send a frame with separately drawn faults: a repetition of a frame has other faults."""
        name = hashlib.blake2b(f"{sender} {to} ".encode() + frame, digest_size=8).hexdigest()
        self._sent[name] += 1
        subject = f"{name} {self._sent[name]}"
        if uniform(self._seed, subject, "loss") < self._loss:
            return
        doubled = uniform(self._seed, subject, "double") < self._double
        for copy in range(1 + doubled):
            late = self._delay * uniform(self._seed, subject, f"delay {copy}")
            asyncio.get_running_loop().call_later(late, self.deliver, sender, to, frame)
