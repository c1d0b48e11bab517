"""After a restart: everything is awaited again that was awaited when the run was broken off."""

from __future__ import annotations

import asyncio
from collections.abc import Iterable

from dsc.engine.steps import SendLater, SetParameter, Start, StartTimer, SwitchMode
from dsc.messages import LateMessage
from dsc.runs.encoding import Kept, Pending
from dsc.sequencer.dispatcher import Dispatcher
from dsc.sequencer.inbox import ScheduledInput
from dsc.sequencer.resumed_skills import InterruptedSkill


def require_components(kept: Kept, dispatcher: Dispatcher) -> None:
    """Raise `UnknownNameError` if a component that the run needs is not deployed."""
    started = [one.what.component for one in kept.pending if isinstance(one.what, Start)]
    for needed in (*kept.memory, *started):
        dispatcher.component(needed)


async def take_up(kept: Kept, dispatcher: Dispatcher, coming: ScheduledInput) -> None:
    """Let components be as they were, and let go on what was going on.

    What the last macrostep asked for may never have left, so it leaves (again) when all else is as it was.

    Raises:
        InputError: a component cannot stop what was cancelled, or one is not deployed.
    """
    for name, memory in kept.memory.items():
        dispatcher.component(name).recall(memory)
    for one in kept.pending:
        if one.cancelled and isinstance(one.what, Start):
            await dispatcher.abandon(one.what)
    awaited = [one for one in kept.pending if not one.cancelled]
    older = [one for one in awaited if one.step < kept.number]
    in_force, others = _told_apart(older)
    for component, told in in_force.items():
        dispatcher.tell_again(component, told)
    await dispatcher.outbox.all_taken()
    for one in others:
        _await_again(one, dispatcher, coming)
    await asyncio.sleep(0)  # until these have begun
    for one in awaited[len(older) :]:
        _await_again(one, dispatcher, coming)


def _told_apart(older: Iterable[Pending]) -> tuple[dict[str, list[SetParameter | SwitchMode]], list[Pending]]:
    """What components have taken, which is in force, by their names; and what is awaited or still under way to them."""
    in_force: dict[str, list[SetParameter | SwitchMode]] = {}
    others = []
    for one in older:
        if isinstance(one.what, SetParameter | SwitchMode) and one.reports:
            in_force.setdefault(one.what.component, []).append(one.what)
        else:
            others.append(one)
    return in_force, others


def _await_again(one: Pending, dispatcher: Dispatcher, coming: ScheduledInput) -> None:
    match one.what:
        case Start():
            dispatcher.take_up(one.what, InterruptedSkill(one.at, one.reports))
        case StartTimer():
            dispatcher.timers.start(one.what, one.at)
        case SendLater():
            dispatcher.timers.send(one.what, one.at)
        case LateMessage():
            coming.wait_for(one.what, one.at)
        case _:
            dispatcher.dispatch(one.what)
