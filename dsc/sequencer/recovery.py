"""Recovery after a restart: reschedules every pending action, timer and scheduled input of an interrupted run."""

from __future__ import annotations

from collections.abc import Collection, Iterable

from dsc.components.hooks import contained, reason_of
from dsc.engine.steps import SendLater, SetParameter, Start, StartTimer, SwitchMode
from dsc.messages import LateMessage, TimerMessage
from dsc.runs.kept import Kept, Pending
from dsc.sequencer.dispatcher import Dispatcher
from dsc.sequencer.running_skills import InterruptedSkill
from knowledge_base.errors import InputError


def require_components(kept: Kept, dispatcher: Dispatcher) -> None:
    """Raise `UnknownNameError` if a component that the run needs is not deployed."""
    started = [one.what.component for one in kept.pending if isinstance(one.what, Start)]
    for needed in (*kept.memory, *started):
        dispatcher.component(needed)


async def recover(kept: Kept, dispatcher: Dispatcher) -> None:
    """Restore components, and continue the pending actions, timers and inputs.

    The outputs of the last macrostep may never have reached the components. So these outputs are dispatched (again)
    after everything else is restored.

    Raises:
        InputError: a component cannot recall its data or stop a cancelled skill, or a component is not deployed.
    """
    for name, memory in kept.memory.items():
        try:
            remembering = dispatcher.component(name)
            with contained(f"{name}.recall", remembering.device_errors):
                remembering.recall(memory)
        except Exception as error:
            raise InputError(f"component '{name}' cannot recall its data: {reason_of(error)}") from error
    for one in kept.pending:
        if one.cancelled and isinstance(one.what, Start):
            await dispatcher.abandon(one.what)
    pending = [one for one in kept.pending if not one.cancelled]
    older = [one for one in pending if one.step < kept.number]
    effective, others = _divide(older)
    for component, settings in effective.items():
        dispatcher.restore(component, settings)
    await dispatcher.outbox.all_taken()
    begun = _find_begun(pending, kept.number, dispatcher)
    for one in sorted(others, key=lambda one: one.place not in begun):  # stable
        _rearm(one, dispatcher, begun)
    await dispatcher.settled()  # answers that were due before the last macrostep precede its answers
    for one in pending[len(older) :]:
        _rearm(one, dispatcher, begun)
    dispatcher.give_turns()


def _divide(older: Iterable[Pending]) -> tuple[dict[str, list[SetParameter | SwitchMode]], list[Pending]]:
    """Return the effective settings by component, and the other pending outputs."""
    effective: dict[str, list[SetParameter | SwitchMode]] = {}
    others = []
    for one in older:
        if isinstance(one.what, SetParameter | SwitchMode) and one.reports:
            effective.setdefault(one.what.component, []).append(one.what)
        else:
            others.append(one)
    return effective, others


def _find_begun(pending: Iterable[Pending], number: int, dispatcher: Dispatcher) -> set[int]:
    """Return the places of the actions that their components may have received; the others have waited for a turn.

    `number` is the number of the last macrostep.
    """
    begun: set[int] = set()
    claims: dict[str, list[Pending]] = {}
    for one in pending:
        if isinstance(one.what, Start) and dispatcher.has_turns(one.what):
            claims.setdefault(one.what.component, []).append(one)
        elif isinstance(one.what, Start):
            begun.add(one.place)
    for of_component in claims.values():
        with_turn = [one.place for one in of_component if one.turn is not None]
        unmarked = [one for one in of_component if not one.waits]
        older = [one.place for one in unmarked if one.step < number]
        # Actions that have to wait are marked before the first one begins, and before the next macrostep.
        candidates = older or [one.place for one in unmarked]
        begun.update(with_turn or (candidates if len(candidates) == 1 else ()))
    return begun


def _rearm(one: Pending, dispatcher: Dispatcher, begun: Collection[int]) -> None:
    match one.what:
        case Start():
            began = (one.at if one.turn is None else one.turn) if one.place in begun else None
            dispatcher.resume(one.what, InterruptedSkill(one.at, began, one.reports))
        case StartTimer():
            dispatcher.timers.schedule(TimerMessage(one.what), one.at)
        case SendLater() | LateMessage():
            dispatcher.timers.schedule(one.what, one.at)
        case _:
            dispatcher.dispatch(one.what)
