"""Components of a robot: creation from functions, import by `module:name`, checks before a run, and connections."""

from __future__ import annotations

import re
import sys
from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace
from importlib import import_module
from pathlib import Path

from dsc.components.component import ALWAYS, Component
from dsc.components.hooks import contained
from dsc.components.instance_checks import require_coroutines, require_modes, require_period, require_whole
from dsc.components.life_cycle import NEUTRAL
from dsc.skills import DECLARED, Declared, SkillBody, SkillSignature, signature_of
from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.language.checking.inputs import require_several, require_text
from knowledge_base.tracebacks import place_of, raised_at, user_place
from knowledge_base.user_objects import described, has_type, shown, text_of


def component_of(name: str, *functions: SkillBody) -> Component:
    """Return a component whose skills are decorated functions, e.g. `async def greet(call, person)`.

    Raises:
        InputError: a function is not decorated with `skill`.
    """
    for function in functions:
        if not hasattr(function, DECLARED):
            what = f"'{function.__name__}'" if hasattr(function, "__name__") else shown(function)
            raise InputError(f"{what} is not a skill: decorate a function with `skill`", found=what)
    return _OfFunctions(name, {function.__name__: function for function in functions})


class _OfFunctions(Component):
    """A component whose skills are functions."""

    def __init__(self, name: str, functions: Mapping[str, SkillBody]) -> None:
        super().__init__(name)
        self._functions = functions
        self._signatures: dict[str, SkillSignature] = {}
        for skill, function in functions.items():
            declared: Declared = getattr(function, DECLARED)
            without_self = replace(declared, own=declared.own - 1)
            self._signatures[skill] = signature_of(self.name, skill, function, without_self)

    def skills(self) -> dict[str, SkillSignature]:
        """Return the signatures of the functions."""
        return dict(self._signatures)


def robot_of(named: str) -> tuple[Component, ...]:
    """Return the components at `module:name`, or those that the function at `module:name` returns.

    Args:
        named: `module:name`. The module is imported and executed; like with `python -m`, the present folder is searched
            too. A function must have no parameters.

    Raises:
        InputError: the module or the name does not exist, or the value of the name is not components.
    """
    return components_in(made(named_part(named), named))


def components_in(found: object) -> tuple[Component, ...]:
    """Return one component or several components as a tuple; errors as for `require_instances`."""
    several = isinstance(found, Iterable) and not isinstance(found, Component)
    return require_instances(found if several else (found,))  # type: ignore[arg-type]  # checked there


def made(found: object, named: str) -> object:
    """Return the result of a function without parameters, or another value unchanged; `named` is for messages.

    Raises:
        InputError: the function raises an error.
    """
    if isinstance(found, Component) or not callable(found):
        return found
    try:
        with contained():
            return found()
    except InputError as error:
        if error.place is not None:  # its message is complete
            raise
        raise InputError(f"'{named}' cannot be called: {error}") from error
    except Exception as error:  # a user's function may raise any error
        raise InputError(f"'{named}' cannot be called: {described(error)}{raised_at(error)}") from error


def named_part(named: str) -> object:
    """Return the value at `module:name`; the module is imported, also from the present folder.

    Raises:
        InputError: the module cannot be imported.
        UnknownNameError: the module has no such name.
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
    except InputError as error:
        if error.place is not None:
            raise
        raise InputError(f"the module '{module_name}' cannot be imported: {error}", place=user_place(error)) from error
    except Exception as error:  # a user's module may raise any error
        raise module_error(error, f"the module '{module_name}' cannot be imported") from error
    if not hasattr(module, name):
        valid = [one for one in vars(module) if not one.startswith("_")]
        raise UnknownNameError(f"there is no '{name}' in the module '{module_name}'", found=name, valid=valid)
    return getattr(module, name)


def module_error(error: BaseException, said: str) -> InputError:
    """Return the error for an exception of a user's module, with its line and the nearest name of a failed import."""
    found = _IMPORTED.match(text_of(error, str)) if has_type(error, ImportError) else None
    module = None if found is None else sys.modules.get(found["module"])
    reason = f"SyntaxError: {error.msg}" if has_type(error, SyntaxError) else described(error)
    return InputError(
        f"{said}: {reason if module is None else reason.split(' (')[0]}",
        place=user_place(error),
        found=found and found["name"],
        valid=() if module is None else [name for name in dir(module) if name[0] != "_"],
    )


_IMPORTED = re.compile(r"cannot import name '(?P<name>\w+)' from '(?P<module>[\w.]+)'")


def require_instances(components: Iterable[Component]) -> tuple[Component, ...]:
    """Validate the instances, unique names and needs of components; return the components.

    Raises:
        InputError: the argument is not a list, an item is not a component instance, or its needs are malformed.
        SchemaError: two components have equal names.
    """
    require_several(components, "components")
    components = tuple(components)
    names = set()
    for one in components:
        if not isinstance(one, Component):
            hint = f"; an instance is made by {one.__name__}()" if isinstance(one, type) else ""
            raise InputError(f"a component is an instance of a subclass of Component, not {shown(one)}{hint}")
        require_whole(one)
        require_text(one.name, f"`name` of {type(one).__name__}")
        require_modes(one)
        require_coroutines(one)
        require_period(one)
        if one.name in names:
            other = next(other for other in components if other.name == one.name)
            classes = " and ".join(f"{type(each).__name__} ({place_of(type(each))})" for each in (other, one))
            raise SchemaError(f"two components are named '{one.name}': {classes}", found=one.name)
        _require_needs(one)
        names.add(one.name)
    return components


def _require_needs(component: Component) -> None:
    """Raise an error unless a component's `needs` map its modes to tuples of names.

    Raises:
        InputError: the needs in a mode are not a tuple of names, e.g. one name without the comma.
        UnknownNameError: the component declares its modes, and a mode in `needs` is not among them.
    """
    name, needs = component.name, component.needs
    if not isinstance(needs, Mapping):
        message = (
            f"`needs` of component '{name}' is a mapping of modes, as in {_EXAMPLE}, or of ALWAYS, not {shown(needs)}"
        )
        raise InputError(message, place=place_of(type(component)))
    modes = (NEUTRAL, *component.modes)
    for mode, needed in needs.items():
        if not isinstance(needed, tuple) or not all(isinstance(one, str) for one in needed):
            when = f" in its mode '{mode}'" if mode else ""
            message = f"the needs of component '{name}'{when} are a tuple, as in {_EXAMPLE}, not {shown(needed)}"
            raise InputError(message, place=place_of(type(component)))
        if mode != ALWAYS and component.modes and mode not in modes:
            message = f"component '{name}' needs something in its mode '{mode}', which it does not have"
            raise UnknownNameError(message, found=mode, valid=modes, place=place_of(type(component)))


def require_deployed(components: Collection[Component], besides: Iterable[str] = ()) -> None:
    """Raise `UnknownNameError` for a component that another one needs, in any mode, and that is not deployed.

    Args:
        components: all components; those that override `reach` are skipped.
        besides: names of further components.
    """
    deployed = {*(component.name for component in components), *besides}
    for component in components:
        if type(component).reach is not Component.reach:  # the component may find required components elsewhere
            continue
        declared = [name for names in component.needs.values() for name in names]
        in_use = component.needed() if type(component).needed is not Component.needed else ()
        for needed in (*in_use, *declared):
            if needed not in deployed and needed not in component.requirements:
                message = f"component '{component.name}' needs a component '{needed}', and there is none"
                place = place_of(type(component))
                raise UnknownNameError(message, found=needed, valid=deployed - {component.name}, place=place)


_EXAMPLE = "needs = {'scanning': ('power',)}"
