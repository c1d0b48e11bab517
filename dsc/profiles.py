"""Application of a settings profile to components, after validation of all its values."""

from __future__ import annotations

from collections.abc import Iterable

from dsc.components.component import Component
from dsc.components.declarations import known
from dsc.components.wiring import choose_sources
from dsc.model.ranges import refuse_change
from dsc.text.profiles import Profile, unknown_in
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import Value


def configure(components: Iterable[Component], profile: Profile | None = None) -> None:
    """Set the components' parameters to the values of the profile, and the sources of their required ports.

    Args:
        components: the components of one robot; each instance has separate values.
        profile: the settings. A parameter that they omit has its default, or the value that the program has set.

    Raises:
        UnknownNameError: a component, parameter or required port of the profile does not exist.
        SchemaError: a value has another type, is out of range, or may not be set by a profile. The error is also raised
            if a relation between parameters is violated, or a parameter has no value. The message has the place and the
            range.
    """
    by_name = {component.name: component for component in components}
    settings = {} if profile is None else profile.components
    for name in settings:
        if name not in by_name:
            raise unknown_in(profile, "components", "component", name, by_name)
    values = {name: _compute_values(component, profile) for name, component in by_name.items()}
    for name, component in by_name.items():
        component.parameter_values.replace(values[name])
    if profile is not None:
        try:
            choose_sources(by_name.values(), profile.wiring)
        except UnknownNameError as error:
            error.place = profile.place(("wiring", str(error.found)))
            raise


def _compute_values(component: Component, profile: Profile | None) -> dict[str, Value]:
    settings = {} if profile is None else profile.components.get(component.name, {})
    for parameter, value in settings.items():
        try:
            declared = known(component.name, parameter, component.parameters.declared)
            declared.range.check(f"{component.name}.{parameter}", value)
            refuse_change(f"{component.name}.{parameter}", "profile", declared.changed_by)
        except InputError as error:
            error.place = None if profile is None else profile.place(("components", component.name, parameter))
            raise
    try:
        return component.parameter_values.after(settings)
    except InputError as error:
        error.place = None if profile is None else profile.place(("components", component.name))
        raise
