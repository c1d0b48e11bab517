"""Skills that are functions: the smallest component there is."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from dsc.components.component import Component
from dsc.skills import DECLARED, SkillBody, SkillSignature, signature_of
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

    def skills(self) -> dict[str, SkillSignature]:
        """The signatures of the functions, which have no `self`."""
        declared = {name: getattr(function, DECLARED) for name, function in self._functions.items()}
        return {
            name: signature_of(self.name, name, function, replace(declared[name], own=declared[name].own - 1))
            for name, function in self._functions.items()
        }

    def body(self, skill_name: str) -> SkillBody:
        """The function."""
        return self._functions[skill_name]
