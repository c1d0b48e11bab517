"""Components that a watched condition reads: they stay active while the condition is watched."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import TypeVar

from dsc.components.component import Component
from dsc.components.life_cycle import Life
from dsc.supervision.activation import ComponentActivation
from dsc.supervision.skill_dependencies import SkillDependencies

_Result = TypeVar("_Result")


class Sources:
    """The components whose values are read at present.

    Args:
        activation: activates the components.

    Attributes:
        names: the names of the components, one for each reader.
    """

    def __init__(self, activation: ComponentActivation) -> None:
        self._activation = activation
        self.names: list[str] = []

    async def work(self, name: str, on: Callable[[Component], Awaitable[_Result]]) -> _Result:
        """Await the work `on` a component, which is active from the beginning of the work to its end.

        Raises:
            KeyError: there is no such component.
            NotAliveError: the component, or one that it needs, cannot start or is lost; the work was cancelled.
        """
        component = self._activation.registry.components[name]
        self.names.append(name)
        self._activation.changed(name)
        try:
            dependencies = SkillDependencies(self._activation, component)
            if dependencies.concerned or component.life.state is not Life.ALIVE:
                await dependencies.ready()
            return await dependencies.carrying(on(component))
        finally:
            self.names.remove(name)
            self._activation.changed(name)
