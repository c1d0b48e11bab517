"""Rows of the relations of a run's components, see `dsc.model.relations` (S1.6, S1.9, S1.17)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

from dsc.components.component import Component
from dsc.components.life_cycle import Announcer
from dsc.engine.machine_state import MachineState
from dsc.model.relations import COMPONENTS
from dsc.sequencer.dispatcher import Dispatcher
from knowledge_base.facts import Value
from knowledge_base.world.live_rows import LiveRows, Rows

_Row = tuple[Value, ...]


class ComponentRelations:
    """Provider of the present components, skills, wires and resources of a run.

    Args:
        dispatcher: the components with their running skills.
        state: returns the chart's state.
        live: the rows of the knowledge base.
        renew: evaluates the conditions on relations, by their names.

    Attributes:
        rows: the rows of each relation.
    """

    def __init__(
        self,
        dispatcher: Dispatcher,
        state: Callable[[], MachineState],
        live: LiveRows,
        renew: Callable[[Iterable[str]], None],
    ) -> None:
        self._dispatcher = dispatcher
        self._state = state
        self._live = live
        self._renew = renew
        self.rows: dict[str, Rows] = {
            "dsc:component": lambda: [(name,) for name in [*dispatcher.components]],
            "dsc:component-life": lambda: self._each(lambda one: [(one.name, str(one.life.state))]),
            "dsc:component-mode": lambda: self._each(lambda one: [(one.name, one.mode)]),
            "dsc:component-active": lambda: self._each(lambda one: [(one.name,)] if one.life.active else []),
            "dsc:component-parameter": lambda: self._each(_parameters),
            "dsc:skill": lambda: self._each(_names_of_skills),
            "dsc:outcome": lambda: self._each(_outcomes),
            "dsc:wire": self._wires,
            "dsc:resource": self._capacities,
            "dsc:occupies": self._occupation_rows,
            "dsc:executes": self._executes,
            "dsc:waits": self._waits,
        }

    def listen(self) -> None:
        """Evaluate the conditions after each later change of a component, until `close`."""
        for source in self._sources():
            source.listen(self.renew)

    def close(self) -> None:
        """End the evaluation."""
        for source in self._sources():
            source.leave(self.renew)

    def renew(self) -> None:
        """Evaluate the conditions on components, if any was read."""
        if self._live.read:
            self._renew(COMPONENTS)

    def _sources(self) -> tuple[Announcer, ...]:
        dispatcher = self._dispatcher
        return dispatcher.lives.changes, dispatcher.wiring, dispatcher.activation.waits

    def _each(self, read: Callable[[Component], Iterable[_Row]]) -> Iterator[_Row]:
        for component in [*self._dispatcher.components.values()]:  # other threads may read rows
            yield from read(component)

    def _wires(self) -> Iterator[_Row]:
        for component, wires in self._dispatcher.wiring.wires().items():
            yield from ((f"{component}.{port}", provider) for port, provider in wires.items() if provider is not None)

    def _capacities(self) -> Iterator[_Row]:
        room = self._dispatcher.activation.room
        return iter(() if room is None else [*room.capacity.items()])

    def _occupation_rows(self) -> Iterator[_Row]:
        room = self._dispatcher.activation.room
        for component, amounts in [] if room is None else [*room.users.items()]:
            yield from ((component, resource, amount) for resource, amount in amounts.items())

    def _executes(self) -> Iterator[_Row]:
        return ((state, skill) for state, _, skill, waits in self._skills() if not waits)

    def _waits(self) -> Iterator[_Row]:
        yield from ((state, component) for state, component, _, waits in self._skills() if waits)
        activation = self._dispatcher.activation
        for name in activation.waiting:
            room, component = activation.room, self._dispatcher.components.get(name)
            if room is not None and component is not None:
                yield from ((name, resource) for resource in room.short_of(component))

    def _skills(self) -> Iterator[tuple[str, str, str, bool]]:
        """Yield the running skills of active states: path of the state, component, skill, and whether it waits."""
        state = self._state()
        for running, missing in self._dispatcher.running():
            start = running.start
            if found := state.state_of(start.activation):
                yield found[0], start.component, f"{start.component}.{start.skill}", bool(missing)


def _names_of_skills(component: Component) -> Iterator[_Row]:
    return ((component.name, f"{component.name}.{skill}") for skill in component.skills())


def _outcomes(component: Component) -> Iterator[_Row]:
    for name, skill in component.skills().items():
        yield from ((f"{component.name}.{name}", event) for event in skill.outcomes)


def _parameters(component: Component) -> Iterator[_Row]:
    """Yield the parameters whose values a fact may have."""
    values = dict(component.parameters).items()
    return ((component.name, name, value) for name, value in values if isinstance(value, Value))
