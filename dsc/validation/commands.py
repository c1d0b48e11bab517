"""Checks of commands to components: they name parameters, modes, messages and ports that exist."""

from __future__ import annotations

from collections.abc import Iterator

from dsc.components.declarations import known
from dsc.components.interface import Interface
from dsc.components.services import named_service
from dsc.errors import Finding
from dsc.model.actions import Configure, ExternalAction, Internal, Send, Switch, Trigger, Unwire, Wire, component_of
from dsc.model.plot import Path
from dsc.model.ranges import Who, refuse_change
from dsc.validation.subject import ALLOW, Subject
from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.language.syntax.expression import Constant


def check_commands(subject: Subject) -> Iterator[Finding]:
    """Yield findings about commands to unknown components, or with unknown names of parameters, modes or ports."""
    yield from _wires_outside_entry(subject)
    components = subject.components
    for path, action, who in subject.actions() if components is not None else ():
        name = None if isinstance(action, Trigger) else component_of(action)  # the check of skills covers triggers
        if name is not None and name not in (components or ()):
            message = f"there is no component '{name}'"
            yield subject.finding(path, "known-component", message, found=name, valid=components)
        elif name is not None and name in subject.interfaces:
            yield from _command(subject, action, path, who, subject.interfaces[name])


def _wires_outside_entry(subject: Subject) -> Iterator[Finding]:
    """Yield a finding for each wire in `exit` or `on_break`, which no later exit would end."""
    for path, action, _ in subject.actions():
        if isinstance(action, Wire | Unwire) and path[-2] in {"exit", "on_break"}:
            key = "wire" if isinstance(action, Wire) else "unwire"
            message = f"`{key}` stands in `entry`: the exit of the state restores the wire of before"
            yield subject.finding(path, "component-wire", message)


def _command(
    subject: Subject, action: ExternalAction | Internal, path: Path, who: Who, interface: Interface
) -> Iterator[Finding]:
    match action:
        case Configure() if interface.parameters:
            yield from _setting(subject, action, path, who, interface)
        case Switch(switch=component, to=mode):
            try:
                interface.require_mode(component, mode)
            except UnknownNameError as error:
                yield subject.caught(error, (*path, "to"), "component-mode")
        case Send(send=port):
            try:
                interface.message(*port.split("."))
            except UnknownNameError as error:
                fix = interface.remedy("takes", *port.split("."))
                yield subject.caught(error, (*path, "send"), "component-message", fix)
        case Unwire(unwire=port):
            try:
                interface.require_port(*port.split("."))
            except UnknownNameError as error:
                yield subject.caught(error, (*path, "unwire"), "component-wire")
        case Wire():
            yield from _wire(subject, action, path, interface)
        case _:
            pass


def _wire(subject: Subject, action: Wire, path: Path, interface: Interface) -> Iterator[Finding]:
    component, _, port = action.wire.partition(".")
    try:
        wanted = interface.require_port(component, port)
    except UnknownNameError as error:
        yield subject.caught(error, (*path, "wire"), "component-wire")
        return
    if isinstance(action.to, Constant):
        skills = (subject.skills or {}).values()
        offers = {
            name: one.services([skill for skill in skills if skill.component == name])
            for name, one in subject.interfaces.items()
        }
        try:
            named_service(action.wire, wanted, str(action.to.value), offers)
        except InputError as error:
            yield subject.caught(error, (*path, "to"), "component-wire")


def _setting(subject: Subject, action: Configure, path: Path, who: Who, interface: Interface) -> Iterator[Finding]:
    component, _, parameter = action.set.partition(".")
    try:
        declared = known(component, parameter, interface.parameters)
        if isinstance(action.to, Constant):
            declared.range.check(action.set, action.to.value)
    except InputError as error:
        key = "set" if isinstance(error, UnknownNameError) else "to"
        yield subject.caught(error, (*path, key), "component-parameter")
        return
    try:
        refuse_change(action.set, who, declared.changed_by)
    except SchemaError as refused:
        yield subject.caught(refused, (*path, "set"), "component-parameter", ALLOW)
