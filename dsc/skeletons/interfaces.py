"""Interfaces of components, derived from the plots that use them: skills with outcomes, messages, and ports."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from dsc.components.value_conditions import WATCH_OUTCOMES
from dsc.events import EXECUTIVES, RESERVED
from dsc.model.actions import Configure, Emit, ExternalAction, Internal, Send, Trigger, component_of
from dsc.model.plot import ActionPlot
from dsc.model.states import DynamicState, State, SubmachineState
from dsc.model.transitions import Transition
from dsc.skeletons.guard_values import EVENT, guard_values, values_in
from dsc.skeletons.port_uses import PortUse, add_use, is_watch, port_uses, type_of
from knowledge_base.language.syntax.expression import Constant, Variable

Types = dict[str, str | None]
"""Types of plots by name; `None` where the plots leave the type open."""
_ATTRIBUTE = re.compile(r"\?event\.([\w\-]+)")


@dataclass(slots=True)
class SkillUse:
    """A skill as plots use it.

    Attributes:
        parameters: the types of the parameters.
        outcomes: the types of the attributes of each outcome.
        values: attributes of each outcome with which the guards of the plots are true.
    """

    parameters: Types = field(default_factory=dict)
    outcomes: dict[str, Types] = field(default_factory=dict)
    values: dict[str, dict[str, Any]] = field(default_factory=dict)


@dataclass(slots=True)
class ComponentUse:
    """A component as plots use it.

    Attributes:
        skills: the skills by name.
        messages: the types of the parameters of messages, by message.
        parameters: the types of the component's own parameters that plots set.
        ports: the ports and modes.
    """

    skills: dict[str, SkillUse] = field(default_factory=dict)
    messages: dict[str, Types] = field(default_factory=dict)
    parameters: Types = field(default_factory=dict)
    ports: PortUse = field(default_factory=PortUse)


Known = Mapping[str, Collection[str]]
"""The outcomes of skills that each run has, by `component.skill`."""


def find_components(plots: Iterable[ActionPlot], known: Known = MappingProxyType({})) -> dict[str, ComponentUse]:
    """Return the components that plots use, by name, in order of their first use.

    The outcomes of a skill are events of the state that triggers it, and of the states around. Events that something
    else in the plot fires are not among them, unless `as` names them, or the skill has no other outcome. Their order
    equals the order in the text.
    """
    plots = list(plots)
    by_name = {plot.name: plot for plot in plots}
    found: dict[str, ComponentUse] = {}
    shared: list[tuple[SkillUse, dict[str, Types]]] = []
    for plot in plots:
        for action in plot.actions():
            _add_commands(found, plot, action)
        renamed = {chart for trigger, _ in _triggers(plot) for chart in trigger.names.values()}
        for trigger, around in _triggers(plot):
            if is_watch(trigger) or trigger.trigger in known:
                continue
            component, _, name = trigger.trigger.partition(".")
            skill = found.setdefault(component, ComponentUse()).skills.setdefault(name, SkillUse())
            _merge(skill.parameters, _argument_types(plot, trigger.arguments))
            names = {chart: own for own, chart in trigger.names.items()}
            events = _outcomes(plot, around)
            others = _others(plot, around, by_name, known)
            for event, values in guard_values(around).items():
                skill.values[names.get(event, event)] = values | skill.values.get(names.get(event, event), {})
            for event, types in events.items():
                if event in names or (event not in renamed and event not in others):
                    _merge(skill.outcomes.setdefault(names.get(event, event), {}), types)
            inside = _inside(around, by_name)
            shared.append((skill, {event: types for event, types in events.items() if event in inside}))
    for skill, events in shared:
        skill.outcomes = skill.outcomes or events
    return found


def _add_commands(found: dict[str, ComponentUse], plot: ActionPlot, action: ExternalAction | Internal) -> None:
    """Add what an action other than a skill uses of components."""
    if (reached := component_of(action)) is not None:
        found.setdefault(reached, ComponentUse())
    if isinstance(action, Send):
        component, _, name = action.send.partition(".")
        _merge(found[component].messages.setdefault(name, {}), _argument_types(plot, action.arguments))
    elif isinstance(action, Configure):
        component, _, name = action.set.partition(".")
        _merge(found[component].parameters, _argument_types(plot, {name: action.to}))
    for component, use in port_uses(action):
        add_use(found.setdefault(component, ComponentUse()).ports, use)


def _triggers(plot: ActionPlot) -> Iterator[tuple[Trigger, list[State]]]:
    """Yield each trigger with the states around it, the innermost first."""
    states = [(path, state) for _, state, path in plot.walk() if isinstance(state, State)]
    for path, state in states:
        around = [one for above, one in reversed(states) if path[: len(above)] == above]
        for action in (*state.entry, *state.exit, *state.on_break):
            if isinstance(action, Trigger):
                yield action, around


def _outcomes(plot: ActionPlot, around: list[State]) -> dict[str, Types]:
    """Return the events that states handle, with the types of the attributes that transitions read."""
    found: dict[str, Types] = {}
    for state in around:
        for event, ways in state.on.items():
            if event not in RESERVED:
                for way in ways:
                    _merge(found.setdefault(event, {}), _attributes(plot, way))
    return found


def _others(plot: ActionPlot, around: list[State], plots: Mapping[str, ActionPlot], known: Known) -> set[str]:
    """Return the events in states that come from the plot, from other plots, or from skills that each run has."""
    found = {*EXECUTIVES, *plot.receives, *_own_events(plot), *_inside(around, plots)}
    for state in around:
        for action in state.entry:
            if isinstance(action, Trigger) and (is_watch(action) or action.trigger in known):
                events = WATCH_OUTCOMES if is_watch(action) else known[action.trigger]
                found |= {action.names.get(event, event) for event in events}
    return found


def _inside(around: list[State], plots: Mapping[str, ActionPlot]) -> set[str]:
    """Return the outcomes of the plots that states contain."""
    return {event for state in around for name in _content(state) if name in plots for event in plots[name].emits}


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
    _merge(types, {name: type_of(value) for name, value in values_in(way).items()})
    declared: Types = {name: one.type for name, one in (*plot.all_variables.items(), *plot.outputs.items())}
    emitted: Mapping[str, Any] = (plot.emits.get(way.emit) if way.emit else None) or {}
    for into, values in ((declared, way.assign), (emitted, way.arguments)):
        for name, term in values.items():
            if isinstance(term, Variable) and term.name.startswith(EVENT):
                _merge(types, {term.name.removeprefix(EVENT): into.get(name)})
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
            types[name] = type_of(term.value)
    return types


def _merge(into: Types, more: Mapping[str, str | None]) -> None:
    """Add types; a name with two types has none."""
    for name, kind in more.items():
        known = into.setdefault(name, kind)
        if known is None or kind is None:
            into[name] = known or kind
        elif known != kind:
            into[name] = None
