"""Services of components: what a provided port offers and what a required port wants, compared by pattern and types.

A required port is met by service and not by name (S0.17): the names of components and ports play no part.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from dsc.data_types import data_type
from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.user_objects import shown

Values = Mapping[str, str | None]
"""Names of values with types, see `dsc.data_types`; `None` accepts any plain data."""
Pattern = Literal["push", "query", "event", "send", "parameters", "modes"]
"""Communication pattern of a service, see Table 1 of the SmartSoft paper (S1.1)."""
LABELS: Mapping[Pattern, str] = {
    "push": "push port", "query": "query", "event": "event", "send": "message", "parameters": "parameters",
    "modes": "modes",
}  # fmt: skip
_EXAMPLE = "{'metres': 'number'}"


@dataclass(frozen=True, slots=True)
class Service:
    """A service: its pattern, the values that a client passes, and the values that a client receives.

    Attributes:
        pattern: the communication pattern.
        takes: the arguments of a query, an event or a message; the parameters of a component; the modes as names.
        gives: the pushed values, or the attributes of an answer or of an event.
        defaults: the arguments that a client may omit.
    """

    pattern: Pattern
    takes: Values
    gives: Values
    defaults: frozenset[str] = frozenset()

    def __str__(self) -> str:
        """Return the service as text, as `query (watts: number) -> (hours: number)`."""
        if self.pattern == "modes":
            return f"modes {', '.join(self.takes)}"
        takes = f" ({_list_types(self.takes)})" if self.takes or self.pattern in {"query", "event", "send"} else ""
        gives = f" -> ({_list_types(self.gives)})" if self.pattern in {"push", "query", "event"} else ""
        return LABELS[self.pattern] + takes + gives


def require_fitting(name: str, wanted: Service, offered: Service) -> None:
    """Raise an error unless an offered service, whose name is for messages, is as wanted.

    Raises:
        UnknownNameError: the service lacks a value or an argument.
        SchemaError: the pattern or a type differs, or the service needs an argument that is not wanted.
    """
    if wanted.pattern != offered.pattern:
        raise SchemaError(f"'{name}' is a {LABELS[offered.pattern]}, and a {LABELS[wanted.pattern]} is wanted")
    verb = {"push": "pushes", "query": "answers", "event": "reports"}.get(wanted.pattern, "has")
    for value, kind in wanted.gives.items():
        if value not in offered.gives:
            raise UnknownNameError(f"'{name}' {verb} no '{value}'", found=value, valid=offered.gives)
        if not _accepts(kind, offered.gives[value]):
            found = _type_text(offered.gives[value])
            raise SchemaError(f"'{name}' {verb} '{value}' as {found}, and {kind} is wanted", found=value)
    for argument, kind in wanted.takes.items():
        if argument not in offered.takes:
            what = {"modes": "mode", "parameters": "parameter"}.get(wanted.pattern, "argument")
            raise UnknownNameError(f"'{name}' has no {what} '{argument}'", found=argument, valid=offered.takes)
        if not _accepts(offered.takes[argument], kind):
            found = _type_text(offered.takes[argument])
            raise SchemaError(
                f"'{name}' takes '{argument}' as {found}, and {_type_text(kind)} is given", found=argument
            )
    if wanted.pattern in {"query", "event", "send"}:
        for argument in offered.takes:
            if argument not in wanted.takes and argument not in offered.defaults:
                raise SchemaError(f"'{name}' needs its argument '{argument}'", found=argument)


def fits(name: str, wanted: Service, offered: Service) -> bool:
    """Return whether an offered service is as wanted, see `require_fitting`."""
    try:
        require_fitting(name, wanted, offered)
    except InputError:
        return False
    return True


def named_service(
    port: str, wanted: Service, named: str, offers: Mapping[str, Iterable[tuple[str, Service]]]
) -> tuple[str, Service]:
    """Return the provided port, with its service, that a wire names.

    Args:
        port: the required port, for messages.
        wanted: its service.
        named: the provided port as `component.port`, or a component whose only fitting port is meant.
        offers: the provided ports of all components, with their services.

    Raises:
        UnknownNameError: there is no such component or port.
        SchemaError: the service does not fit.
        InputError: several ports of the component fit.
    """
    component, _, name = named.partition(".")
    label = LABELS[wanted.pattern]
    if component not in offers:
        message = f"port '{port}' is wired to '{named}', and there is no such component"
        raise UnknownNameError(message, found=component, valid=offers)
    same = {one: service for one, service in offers[component] if service.pattern == wanted.pattern}
    if not name:
        fitting = [one for one, service in same.items() if fits(one, wanted, service)]
        if len(fitting) > 1:
            raise ambiguous(port, [f"{component}.{one}" for one in fitting])
        if not fitting and len(same) != 1:
            message = f"component '{component}' has no {label} that fits '{port}', which wants a {wanted}"
            raise SchemaError(message, found=named)
        name = (fitting or [*same])[0]
    if name not in same:
        raise UnknownNameError(f"component '{component}' has no {label} '{name}'", found=name, valid=same)
    require_fitting(f"{component}.{name}" if name else component, wanted, same[name])
    return name, same[name]


def ambiguous(port: str, fitting: Sequence[str]) -> InputError:
    """Return the error that several provided ports fit a required one."""
    wire = f'wiring={{"{port}": "{fitting[0]}"}}'
    message = (
        f"several services fit port '{port}': {', '.join(fitting)}; choose one for the robot, e.g. Bundle({wire}), or"
        " under `wiring` in a profile, which a run then names"
    )
    return InputError(message, found=port)


def declared_values(values: object, what: str) -> Values:
    """Return names with types in their usual form; raise `InputError` for other data, which `what` describes."""
    if not isinstance(values, Mapping) or not all(
        isinstance(name, str) and name.isidentifier() and (kind is None or isinstance(kind, str))
        for name, kind in values.items()
    ):
        raise InputError(f"the values of {what} are names with types, as in {_EXAMPLE}, not {shown(values)}")
    return {name: None if kind is None else str(data_type(kind)) for name, kind in values.items()}


def _accepts(wanted: str | None, given: str | None) -> bool:
    """Return whether a value of the given type is also of the wanted one."""
    return wanted is None or wanted == given or (wanted == "number" and given == "integer")


def _type_text(kind: str | None) -> str:
    return kind or "plain data of any type"


def _list_types(values: Values) -> str:
    parts: Iterable[str] = (name if kind is None else f"{name}: {kind}" for name, kind in values.items())
    return ", ".join(parts)
