"""Application of a settings profile to components and plots, after validation of all its values."""

from __future__ import annotations

from collections.abc import Iterable

from dsc.components.component import Component
from dsc.components.declarations import known
from dsc.model.plot import ActionPlot
from dsc.model.ranges import refuse_change
from dsc.text.profiles import Profile
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.facts import Value


def configure(components: Iterable[Component], profile: Profile | None = None) -> None:
    """Set the components' parameters to the values of the profile.

    Args:
        components: the components of one robot; each instance has separate values.
        profile: the settings. A parameter that they omit has its default, or the value that the program has set.

    Raises:
        UnknownNameError: a component or parameter of the profile does not exist.
        SchemaError: a value has another type, is out of range, or may not be set by a profile. The error is also raised
            if a relation between parameters is violated, or a parameter has no value. The message has the place and the
            range.
    """
    by_name = {component.name: component for component in components}
    settings = {} if profile is None else profile.components
    for name in settings:
        if name not in by_name:
            raise _unknown(profile, "components", "component", name, by_name)
    values = {name: _configured(component, profile) for name, component in by_name.items()}
    for name, component in by_name.items():
        component.configuration.replace(values[name])


def adapted(plots: Iterable[ActionPlot], profile: Profile | None = None) -> tuple[ActionPlot, ...]:
    """Return the plots with the profile's values as defaults of their parameters.

    Raises:
        UnknownNameError: a plot or parameter of the profile does not exist.
        InputError: a value has another type than the parameter or is out of its range, or a profile may not change it.
    """
    plots = tuple(plots)
    if profile is None or not profile.plots:
        return plots
    names = [plot.name for plot in plots]
    for name in profile.plots:
        if name not in names:
            raise _unknown(profile, "plots", "plot", name, names)
    return tuple(_adapted(plot, profile) for plot in plots)


def _configured(component: Component, profile: Profile | None) -> dict[str, Value]:
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
        return component.configuration.after(settings)
    except InputError as error:
        error.place = None if profile is None else profile.place(("components", component.name))
        raise


def _adapted(plot: ActionPlot, profile: Profile) -> ActionPlot:
    for name, value in profile.plots.get(plot.name, {}).items():
        try:
            plot = plot.with_default(name, value, "profile")
        except InputError as error:
            error.place = profile.place(("plots", plot.name, name))
            raise
    return plot


def _unknown(profile: Profile | None, group: str, kind: str, name: str, valid: Iterable[str]) -> UnknownNameError:
    error = UnknownNameError(f"there is no {kind} '{name}'", found=name, valid=valid)
    error.place = None if profile is None else profile.place((group, name))
    return error
