"""Declarations of parameters: type, range, roles, and dependencies between parameters (S1.11)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from typing import Literal, get_args

from dsc.errors import SkillError
from dsc.model.ranges import Range, Who, written
from knowledge_base.errors import InputError, SchemaError, UnknownNameError
from knowledge_base.facts import Value
from knowledge_base.language.evaluation.evaluator import evaluate_term, holds
from knowledge_base.language.syntax.expression import free_variables
from knowledge_base.language.syntax.text import parse_condition, parse_term
from knowledge_base.world.overlay import Overlay
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState

Type = Literal["number", "text", "boolean"]
_term = cache(parse_term)
_NOTHING = Overlay(WorldState(Schema()))


@dataclass(frozen=True, slots=True)
class Parameter:
    """The declaration of one parameter by the component's builder.

    Attributes:
        type: `number`, `text` (any word) or `boolean`.
        whole: whether the numbers are integers.
        default: the value until another value is set; without a default, a profile must set the value.
        least: the smallest permitted number.
        most: the largest permitted number.
        among: the permitted values; empty permits any value.
        changed_by: the role that may change the value: `nobody`; a `profile`, before a run; an `operator`, during a
            run; the `rules` of plots, after a failure; `plots` anywhere. Each role includes the roles listed before it.
        follows: instead of a default, a term over other parameters, e.g. `(* 0.5 ?cycle)`.
        depends_on: parameters that the value depends on, besides those in `follows`. A new value of such a parameter
            resets this parameter to its default, to the value of its term, or to no value.
    """

    type: Type
    whole: bool = False
    default: Value | None = None
    least: float | None = None
    most: float | None = None
    among: tuple[Value, ...] = ()
    changed_by: Who = "plots"
    follows: str | None = None
    depends_on: tuple[str, ...] = ()

    @property
    def reasons(self) -> frozenset[str]:
        """Names of the parameters that this one's value depends on."""
        return frozenset(self.depends_on) | (free_variables(_term(self.follows)) if self.follows else frozenset())

    def unset(self, values: Mapping[str, Value]) -> Value | None:
        """Return the value that applies while no role has set one, computed from the `values` of other parameters.

        The result is `None` if the parameter has no value then.
        """
        if self.follows is None:
            return self.default
        term = _term(self.follows)
        if not all(name in values for name in free_variables(term)):
            return None
        found = evaluate_term(term, _NOTHING, values)
        return found if isinstance(found, str | int | float | bool) else None

    @property
    def range(self) -> Range:
        """Permitted values of the parameter."""
        return Range(self.type, self.least, self.most, self.among, self.whole)


class NoValueError(SchemaError, SkillError):
    """A declared parameter has no value; a profile or an operator may set it."""


def missing(component: str, name: str, declared: Mapping[str, Parameter]) -> NoValueError:
    """Return the error for a declared parameter without a value; the message has the reason."""
    reasons = ", ".join(f"'{reason}'" for reason in sorted(declared[name].reasons))
    reset = f", and a new value of {reasons} resets it" if reasons else ""
    message = f"'{component}.{name}' has no value: its builder leaves it to a profile{reset}"
    return NoValueError(message, found=name)


def known(component: str, name: str, declared: Mapping[str, Parameter]) -> Parameter:
    """Return the declaration of a parameter; raise `UnknownNameError` if it is missing."""
    if name not in declared:
        message = f"component '{component}' has no parameter '{name}'"
        raise UnknownNameError(message, found=name, valid=declared)
    return declared[name]


