"""Room: the resources of a robot, which its active components share (S1.9, S1.21)."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping

from dsc.components.component import ALWAYS, Component
from dsc.components.life_cycle import Announcer
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.user_objects import shown

Amounts = Mapping[str, float]


def amounts_of(component: Component, mode: str) -> dict[str, float]:
    """Return the amounts of resources that a component needs in a mode."""
    found: dict[str, float] = {}
    for key in dict.fromkeys((ALWAYS, mode)):
        for resource, amount in component.demands[key].resources.items() if key in component.demands else ():
            found[resource] = found.get(resource, 0.0) + amount
    return found


class Room(Announcer):
    """The resources of a robot; announces each release.

    A component has its resources from before its activation until after its deactivation.

    Args:
        capacity: the amount of each resource.

    Attributes:
        users: the amounts by component.

    Raises:
        InputError: a capacity is not a number from 0 on.
    """

    def __init__(self, capacity: Amounts) -> None:
        super().__init__()
        for name, amount in capacity.items():
            if isinstance(amount, bool) or not isinstance(amount, int | float) or not 0 <= amount < math.inf:
                raise InputError(f"the capacity of '{name}' is a number from 0 on, not {shown(amount)}", found=name)
        self.capacity = dict(capacity)
        self.users: dict[str, Amounts] = {}
        self._holders: dict[str, set[int]] = {}

    def require(self, components: Iterable[Component]) -> None:
        """Check that each component alone fits in each of its modes.

        Raises:
            UnknownNameError: a component needs a resource that the robot does not have.
            InputError: a component needs more than the capacity.
        """
        for component in components:
            for mode in component.demands:
                for resource, amount in amounts_of(component, mode).items():
                    if resource not in self.capacity:
                        message = f"component '{component.name}' needs '{resource}', which the robot does not have"
                        raise UnknownNameError(message, found=resource, valid=self.capacity)
                    if amount > self.capacity[resource]:
                        whole = f"{amount:g} of '{resource}', and the robot has {self.capacity[resource]:g}"
                        raise InputError(f"component '{component.name}' needs {whole}", found=component.name)

    def take(self, wanted: Mapping[str, Amounts], holder: int) -> str:
        """Assign amounts to all components together, or to none; return the reason if they do not fit, else nothing.

        Args:
            wanted: the amounts by component; they replace those that a component has.
            holder: the number of the activation tree that needs the components.
        """
        users = {**self.users, **wanted}
        for resource, capacity in self.capacity.items():
            amounts = {name: found[resource] for name, found in users.items() if found.get(resource)}
            if sum(amounts.values()) > capacity:
                needed = sum(amounts.pop(name, 0.0) for name in wanted)
                parts = ", ".join(f"{name} uses {amount:g}" for name, amount in sorted(amounts.items()))
                return f"it needs {needed:g} of '{resource}'; of {capacity:g}, {parts or 'nothing is used'}"
        before, self.users = self.users, users
        for name in wanted:
            self._holders.setdefault(name, set()).add(holder)
        if any(amount < before.get(name, {}).get(what, 0.0) for name in wanted for what, amount in users[name].items()):
            self.announce()
        return ""

    def short_of(self, component: Component) -> list[str]:
        """Return the resources that a component lacks in its mode; all its resources if each alone is free."""
        wanted = amounts_of(component, component.mode)
        others = [amounts for name, amounts in self.users.items() if name != component.name]
        used = {name: sum(amounts.get(name, 0.0) for amounts in others) for name in wanted}
        return [one for one in wanted if used[one] + wanted[one] > self.capacity[one]] or [*wanted]

    def release(self, component: str, holder: int) -> None:
        """Free the resources of a component that no other activation tree needs."""
        holders = self._holders.get(component)
        if holders is None or holder not in holders:
            return
        holders.discard(holder)
        if not holders:
            del self._holders[component], self.users[component]
            self.announce()
