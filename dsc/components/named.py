"""The components of a robot, as a command line names them: `module:factory`."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from importlib import import_module
from pathlib import Path

from dsc.components.component import Component
from dsc.components.hooks import contained
from dsc.components.roster import require_instances
from knowledge_base.errors import InputError, UnknownNameError, described
from knowledge_base.language.inputs import shown


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
