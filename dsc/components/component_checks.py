"""Checks of deployed components before a run: instances, unique names, declared needs."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping

from dsc.components.component import ALWAYS, Component
from dsc.components.life_cycle import NEUTRAL
from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.language.inputs import require_several, shown


def require_instances(components: Iterable[Component]) -> tuple[Component, ...]:
    """Validate components: their instances, unique names and needs; return them.

    Raises:
        InputError: the argument is not a list, an item is not a component instance, or its needs are malformed.
        SchemaError: two have one name.
    """
    require_several(components, "components")
    components = tuple(components)
    names = set()
    for one in components:
        if not isinstance(one, Component):
            hint = f"; an instance is made by {one.__name__}()" if isinstance(one, type) else ""
            raise InputError(f"a component is an instance of a subclass of Component, not {shown(one)}{hint}")
        if one.name in names:
            raise SchemaError(f"two components are named '{one.name}'", found=one.name)
        _require_needs(one)
        names.add(one.name)
    return components


def _require_needs(component: Component) -> None:
    """Raise an error unless a component's `needs` are names, for modes that it has.

    Raises:
        InputError: the needs in a mode are not a tuple of names, e.g. one name without the comma.
        UnknownNameError: the component says which modes it has, and one is none.
    """
    name, needs = component.name, component.needs
    if not isinstance(needs, Mapping):
        raise InputError(f"what component '{name}' needs is said for each mode, as in {_EXAMPLE}, not {shown(needs)}")
    modes = (NEUTRAL, *component.modes)
    for mode, needed in needs.items():
        if not isinstance(needed, tuple) or not all(isinstance(one, str) for one in needed):
            when = f"in its mode '{mode}'" if mode else "always"
            raise InputError(f"what component '{name}' needs {when} is a tuple, as in {_EXAMPLE}, not {shown(needed)}")
        if mode != ALWAYS and component.modes and mode not in modes:
            message = f"component '{name}' needs something in its mode '{mode}', which it does not have"
            raise UnknownNameError(message, found=mode, valid=modes)


def require_deployed(components: Collection[Component], besides: Iterable[str] = ()) -> None:
    """Raise `UnknownNameError` for a component that another needs, in any mode, and that is not deployed.

    Args:
        components: all components; those that reach others elsewhere are not validated.
        besides: names of further components.
    """
    deployed = {*(component.name for component in components), *besides}
    for component in components:
        if type(component).reach is not Component.reach:  # it may find them elsewhere
            continue
        for needed in (*component.needed(), *(name for names in component.needs.values() for name in names)):
            if needed not in deployed:
                message = f"component '{component.name}' needs a component '{needed}', and there is none"
                raise UnknownNameError(message, found=needed, valid=deployed - {component.name})


_EXAMPLE = "needs = {'scanning': ('power',)}"
