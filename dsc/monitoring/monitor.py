"""The monitor: observes local and remote components by a monitoring profile (S1.19, S1.8)."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from dsc.components.component import Component
from dsc.errors import SkillError
from dsc.monitoring.profile import CHANGE, MonitoringProfile, When
from knowledge_base.errors import UnknownNameError
from knowledge_base.user_objects import described

EARLY = 0.05
"""Share of a period by which an observation may come early, as timers are not exact."""
PROBLEM = "problem"
"""The entry of a component without an answer: its value is the reason, and `None` when it answers again."""
_NOTHING = object()


@dataclass(frozen=True, slots=True)
class Observation:
    """An observed value.

    Attributes:
        seconds: the loop time of the observation since the start of the monitor.
        component: the name of the component.
        entry: the entry of its diagnosis, its push port, or `problem`.
        value: the value, as plain data.
    """

    seconds: float
    component: str
    entry: str
    value: Any


class Monitor:
    """Observes components until `run` is cancelled; a component without an answer is observed again when it answers.

    Args:
        profile: the entries to observe.
        components: local or remote components by name.
        listener: called with each observation, in the loop's thread.
        sleep: waits between two diagnoses.

    Raises:
        UnknownNameError: a component or a push port of the profile does not exist.
    """

    def __init__(
        self,
        profile: MonitoringProfile,
        components: Mapping[str, Component],
        listener: Callable[[Observation], None],
        sleep: Callable[[float], Awaitable[object]] = asyncio.sleep,
    ) -> None:
        self._profile = profile
        self._components = components
        self._listener = listener
        self._sleep = sleep
        self._began = 0.0
        self._last: dict[tuple[str, str], tuple[float, Any]] = {}
        for name, observed in profile.components.items():
            self._require(("components", name), name, components, "component")
            for port in observed.streams:
                path = ("components", name, "streams", port)
                self._require(path, port, components[name].pushes, f"push port of component '{name}' with the name")

    def _require(self, path: tuple[str, ...], name: str, valid: Mapping[str, object], kind: str) -> None:
        if name not in valid:
            error = UnknownNameError(f"there is no {kind} '{name}'", found=name, valid=valid)
            error.place = self._profile.place(path)
            raise error

    async def run(self) -> None:
        """Observe the components, until cancelled.

        Raises:
            UnknownNameError: the diagnosis of a component has no such entry.
        """
        self._began = asyncio.get_running_loop().time()
        try:
            async with asyncio.TaskGroup() as group:
                for name, observed in self._profile.components.items():
                    if observed.diagnose:
                        group.create_task(self._diagnose(name, observed.diagnose))
                    for port, when in observed.streams.items():
                        group.create_task(self._follow(name, port, when))
        except ExceptionGroup as errors:
            raise errors.exceptions[0] from None

    async def _diagnose(self, name: str, entries: Mapping[str, When]) -> None:
        """Diagnose a component periodically, and report its entries when they are due."""
        component = self._components[name]
        pause = min([self._profile.sample, *(when for when in entries.values() if not isinstance(when, str))])
        while True:
            try:
                found = await component.diagnose()
            except SkillError as error:
                self._report(name, PROBLEM, described(error, named=False), CHANGE)
            else:
                if (name, PROBLEM) in self._last:
                    self._report(name, PROBLEM, None, CHANGE)
                values = {entry: self._entry(found, name, entry) for entry in entries}
                for entry, when in entries.items():
                    self._report(name, entry, values[entry], when)
            await self._sleep(pause)

    def _entry(self, found: Mapping[str, Any], name: str, entry: str) -> Any:
        """Return the entry of a diagnosis, where `a.b` is the entry `b` of the entry `a`."""
        value: Any = found
        for part in entry.split("."):
            if not isinstance(value, Mapping) or part not in value:
                valid = list(_entries(found))
                error = UnknownNameError(f"the diagnosis of '{name}' has no entry '{entry}'", found=entry, valid=valid)
                error.place = self._profile.place(("components", name, "diagnose", entry))
                raise error
            value = value[part]
        return value

    async def _follow(self, name: str, port: str, when: When) -> None:
        """Report the values of a push port, until cancelled."""

        def receive(values: dict[str, Any], _: float) -> None:
            self._report(name, port, values, when)

        push = self._components[name].pushes[port]
        push.listen(receive)
        try:
            await asyncio.Event().wait()
        finally:
            push.leave(receive)

    def _report(self, name: str, entry: str, value: Any, when: When) -> None:
        """Report a value if it is due: it has changed, or its period is over."""
        now = asyncio.get_running_loop().time()
        reported, before = self._last.get((name, entry), (-float("inf"), _NOTHING))
        is_due = value != before if isinstance(when, str) else now - reported >= when * (1 - EARLY)
        if is_due:
            self._last[name, entry] = (now, value)
            self._listener(Observation(round(now - self._began, 3), name, entry, value))


def _entries(found: Mapping[str, Any], above: str = "") -> Iterator[str]:
    """Yield the names of all entries of a diagnosis."""
    for name, value in found.items():
        yield f"{above}{name}"
        if isinstance(value, Mapping):
            yield from _entries(value, f"{above}{name}.")
