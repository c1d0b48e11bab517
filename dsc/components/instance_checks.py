"""Checks of a component's instance: the attributes and methods of every component, its modes and its hooks."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from inspect import getattr_static, iscoroutinefunction, isfunction, signature, unwrap
from itertools import takewhile

from dsc.components.component import Component
from dsc.components.life_cycle import NEUTRAL, LifeCycle
from dsc.components.parameters import Parameters, ParameterValues
from dsc.components.ports import EventActivations
from knowledge_base.errors import InputError, Place, SchemaError, UnknownNameError
from knowledge_base.tracebacks import place_of
from knowledge_base.user_objects import shown

_EXAMPLE_OF_MODES = "modes = ('scanning',) or modes = {'scanning': ('parked',), 'parked': ()}"
_OF_EVERY_COMPONENT = {
    "parameter_values": ParameterValues,
    "parameters": Parameters,
    "life": LifeCycle,
    "activations": EventActivations,
    "pushes": dict,
    "requirements": dict,
}
_METHODS = tuple(name for name in dir(Component) if name[:2] != "__" and callable(getattr(Component, name)))


def require_whole(component: Component) -> None:
    """Raise `SchemaError` if a component lacks or replaces attributes or methods of every component."""
    kind = type(component)
    if not all(hasattr(component, name) for name in _OF_EVERY_COMPONENT):
        raise SchemaError(f"{kind.__name__}.__init__ does not call super().__init__()", place=_place_of_init(kind))
    for name in _hidden_names(component):
        message = f"'{name}' of {kind.__name__} hides an attribute of every component; choose another name"
        raise SchemaError(message, place=_place_of_init(kind), found=name)


def _place_of_init(kind: type[Component]) -> Place | None:
    """Return the line of a class's `__init__`, or of the class, e.g. of a dataclass."""
    return (place_of(kind.__init__) if "__init__" in vars(kind) else None) or place_of(kind)


def _hidden_names(component: Component) -> Iterator[str]:
    """Yield the names of the attributes of every component that a component has in another form.

    Without a period, `step` is the builder's own.
    """
    for name, wanted in _OF_EVERY_COMPONENT.items():
        if not isinstance(getattr(component, name), wanted):
            yield name
    if not hasattr(getattr_static(type(component), "mode", None), "__get__"):
        yield "mode"
    own_kinds = takewhile(lambda kind: kind is not Component, type(component).__mro__)
    own_names = set(vars(component)).union(*map(vars, own_kinds))
    for name in filter(own_names.__contains__, _METHODS):  # a run checks its components, and the look-up is slow
        own = getattr_static(component, name, None)
        found = own if isinstance(own, property) else getattr(component, name, None)  # a property calls users' code
        if not callable(found) and not (name == "step" and component.period is None):
            yield name


def require_modes(component: Component) -> None:
    """Raise an error unless a component's `modes` are names, or map names to tuples of its names.

    Raises:
        InputError: the modes are something else, e.g. one name without the comma.
        UnknownNameError: a mode may follow that the component does not have.
    """
    name, modes = component.name, component.modes
    several = modes.values() if isinstance(modes, Mapping) else (modes,)
    for found in several:
        if not isinstance(found, tuple | list) or not all(isinstance(one, str) for one in found):
            message = f"the modes of component '{name}' are a tuple, as in {_EXAMPLE_OF_MODES}, not {shown(found)}"
            raise InputError(message, place=place_of(type(component)))
    valid = (NEUTRAL, *modes)
    for mode, following in modes.items() if isinstance(modes, Mapping) else ():
        for one in following:
            if one not in valid:
                message = f"component '{name}' has no mode '{one}', which may follow its mode '{mode}'"
                raise UnknownNameError(message, found=one, valid=valid, place=place_of(type(component)))


_HOOKS = tuple(name for name in _METHODS if name != "step" and iscoroutinefunction(getattr(Component, name)))


def require_coroutines(component: Component) -> None:
    """Raise `InputError` for a hook that is a plain function; `step` has its own check."""
    for name in _HOOKS:
        hook = unwrap(getattr(type(component), name))
        if isfunction(hook) and not iscoroutinefunction(hook):
            message = f"'{name}' of component '{component.name}' is a coroutine: write `async def {name}`"
            raise InputError(message, place=place_of(hook))


def require_period(component: Component) -> None:
    """Raise `InputError` unless a component has both a `step` and a positive `period`, or neither.

    A method `step` that has arguments, or is not a coroutine, is the builder's own.
    """
    name, period = component.name, component.period
    step = type(component).step
    steps = step is not Component.step and iscoroutinefunction(step) and len(signature(step).parameters) == 1
    if period is None and not steps:
        return
    if not steps:
        raise InputError(
            f"component '{name}' has a `period`, and no hook `async def step(self)`", place=place_of(type(component))
        )
    number = isinstance(period, int | float) and not isinstance(period, bool)
    if not (number and 0 < float(period or 0) < math.inf):
        message = f"the `period` of component '{name}', which has a `step`, is a positive number of seconds"
        raise InputError(f"{message}, not {shown(period)}", place=place_of(type(component)))
