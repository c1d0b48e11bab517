"""Skills that were cancelled and still put things in order; the next one of their component waits for them."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable

from dsc.components.stopping import GRACE, give_up_after


class Endings:
    """What was cancelled, until it has stopped or was given up after `GRACE` seconds: nobody waits for longer.

    Args:
        say: is told the component of which something has stopped, or was given up.
    """

    def __init__(self, say: Callable[[str], None]) -> None:
        self._say = say
        self._ending: dict[str, dict[asyncio.Task[None], asyncio.Future[None]]] = {}

    def add(self, component: str, task: asyncio.Task[None], say: Callable[[], None]) -> None:
        """Bound a task of a component that was just cancelled; `say` is called if it is given up."""
        over: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        of_component = self._ending.setdefault(component, {})
        of_component[task] = over

        def end(_: asyncio.Task[None]) -> None:
            if of_component.pop(task, None) is not None:
                over.set_result(None)
                self._say(component)

        def give_up() -> None:
            end(task)
            say()

        task.add_done_callback(end)
        give_up_after(task, GRACE, give_up)

    def components(self) -> Iterable[str]:
        """Those of which something is still ending."""
        return [component for component, ending in self._ending.items() if ending]

    def of(self, component: str) -> bool:
        """Whether anything of the component is still ending."""
        return bool(self._ending.get(component))

    async def over(self, component: str) -> None:
        """Wait until nothing of the component is ending any more."""
        while ending := self._ending.get(component):
            await asyncio.wait(ending.values())

    def tasks(self) -> Iterable[asyncio.Task[None]]:
        """What is to be waited for at the end."""
        return [task for of_component in self._ending.values() for task in of_component]
