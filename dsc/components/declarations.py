"""What the builder of a component declares of its parameters, checked when the class is made (S1.11)."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from graphlib import CycleError
from typing import get_args

from dsc.components.parameters import Parameter, Type, unsaid
from dsc.model.ranges import Who, written
from knowledge_base.errors import InputError, Place, SchemaError, UnknownNameError
from knowledge_base.language.expression import free_variables
from knowledge_base.language.parser import parse_condition


def check_declarations(
    component: str, declares: Mapping[str, Parameter], relations: Iterable[str], module: str = ""
) -> None:
    """Refuse what cannot be meant.

    Args:
        component: its name, for messages.
        declares: the parameters by name.
        relations: conditions between them.
        module: where the class is written, for messages.

    Raises:
        InputError: a type, `changed_by` or name in a relation is unknown, a range has no values, a default is not in
            it, or a relation is no condition. The message has the file, the parameter, what was found and the nearest
            name.
    """
    try:
        for name, parameter in declares.items():
            _check_parameter(f"{component}.{name}", parameter)
        _check_dependencies(component, declares)
        _check_relations(component, declares, relations)
    except InputError as error:
        file = getattr(sys.modules.get(module), "__file__", None)
        error.place = Place(file) if file else None
        raise


def _check_parameter(name: str, parameter: Parameter) -> None:
    if parameter.type not in get_args(Type):
        message = f"the type of parameter '{name}' is '{parameter.type}', which is none"
        raise UnknownNameError(message, found=str(parameter.type), valid=get_args(Type))
    if parameter.changed_by not in get_args(Who):
        message = f"parameter '{name}' is changed by '{parameter.changed_by}', which is nobody's role"
        raise UnknownNameError(message, found=str(parameter.changed_by), valid=get_args(Who))
    for problem in parameter.range.problems():
        raise SchemaError(f"parameter '{name}': {problem}")
    if parameter.default is not None and parameter.follows is not None:
        raise SchemaError(f"parameter '{name}' has a default and follows from others; only one of both can be")
    if parameter.default is not None:
        try:
            parameter.check(name, parameter.default)
        except InputError as error:
            found = written(parameter.default)
            raise SchemaError(
                f"the default of parameter '{name}' is {found}, but it is {parameter.range}",
                found=found, valid=map(str, parameter.among),
            ) from error  # fmt: skip


def _check_dependencies(component: str, declares: Mapping[str, Parameter]) -> None:
    for name, parameter in declares.items():
        full = f"{component}.{name}"
        if isinstance(parameter.depends_on, str):
            raise SchemaError(f"`depends_on` of parameter '{full}' is a tuple of names, not one text")
        try:
            reasons = parameter.reasons
        except InputError as error:
            raise SchemaError(f"what parameter '{full}' follows, {parameter.follows}, is no term: {error}") from error
        for reason in sorted(reasons - set(declares)):
            message = f"parameter '{full}' relies on '{reason}', which is not declared"
            raise UnknownNameError(message, found=reason, valid=declares)
    try:
        values = unsaid(declares)
    except CycleError as error:
        round_ = ", ".join(f"'{name}'" for name in error.args[1])
        raise SchemaError(f"parameters of component '{component}' rely on each other in a circle: {round_}") from error
    for name, value in values.items():
        declares[name].check(f"{component}.{name}", value)


def _check_relations(component: str, declares: Mapping[str, Parameter], relations: Iterable[str]) -> None:
    if isinstance(relations, str):
        raise SchemaError(f"`relations` of component '{component}' is a tuple of conditions, not one text")
    for text in relations:
        try:
            condition = parse_condition(text)
        except InputError as error:
            raise SchemaError(f"the relation {text} of component '{component}' is no condition: {error}") from error
        for name in sorted(free_variables(condition) - set(declares)):
            message = f"the relation {text} of component '{component}' reads '?{name}', which it does not declare"
            raise UnknownNameError(message, found=name, valid=declares)
