"""What components are told without an answer: parameters, modes and messages, to each in the order they leave in."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Collection, Iterable, Sequence
from functools import partial

from dsc.components.abandonment import GRACE
from dsc.components.component import Component
from dsc.components.hooks import contained
from dsc.components.life_cycle import Life
from dsc.engine.steps import SendMessage, SetParameter, SwitchMode
from dsc.messages import Told
from dsc.sequencer.outcome_checks import encoded
from knowledge_base.errors import described

CLOSING = GRACE
"""Seconds for components to take what they were last told, and for cancelled skills to stop."""
_MOST_REFUSED = 1000
"""Of a run that is not kept nobody asks what was refused."""


class Outbox:
    """What is on its way to components, or was refused and has not been said to anybody."""

    def __init__(self) -> None:
        self._untaken: dict[str, asyncio.Task[None]] = {}
        self._under_way: dict[int, Told] = {}
        self._refused: deque[Told] = deque(maxlen=_MOST_REFUSED)
        self._last = 0

    @property
    def under_way(self) -> Collection[Told]:
        """What has been told and not been taken yet, nor refused."""
        return self._under_way.values()

    def refused(self) -> Collection[Told]:
        """What components have not taken since this was last asked, nor will."""
        if not self._refused:  # asked with each macrostep that is kept
            return ()
        refused = tuple(self._refused)
        self._refused.clear()
        return refused

    def tell(self, component: Component, told: Told) -> None:
        """Let the component take it after what it was told before."""
        self._begin(component, (told,), lambda: _take(component, told))

    def tell_again(self, component: Component, in_force: Sequence[SetParameter | SwitchMode]) -> None:
        """Let the component have what was in force before a restart: its parameters as one set, and then its modes."""
        parameters = [one for one in in_force if isinstance(one, SetParameter)]
        if parameters:
            values = {one.parameter: one.value for one in parameters}
            self._begin(component, parameters, lambda: component.configure_all(encoded(values)))
        for one in in_force:
            if isinstance(one, SwitchMode):
                self._begin(component, (one,), partial(_switch_again, component, one.mode))

    def _begin(self, component: Component, told: Iterable[Told], take: Callable[[], Awaitable[None]]) -> None:
        numbers = {self._last + n: one for n, one in enumerate(told, start=1)}
        self._under_way |= numbers
        self._last = max(numbers)

        async def taking() -> None:
            try:
                with contained():
                    await take()
            except Exception:
                self._refused.extend(numbers.values())
                raise
            finally:
                for number in numbers:
                    del self._under_way[number]

        self._in_turn(component.name, taking)

    async def taken(self, component: Component) -> None:
        """Wait until the component has taken what it was told; raises what it raised, once."""
        pending = self._untaken.get(component.name)
        if pending is None:
            return
        await asyncio.wait([pending])  # unlike `await pending`, this does not cancel it when a skill is cancelled
        if self._untaken.get(component.name) is pending:
            del self._untaken[component.name]
        why = failure(pending)
        if why is not None:
            raise why

    async def all_taken(self) -> None:
        """Wait until all components have taken, or refused, what they were told; not for ever."""
        if self._untaken:
            await asyncio.wait(self._untaken.values(), timeout=CLOSING)

    def tasks(self) -> Iterable[asyncio.Task[None]]:
        """What is to be waited for at the end."""
        return self._untaken.values()

    def untaken(self) -> list[str]:
        """What components could not take, as far as no skill has failed because of it."""
        return [_untaken(name, task) for name, task in self._untaken.items() if not _succeeded(task)]

    def _in_turn(self, name: str, take: Callable[[], Awaitable[None]]) -> None:
        before = self._untaken.get(name)

        async def in_order() -> None:
            if before is not None:
                await asyncio.wait([before])
            await take()
            why = None if before is None else failure(before)
            if why is not None:  # still to be told to the next skill
                raise why

        self._untaken[name] = asyncio.get_running_loop().create_task(in_order())


async def _take(component: Component, told: Told) -> None:
    match told:
        case SetParameter():
            await component.configure(told.parameter, encoded(told.value))
        case SwitchMode():
            await component.change_mode(told.mode)
        case SendMessage():
            await component.take(told.port, encoded(told.arguments))


async def _switch_again(component: Component, mode: str) -> None:
    """One that was to start anew has done so."""
    await (component.come_alive() if mode == Life.INIT else component.change_mode(mode))


def failure(task: asyncio.Task[None]) -> BaseException | None:
    """What a task that is over raised, if anything."""
    return None if task.cancelled() else task.exception()


def _succeeded(task: asyncio.Task[None]) -> bool:
    return task.done() and not task.cancelled() and task.exception() is None


def _untaken(component: str, task: asyncio.Task[None]) -> str:
    why = failure(task) if task.done() else None
    reason = described(why) if why is not None else f"no answer within {CLOSING:g} s"
    return f"component '{component}' did not take what it was told: {reason}"
