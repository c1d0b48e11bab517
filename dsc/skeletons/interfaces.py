"""Interfaces of components, derived from the plots that use them: skills with parameters and outcomes, and messages."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

from dsc.events import EXECUTIVES, RESERVED
from dsc.model.actions import Emit, Send, Trigger, component_of
from dsc.model.plot import ActionPlot
from dsc.model.states import DynamicState, State, SubmachineState
from dsc.model.transitions import Transition
from knowledge_base.language.syntax.expression import Constant, Variable

Types = dict[str, str | None]
"""Types of plots by name; `None` where the plots leave the type open."""
_EVENT = "event."
_ATTRIBUTE = re.compile(r"\?event\.([\w\-]+)")


@dataclass(slots=True)
class SkillUse:
    """A skill as plots use it: the types of its parameters, and of the attributes of each outcome."""

    parameters: Types = field(default_factory=dict)
    outcomes: dict[str, Types] = field(default_factory=dict)


@dataclass(slots=True)
class ComponentUse:
    """A component as plots use it: its skills, and the types of the parameters of its messages."""

    skills: dict[str, SkillUse] = field(default_factory=dict)
    messages: dict[str, Types] = field(default_factory=dict)


def find_components(plots: Iterable[ActionPlot]) -> dict[str, ComponentUse]:
    """Return the components that plots use, by name, in order of their first use.

    The outcomes of a skill are events of the state that triggers it, and of the states around. Events that something
    else in the plot fires are not among them. Their order equals the order in the text.
    """
    plots = list(plots)
    by_name = {plot.name: plot for plot in plots}
    found: dict[str, ComponentUse] = {}
    for plot in plots:
        for action in plot.actions():
            if (reached := component_of(action)) is not None:
                found.setdefault(reached, ComponentUse())
            if isinstance(action, Send):
                component, _, name = action.send.partition(".")
                messages = found.setdefault(component, ComponentUse()).messages
                _merge(messages.setdefault(name, {}), _argument_types(plot, action.arguments))
        renamed = {chart for trigger, _ in _triggers(plot) for chart in trigger.names.values()}
        for trigger, around in _triggers(plot):
            component, _, name = trigger.trigger.partition(".")
            skill = found.setdefault(component, ComponentUse()).skills.setdefault(name, SkillUse())
            _merge(skill.parameters, _argument_types(plot, trigger.arguments))
            names = {chart: own for own, chart in trigger.names.items()}
            for event, types in _outcomes(plot, around, by_name).items():
                if event in renamed and event not in names:
                    continue  # the outcome of another skill, by its `as`
                _merge(skill.outcomes.setdefault(names.get(event, event), {}), types)
    return found


def _triggers(plot: ActionPlot) -> Iterator[tuple[Trigger, list[State]]]:
    """Yield each trigger with the states around it, the innermost first."""
    states = [(path, state) for _, state, path in plot.walk() if isinstance(state, State)]
    for path, state in states:
        around = [one for above, one in reversed(states) if path[: len(above)] == above]
        for action in (*state.entry, *state.exit, *state.on_break):
            if isinstance(action, Trigger):
                yield action, around


def _outcomes(plot: ActionPlot, around: list[State], plots: Mapping[str, ActionPlot]) -> dict[str, Types]:
    """Return the events that a skill in a state fires, with the types of the attributes that transitions read."""
    others = {*RESERVED, *EXECUTIVES, *plot.receives, *_own_events(plot)}
    for state in around:
        others |= {event for name in _content(state) if name in plots for event in plots[name].emits}
    found: dict[str, Types] = {}
    for state in around:
        for event, ways in state.on.items():
            if event not in others:
                for way in ways:
                    _merge(found.setdefault(event, {}), _attributes(plot, way))
    return found


def _own_events(plot: ActionPlot) -> Iterator[str]:
    """Yield the events that the transitions of a plot fire for the plot itself."""
    for _, state, _ in plot.walk():
        for _, _, way in getattr(state, "placed_transitions", tuple)():
            yield from (one.emit for one in way.effect if isinstance(one, Emit) and one.emit not in plot.emits)


def _content(state: State) -> tuple[str, ...]:
    """Return the names of the plots that a state may contain."""
    if isinstance(state, SubmachineState):
        return (state.use,)
    return state.candidates if isinstance(state, DynamicState) else ()


def _attributes(plot: ActionPlot, way: Transition) -> Types:
    """Return the attributes of the event that a transition reads, with the types of the places that receive them."""
    types: Types = dict.fromkeys(_ATTRIBUTE.findall(way.model_dump_json(by_alias=True)))
    declared: Types = {name: one.type for name, one in (*plot.all_variables.items(), *plot.outputs.items())}
    emitted: Mapping[str, Any] = (plot.emits.get(way.emit) if way.emit else None) or {}
    for into, values in ((declared, way.assign), (emitted, way.arguments)):
        for name, term in values.items():
            if isinstance(term, Variable) and term.name.startswith(_EVENT):
                _merge(types, {term.name.removeprefix(_EVENT): into.get(name)})
    return types


def _argument_types(plot: ActionPlot, values: Mapping[str, Any]) -> Types:
    """Return the types of the values for parameters."""
    declared = {**plot.parameters, **plot.all_variables, **plot.outputs}
    types: Types = {}
    for name, term in values.items():
        types[name] = None
        if isinstance(term, Variable) and term.name in declared:
            types[name] = declared[term.name].type
        elif isinstance(term, Constant):
            types[name] = _type_of(term.value)
    return types


def _type_of(value: object) -> str | None:
    kinds = {bool: "boolean", int: "number", float: "number", str: "text"}
    return kinds.get(type(value))


def _merge(into: Types, more: Mapping[str, str | None]) -> None:
    """Add types; a name with two types has none."""
    for name, kind in more.items():
        known = into.setdefault(name, kind)
        if known is None or kind is None:
            into[name] = known or kind
        elif known != kind:
            into[name] = None
