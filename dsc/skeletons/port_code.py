"""Python for ports, parameters and modes of components: declarations, and the simulated values of push ports."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping

from dsc.annotations import type_class
from dsc.data_types import data_type
from dsc.skeletons.interfaces import ComponentUse
from dsc.skeletons.port_uses import PortUse, type_of
from dsc.skeletons.python_types import sample_value

_PARAMETERS = {"number": "float", "integer": "int", "boolean": "bool", "text": "str", "name": "str"}
"""Annotations of parameters of components by the kind of their type."""
_SECONDS = 4
"""Seconds between two changes of a simulated value; each further value changes half as often."""


def parameters_class(component: str, use: ComponentUse) -> str:
    """Return the class of a component's parameters; empty without any, or if a type is open."""
    kinds = {name: None if text is None else data_type(text) for name, text in use.parameters.items()}
    if not kinds or any(kind is None or kind.kind not in _PARAMETERS for kind in kinds.values()):
        return ""
    head = [f"class {_parameters(component)}(Parameters):", f'    """The parameters of `{component}`."""', ""]
    fields = [
        f"    {name}: {_PARAMETERS[kind.kind]} = {literal(sample_value(str(kind)))}"
        for name, kind in kinds.items()
        if kind
    ]
    return "\n".join([*head, *fields])


def declarations(component: str, use: ComponentUse, all_uses: Mapping[str, ComponentUse]) -> Iterator[str]:
    """Yield the lines of a base class that declare parameters, modes and ports."""
    if parameters_class(component, use):
        yield f"    parameters: {_parameters(component)}"
    if use.ports.modes:
        yield f"    modes = ({' '.join(f'{literal(one)},' for one in use.ports.modes)})"
    for port, values in use.ports.pushes.items():
        yield f"    {port} = Push({_types(values)})"
    for port, source in use.ports.streams.items():
        other, _, given = source.partition(".")
        pushes = all_uses[other].ports.pushes if other in all_uses else {}
        given = given or port
        named = f', "{other}.{given}"' if other else ""
        yield f"    {port} = Stream({_types(pushes.get(given, {}))}{named}, optional=True)"


def simulate_values(ports: PortUse) -> list[str]:
    """Return the lines of a class that puts simulated values; empty without values."""
    number, puts = 0, list[str]()
    for port, values in ports.pushes.items():
        given = list[str]()
        for name, (low, high) in values.items():
            given.append(f"{name}=({literal(low)}, {literal(high)})[self.steps // {_SECONDS * 2**number} % 2]")
            number += 1
        puts += [f"        self.{port}.put({', '.join(given)})"] if given else []
    if not puts:
        return []
    head = ["    period, steps = 1.0, 0", "", "    async def step(self) -> None:"]
    return [*head, "        # a real robot puts what its sensors measure", *puts, "        self.steps += 1"]


def _parameters(component: str) -> str:
    return f"{type_class(component)}Parameters"


def _types(values: Mapping[str, tuple[object, object]]) -> str:
    return "{" + ", ".join(f'"{name}": "{type_of(low)}"' for name, (low, _) in values.items()) + "}"


def literal(value: object) -> str:
    """Return plain data as an expression of Python."""
    return json.dumps(value, ensure_ascii=False) if isinstance(value, str) else repr(value)
