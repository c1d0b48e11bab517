"""Skills that are functions: the smallest component there is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from dsc.components.component import Component
from dsc.skills import DECLARED, Declared, SkillBody, SkillSignature, signature_of
from knowledge_base.errors import InputError
from knowledge_base.language.inputs import shown


def component_of(name: str, *functions: SkillBody) -> Component:
    """A component whose skills are decorated functions: `async def greet(call, person)`.

    Raises:
        InputError: a function is not decorated with `skill`.
    """
    for function in functions:
        if not hasattr(function, DECLARED):
            what = f"'{function.__name__}'" if hasattr(function, "__name__") else shown(function)
            raise InputError(f"{what} is no skill: decorate a function with `skill`", found=what)
    return _OfFunctions(name, {function.__name__: function for function in functions})


class _OfFunctions(Component):
    """Has functions for skills."""

    def __init__(self, name: str, functions: Mapping[str, SkillBody]) -> None:
        super().__init__(name)
        self._functions = functions
        self._signatures = {skill: _signature(self.name, skill, function) for skill, function in functions.items()}

    def skills(self) -> dict[str, SkillSignature]:
        """The signatures of the functions."""
        return dict(self._signatures)

    def body(self, skill_name: str) -> SkillBody:
        """The function."""
        return self._functions[skill_name]


def _signature(component: str, name: str, function: SkillBody) -> SkillSignature:
    """As of a method, but for `self`, which a function has not."""
    declared: Declared = getattr(function, DECLARED)
    return signature_of(component, name, function, replace(declared, own=declared.own - 1))
