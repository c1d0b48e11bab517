"""Ports and modes of components, as plots use them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

from dsc.components.checks import ARGUMENT_KINDS, LIBRARY
from dsc.components.value_conditions import WATCH
from dsc.components.value_vocabulary import SILENT
from dsc.model.actions import ExternalAction, Internal, Switch, Trigger, Wire
from dsc.sensing.condition_parts import value_names
from knowledge_base.errors import InputError
from knowledge_base.language.syntax.expression import Atom, Call, Comparison, Constant, Expression, Term
from knowledge_base.language.syntax.rewriting import inside
from knowledge_base.language.syntax.text import parse_condition

_LISTS = frozenset(name for name, check in LIBRARY.items() if ARGUMENT_KINDS.get(check) == "list")
"""Checks whose values are lists of numbers."""
_Form = Expression | Term
_KINDS = {bool: "boolean", int: "number", float: "number", str: "text"}


@dataclass(slots=True)
class PortUse:
    """Ports and modes of a component.

    Attributes:
        modes: the modes to which plots switch the component.
        pushes: for each value of each push port, two values, one on each side of a bound in a condition.
        streams: the required ports with the provider in a plot; without a port, the provider is a component.
    """

    modes: list[str] = field(default_factory=list)
    pushes: dict[str, dict[str, tuple[Any, Any]]] = field(default_factory=dict)
    streams: dict[str, str] = field(default_factory=dict)


def is_watch(action: Trigger) -> bool:
    """Return whether an action watches a condition on values of components."""
    return action.trigger.endswith((f".{WATCH}", ".watch_truth"))


def port_uses(action: ExternalAction | Internal) -> Iterator[tuple[str, PortUse]]:
    """Yield the components whose ports or modes an action uses, with this use."""
    match action:
        case Switch(switch=component, to=mode):
            yield component, PortUse(modes=[mode] if mode not in {"neutral", "init", "shutdown"} else [])
        case Wire(wire=name, to=provider):
            component, _, port = name.partition(".")
            source = str(provider.value) if isinstance(provider, Constant) else ""
            other, _, given = source.partition(".")
            yield component, PortUse(streams={port: source})
            if other:
                yield other, PortUse(pushes={given or port: {}})
        case Trigger() if is_watch(action):
            yield from _find_watched(action)


def add_use(known: PortUse, more: PortUse) -> None:
    """Add a use to a known one; the first value of each name stays."""
    known.streams = {**more.streams, **known.streams}
    known.modes += [mode for mode in more.modes if mode not in known.modes]
    for port, values in more.pushes.items():
        known.pushes[port] = {**values, **known.pushes.get(port, {})}


def _find_watched(action: Trigger) -> Iterator[tuple[str, PortUse]]:
    """Yield the push ports in a condition that is written in the plot."""
    text = action.arguments.get("condition")
    try:
        condition = parse_condition(str(text.value)) if isinstance(text, Constant) else None
    except InputError:
        return  # `dsc check` names the mistake
    if condition is None:
        return
    component, _, skill = action.trigger.partition(".")
    own = f"{component}." if skill == WATCH else ""
    for form in inside(condition):
        if isinstance(form, Atom) and form.predicate == SILENT and form.args and isinstance(form.args[0], Constant):
            name, _, port = f"{own}{form.args[0].value}".partition(".")
            yield name, PortUse(pushes={port: {}})
        elif isinstance(form, Comparison | Atom):
            names = [one for one in value_names(form) if f"{own}{one.value}".count(".") == 2]
            for one in names:
                name, port, value = f"{own}{one.value}".split(".")
                yield name, PortUse(pushes={port: {value: _samples(form, one)}})


def _samples(form: _Form, name: Constant) -> tuple[Any, Any]:
    """Return a value on each side of the constant with which a form compares a value."""
    sides = (form.left, form.right) if isinstance(form, Comparison) else ()
    names = [*value_names(form)]
    constants = [one for one in inside(form) if isinstance(one, Constant) and one not in names]
    bound = next((one.value for one in (*(side for side in sides if side in constants), *constants)), 0)
    if isinstance(bound, bool):
        return (bound, not bound)
    if not isinstance(bound, int | float):
        return (bound, f"not {bound}")
    in_list = any(isinstance(one, Call) and one.function in _LISTS and name in inside(one) for one in inside(form))
    return ([bound - 1, 0, 0], [bound + 1, 0, 0]) if in_list else (bound - 1, bound + 1)


def type_of(value: object) -> str | None:
    """Return the type of plots for a constant or sample; `None` for a value without one."""
    return "list of number" if isinstance(value, list) else _KINDS.get(type(value))
