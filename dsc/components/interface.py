"""Interface of a component besides its skills: what charts may set, switch and send, for the checks before a run."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

from dsc.components.declarations import Parameter
from dsc.components.life_cycle import NEUTRAL, Life
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
    """

    parameters: Mapping[str, Parameter] = field(default_factory=dict)
    modes: Collection[str] = ()
    messages: Mapping[str, SkillSignature] | None = None
    methods: Collection[str] = ()

    def require_mode(self, component: str, mode: str) -> None:
        """Raise `UnknownNameError` for a mode, or state of the life cycle, that charts cannot switch to."""
        if self.modes and mode not in (NEUTRAL, *self.modes, Life.INIT, Life.SHUTDOWN):
            valid = (NEUTRAL, *self.modes)
            raise UnknownNameError(f"component '{component}' has no mode '{mode}'", found=mode, valid=valid)

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