def changed(
    component: str, declared: Mapping[str, Parameter], values: Mapping[str, Value], settings: Mapping[str, Value | None]
) -> dict[str, Value]:
    """Return the values of all parameters after new settings; the setting `None` resets a parameter.

    A new setting resets the parameters that depend on it, unless they have a new setting too (S1.11). This applies also
    if the setting equals the former value. So the last settings, in order, determine all values, also after a restart.

    Raises:
        InputError: a value violates its declaration, also a value that is computed by `follows`.
    """
    found, others = dict(values), set[str]()
    reasons = {name: parameter.reasons for name, parameter in declared.items()}
    for name in TopologicalSorter(reasons).static_order():
        parameter, setting = declared[name], settings.get(name)
        if name not in settings and others.isdisjoint(reasons[name]):
            continue
        value = parameter.unset(found) if setting is None else setting
        if value is None:
            found.pop(name, None)
        else:
            found[name] = parameter.range.check(f"{component}.{name}", value)
        others.add(name)
    return found


def violated(relation: str, values: Mapping[str, Value]) -> str | None:
    """Return the values that violate a relation, as text; `None` if it holds or a parameter has no value."""
    condition = parse_condition(relation)
    read = sorted(free_variables(condition))
    if not all(name in values for name in read) or holds(condition, _NOTHING, values):
        return None
    return ", ".join(f"{name} is {written(values[name])}" for name in read)


def check_declarations(owner: str, declared: Mapping[str, Parameter], relations: Iterable[str]) -> None:
    """Validate the declarations of a class of parameters.

    Args:
        owner: the name of the class, for messages.
        declared: the parameters by name.
        relations: conditions between the parameters.

    Raises:
        InputError: a role or name is unknown, a range is empty, or a default is outside its range. The error is also
            raised if a relation is not a condition. The message has the parameter, the value found and the nearest
            name.
    """
    for name, parameter in declared.items():
        _check_parameter(f"{owner}.{name}", parameter)
        _check_dependencies(f"{owner}.{name}", parameter, declared)
    try:
        changed(owner, declared, {}, dict.fromkeys(declared))
    except CycleError as error:
        cycle = ", ".join(f"'{name}'" for name in error.args[1])
        raise SchemaError(f"parameters of {owner} depend on each other in a cycle: {cycle}") from error
    _check_relations(owner, declared, relations)


def _check_parameter(name: str, parameter: Parameter) -> None:
    if parameter.changed_by not in get_args(Who):
        message = f"parameter '{name}' is changed by '{parameter.changed_by}', which is not a role"
        raise UnknownNameError(message, found=str(parameter.changed_by), valid=get_args(Who))
    for problem in parameter.range.problems():
        raise SchemaError(f"parameter '{name}': {problem}")
    if parameter.default is not None and parameter.follows is not None:
        raise SchemaError(f"parameter '{name}' has a default and follows from others; only one of both can be")
    if parameter.default is not None:
        try:
            parameter.range.check(name, parameter.default)
        except InputError as error:
            found = written(parameter.default)
            raise SchemaError(
                f"the default of parameter '{name}' is {found}, but it is {parameter.range}",
                found=found, valid=map(str, parameter.among),
            ) from error  # fmt: skip


def _check_dependencies(name: str, parameter: Parameter, declared: Mapping[str, Parameter]) -> None:
    if isinstance(parameter.depends_on, str):
        raise SchemaError(f"`depends_on` of parameter '{name}' is a tuple of names, not one text")
    try:
        reasons = parameter.reasons
    except InputError as error:
        raise SchemaError(f"`follows` of parameter '{name}', {parameter.follows}, is not a term: {error}") from error
    for reason in sorted(reasons - set(declared)):
        raise UnknownNameError(
            f"parameter '{name}' depends on '{reason}', which is not declared", found=reason, valid=declared
        )


def _check_relations(owner: str, declared: Mapping[str, Parameter], relations: Iterable[str]) -> None:
    if isinstance(relations, str):
        raise SchemaError(f"`relations` of {owner} is a tuple of conditions, not one text")
    for text in relations:
        try:
            condition = parse_condition(text)
        except InputError as error:
            raise SchemaError(f"the relation {text} of {owner} is not a condition: {error}") from error
        for name in sorted(free_variables(condition) - set(declared)):
            message = f"the relation {text} of {owner} reads '?{name}', which it does not declare"
            raise UnknownNameError(message, found=name, valid=declared)
