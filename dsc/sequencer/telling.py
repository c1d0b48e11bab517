"""What components are told without an answer: parameters, modes and messages, to each in the order they leave in."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Collection, Iterable

from dsc.components.component import Component
from dsc.components.life import Life
from dsc.components.stopping import GRACE
from dsc.engine.steps import SendMessage, SetParameter, SwitchMode
from dsc.sequencer.ends import encoded

CLOSING = GRACE
"""Seconds for components to take what they were last told, and for cancelled skills to stop."""
Told = SetParameter | SwitchMode | SendMessage
"""What is told."""


class Telling:
    """What is on its way to components, or was refused and has not been said to anybody."""

    def __init__(self) -> None:
        self._telling: dict[str, asyncio.Task[None]] = {}
        self._under_way: dict[int, Told] = {}
        self._last = 0

    @property
    def under_way(self) -> Collection[Told]:
        """What has been told and not been taken yet, nor refused."""
        return self._under_way.values()

    def tell(self, component: Component, told: Told, *, again: bool = False) -> None:
        """Let the component take it after what it was told before.

        Args:
            component: whom.
            told: what.
            again: it is in force since before a restart: a component that was to start anew has done so.
        """
        number = self._last = self._last + 1
        self._under_way[number] = told

        async def take() -> None:
            try:
                await _take(component, told, again=again)
            finally:
                del self._under_way[number]

        self._in_turn(component.name, take)

    async def taken(self, component: Component) -> None:
        """Wait until the component has taken what it was told; raises what it raised, once."""
        pending = self._telling.get(component.name)
        if pending is None:
            return
        await asyncio.wait([pending])  # unlike `await pending`, this does not cancel it when a skill is cancelled
        if self._telling.get(component.name) is pending:
            del self._telling[component.name]
        why = failure(pending)
        if why is not None:
            raise why

    async def all_taken(self) -> None:
        """Wait until all components have taken, or refused, what they were told; not for ever."""
        if self._telling:
            await asyncio.wait(self._telling.values(), timeout=CLOSING)

    def tasks(self) -> Iterable[asyncio.Task[None]]:
        """What is to be waited for at the end."""
        return self._telling.values()

    def untaken(self) -> list[str]:
        """What components could not take, as far as no skill has failed because of it."""
        return [_untaken(name, task) for name, task in self._telling.items() if not _succeeded(task)]

    def _in_turn(self, name: str, take: Callable[[], Awaitable[None]]) -> None:
        before = self._telling.get(name)

        async def in_order() -> None:
            if before is not None:
                await asyncio.wait([before])
            await take()
            why = None if before is None else failure(before)
            if why is not None:  # still to be told to the next skill
                raise why

        self._telling[name] = asyncio.get_running_loop().create_task(in_order())


async def _take(component: Component, told: Told, *, again: bool) -> None:
    match told:
        case SwitchMode(mode=Life.INIT) if again:
            await component.come_alive()
        case SetParameter():
            await component.configure(told.parameter, encoded(told.value))
        case SwitchMode():
            await component.change_mode(told.mode)
        case SendMessage():
            await component.take(told.port, encoded(told.arguments))


def failure(task: asyncio.Task[None]) -> BaseException | None:
    """What a task that is over raised, if anything."""
    return None if task.cancelled() else task.exception()


def _succeeded(task: asyncio.Task[None]) -> bool:
    return task.done() and not task.cancelled() and task.exception() is None


def _untaken(component: str, task: asyncio.Task[None]) -> str:
    why = failure(task) if task.done() else None
    reason = f"{type(why).__name__}: {why}" if why is not None else f"no answer within {CLOSING:g} s"
    return f"component '{component}' did not take what it was told: {reason}"
