"""Faults around any component, planner or sequencer: each a function of the seed and of what it hits (S0.15).

No draw depends on how many were made before. So a run that is resumed, whose actions have the ids they had, meets the
same faults again, and a seed is all that is needed to see a failure once more.
"""

from __future__ import annotations

import asyncio
import math
from collections import Counter
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from enum import StrEnum
from functools import partial
from typing import Any, NoReturn, TypeVar

from dsc.calls import Outcome, SkillCall
from dsc.chance import choose, uniform
from dsc.components.component import Component
from dsc.components.life_cycle import Life, LifeCycle
from dsc.engine.steps import Start, Step
from dsc.events import Event
from dsc.sequencer.sequencer import Sequencer
from knowledge_base.errors import InputError
from knowledge_base.facts import Delta

SOMEBODY = "somebody"
"""Author of the changes that others make."""
LATE = 5.0
"""Seconds that an answer, an event or somebody's change comes late at most."""
AT_THE_END = 0.5
"""Share of what others say while an action is under way that they say just when it ends."""
DEAD = 20.0
"""Seconds until a component that died is back."""


class Fault(StrEnum):
    """What can go wrong."""

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
"""All after which the plot still knows what was done: in the others nothing was, or it is told in the end."""
_OF_SKILLS = (
    Fault.SKILL_FAILS, Fault.SKILL_HANGS, Fault.COMPONENT_DIES, Fault.ANSWER_LATE, Fault.ANSWER_TWICE,
    Fault.ANSWER_LOST,
)  # fmt: skip
_OF_EVENTS = (Fault.EVENT_LATE, Fault.EVENT_TWICE)
_Component = TypeVar("_Component", bound=Component)


class InjectedError(Exception):
    """A skill failed because it was to."""


class Faults:
    """Decides on faults, makes them happen, and remembers them.

    A skill that fails or hangs, and one whose component dies, has done nothing. An answer that is lost belongs to a
    skill that has done its work and hangs then. Events (`@event`) come late, and so in another order, or twice; they
    are never lost, since who waits for one may wait for ever: what a network loses, `LossyTransport` loses.

    Args:
        seed: of all draws.
        chance: of a fault for each call, each event and each problem that is planned for, in [0, 1].
        kinds: what may happen.

    Attributes:
        fired: what happened, by what it happened to: the same fault met again in a resumed run is one.

    Raises:
        InputError: the chance is none.
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
        """The fault that hits the subject, e.g. an action by its id, if one does, with that part of the chance.

        It counts as fired.
        """
        kinds = [kind for kind in possible if kind in self.kinds]
        if not kinds or uniform(self.seed, subject, "fault") >= self.chance * part:
            return None
        self.fired[subject] = choose(self.seed, subject, "kind", kinds)
        return self.fired[subject]

    def share(self, subject: str) -> float:
        """How much of it: a number in [0, 1) that belongs to the subject."""
        return uniform(self.seed, subject, "share")

    def counts(self) -> Counter[str]:
        """How often each kind fired."""
        return Counter(map(str, self.fired.values()))

    def inject(self, component: _Component) -> _Component:
        """Let faults happen in all that this component carries out from now on; returns it."""
        component.execute = _Injected(component, self)  # type: ignore[method-assign]
        return component

    def meddle(self, sequencer: Sequencer, changes: Callable[[], Sequence[Delta]]) -> None:
        """Let somebody change the knowledge while actions are under way, or just when they end.

        Args:
            sequencer: of the run, before it starts.
            changes: what somebody else might truly say at that moment; one of them is handed in.
        """

        def hand_in(subject: str) -> None:
            options = changes()
            if options:
                sequencer.change(choose(self.seed, subject, "change", options), SOMEBODY)

        self._during_actions(sequencer, Fault.KNOWLEDGE_CHANGED, "during", hand_in)

    def interrupt(self, sequencer: Sequencer, event: Event, part: float = 0.3) -> None:
        """Let an event come from outside while actions are under way or just when they end, e.g. an operator's `stop`.

        Args:
            sequencer: of the run, before it starts.
            event: what is handed in.
            part: of the chance of other faults; a run that is stopped has not much left that could go wrong.
        """
        self._during_actions(
            sequencer, Fault.INTERRUPTED, f"{event.name} during", lambda _: sequencer.post(event), part
        )

    def ended(self, action_id: str) -> None:
        """An action of a component with faults has done its work, and says so now; others speak at the same moment."""
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
    """Stands in the place of a component's `execute`."""

    def __init__(self, component: Component, faults: Faults) -> None:
        self._component = component
        self._execute = component.execute
        self._faults = faults

    async def __call__(self, skill_name: str, call: SkillCall, arguments: Mapping[str, Any]) -> Outcome:
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
            with suppress(asyncio.CancelledError):  # it is done: told to stop, it can only say so
                await call.clock.sleep(min(LATE, call.remaining / 2) * self._faults.share(call.action_id))
        if fault is Fault.ANSWER_TWICE:
            call.report(outcome)
        return outcome

    async def _before(self, fault: Fault | None, call: SkillCall) -> None:
        if fault is Fault.SKILL_FAILS:
            raise InjectedError("it was to fail")
        if fault is Fault.SKILL_HANGS:
            await _never(call)
        if fault is Fault.COMPONENT_DIES:
            life = self._component.life
            asyncio.get_running_loop().call_later(DEAD, _revive, life)
            life.become(Life.FATAL_ERROR, "it was to die")
            await _never(call)

    def _events(self, call: SkillCall) -> Callable[[Outcome], None]:
        """Hands events over, as late and as often as it falls to each."""
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


async def _never(call: SkillCall) -> NoReturn:
    """Until the deadline, or until the dispatcher has heard that the component is dead."""
    if math.isinf(call.deadline):
        raise InjectedError("it was to hang, and would for ever")
    await asyncio.get_running_loop().create_future()
    raise AssertionError
