"""Deployment check: plots configure and switch only deployed components."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from dsc.components.parameters import Parameter, known
from dsc.errors import Finding
from dsc.model.actions import Configure, ExternalAction, Internal, Trigger, component_of, flat
from dsc.model.plot import ActionPlot, Path
from dsc.model.ranges import Who, refuse_change
from dsc.model.states import State
from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.language.syntax.expression import Constant

Components = Collection[str] | Mapping[str, Mapping[str, Parameter]]
"""The names of components, or their declared parameters as well; names alone allow any parameter."""


def check_components(plot: ActionPlot, components: Components) -> Iterator[Finding]:
    """Yield findings about `set`, `send` and `switch` actions to missing components, or with undeclared parameters."""
    for action, path, who in _actions(plot):
        name = None if isinstance(action, Trigger) else component_of(action)  # triggers are checked with the skills
        if name is not None and name not in components:
            message = f"there is no component '{name}'"
            error = UnknownNameError(message, place=plot.place(path), found=name, valid=components)
            yield Finding(error, "known component")
        elif isinstance(action, Configure) and isinstance(components, Mapping):
            yield from _setting(plot, action, path, who, components)


def addressed_by(plot: ActionPlot) -> frozenset[str]:
    """Return the components that a plot itself uses; a plot that uses none is abstract, else primitive (S0.9)."""
    named = (component_of(one) for one in flat(action for action, _, _ in _actions(plot)))
    return frozenset(name for name in named if name is not None)


def _setting(
    plot: ActionPlot, action: Configure, path: Path, who: Who, components: Mapping[str, Mapping[str, Parameter]]
) -> Iterator[Finding]:
    component, _, parameter = action.set.partition(".")
    if not components[component]:
        return
    try:
        declared = known(component, parameter, components[component])
        if isinstance(action.to, Constant):
            declared.range.check(action.set, action.to.value)
    except InputError as error:
        error.place = plot.place((*path, "to" if not isinstance(error, UnknownNameError) else "set"))
        yield Finding(error, "component parameter")
        return
    try:
        refuse_change(action.set, who, declared.changed_by)
    except SchemaError as refused:
        refused.place = plot.place((*path, "set"))
        yield Finding(refused, "component parameter", "say it in a profile, or let `changed_by` allow it")


def _actions(plot: ActionPlot) -> Iterator[tuple[ExternalAction | Internal, Path, Who]]:
    for _, state, path in plot.walk():
        for key, actions in state.blocks() if isinstance(state, State) else ():
            yield from ((action, (*path, key, position), "plots") for position, action in enumerate(actions))
    for group, reactions in (("rules", [r.do for r in plot.rules]), ("handlers", [h.do for h in plot.handlers])):
        for number, do in enumerate(reactions):
            here = (group, number, "do", "command")
            yield from ((command, (*here, position), "rules") for position, command in enumerate(do.command))
