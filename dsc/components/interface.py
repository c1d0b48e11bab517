"""Interface of a component: what charts may set, switch, send and wire, and its provided and required services."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from dsc.components.checks import Check
from dsc.components.declarations import Parameter
from dsc.components.life_cycle import NEUTRAL, Life
from dsc.components.services import Pattern, Service
from dsc.skills import SkillSignature
from knowledge_base.errors import UnknownNameError


@dataclass(frozen=True, slots=True)
class Interface:
    """The parameters, modes and messages of a component (S1.1).

    Attributes:
        parameters: the declared parameters by name; empty permits any name.
        modes: the declared modes; empty permits any mode.
        messages: the parts of each message by the message's name; `None` permits any message.
        methods: the public methods that charts cannot use, as they have no decorator.
        requires: the services of the required ports, by port.
        pushes: the services of the push ports, by port.
        checks: the own checks of the push ports, by name; `None` if a component of another program has them.
    """

    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    modes: Collection[str] = ()
    messages: Mapping[str, SkillSignature] | None = None
    methods: Collection[str] = ()
    requires: Mapping[str, Service] = field(default_factory=dict)
    pushes: Mapping[str, Service] = field(default_factory=dict)
    checks: Mapping[str, Check] | None = field(default_factory=dict)

    def require_mode(self, component: str, mode: str) -> None:
        """Raise `UnknownNameError` for a mode, or state of the life cycle, that charts cannot switch to."""
        if self.modes and mode not in (NEUTRAL, *self.modes, Life.INIT, Life.SHUTDOWN):
            valid = (NEUTRAL, *self.modes)
            raise UnknownNameError(f"component '{component}' has no mode '{mode}'", found=mode, valid=valid)

    def require_port(self, component: str, port: str) -> Service:
        """Return the service of a required port; raise `UnknownNameError` if the component requires no such port."""
        if port not in self.requires:
            message = f"component '{component}' requires no port '{port}'"
            raise UnknownNameError(message, found=port, valid=self.requires)
        return self.requires[port]

    def services(self, skills: Iterable[SkillSignature]) -> Iterator[tuple[str, Service]]:
        """Yield the provided services with their ports; parameters and modes have an empty port.

        Args:
            skills: the skills of the component, with its queries and events.
        """
        yield from self.pushes.items()
        for skill in (*skills, *(self.messages or {}).values()):
            if skill.pattern != "skill":
                yield skill.name, _service_of(skill)
        if self.parameters:
            yield "", Service("parameters", {name: one.type for name, one in self.parameters.items()}, {})
        if self.modes:
            yield "", Service("modes", dict.fromkeys(self.modes), {})

    def remedy(self, decorator: str, component: str, method: str) -> str:
        """Return the advice to decorate a method that charts cannot use; empty if there is no such method."""
        return (
            f"put `@{decorator}` above method '{method}' of component '{component}'" if method in self.methods else ""
        )

    def message(self, component: str, port: str) -> SkillSignature | None:
        """Return the parts of a message, or `None` if they are unknown.

        Raises:
            UnknownNameError: the component takes no such message.
        """
        if self.messages is not None and port not in self.messages:
            raise UnknownNameError(f"component '{component}' takes no '{port}'", found=port, valid=self.messages)
        return None if self.messages is None else self.messages[port]


def _service_of(signature: SkillSignature) -> Service:
    """Return the service of a query, an event or a message."""
    gives = next(iter(signature.outcomes.values()), {})
    return Service(_PATTERNS[signature.pattern], signature.parameters, gives, frozenset(signature.defaults))


_PATTERNS: Mapping[str, Pattern] = {"query": "query", "event": "event", "message": "send"}
