"""Factories of components: from plain functions, and from `module:factory` on a command line."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path

from dsc.components.component import Component
from dsc.components.component_checks import require_instances
from dsc.components.hooks import contained
from dsc.skills import DECLARED, Declared, SkillBody, SkillSignature, signature_of
from knowledge_base.errors import InputError, UnknownNameError, described
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


def robot_of(named: str) -> tuple[Component, ...]:
    """The components that a function without arguments gives, or that a name stands for.

    Args:
        named: `module:name`; the module is found as `python -m` would, also in the present folder.

    Raises:
        InputError: there is no such module, nothing of that name in it, or it is no components. The module is run.
    """
    module_name, colon, name = named.partition(":")
    if not (module_name and colon and name):
        raise InputError(f"a robot is named as MODULE:NAME, not {shown(named)}", found=named)
    here = str(Path.cwd())
    if here not in sys.path:
        sys.path.insert(0, here)
    try:
        with contained():
            module = import_module(module_name)
    except Exception as error:  # whatever somebody's module does wrong
        raise InputError(f"the module '{module_name}' cannot be imported: {described(error)}") from error
    if not hasattr(module, name):
        valid = [one for one in vars(module) if not one.startswith("_")]
        raise UnknownNameError(f"there is no '{name}' in the module '{module_name}'", found=name, valid=valid)
    found = getattr(module, name)
    try:
        with contained():
            made = found() if callable(found) else found
    except Exception as error:
        raise InputError(f"'{named}' gives no components: {described(error)}") from error
    components = (made,) if isinstance(made, Component) or not isinstance(made, Iterable) else tuple(made)
    return require_instances(components)
