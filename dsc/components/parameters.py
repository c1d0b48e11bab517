"""Parameters of components: a builder declares a range, an integrator a value, others change it at run time (S1.11)."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from typing import Literal, get_args

from dsc.model.ranges import Range, Who, written
from knowledge_base.errors import InputError, Place, SchemaError, UnknownNameError
from knowledge_base.facts import Value
from knowledge_base.language.evaluation.evaluator import evaluate_term, holds
from knowledge_base.language.syntax.expression import free_variables
from knowledge_base.language.syntax.text import parse_condition, parse_term
from knowledge_base.world.overlay import Overlay
from knowledge_base.world.schema import Schema
from knowledge_base.world.state import WorldState

Type = Literal["number", "text", "boolean"]


@dataclass(frozen=True, slots=True)
class Parameter:
    """What the builder of a component says about one parameter.

    Attributes:
        type: `number`, `text` (any word) or `boolean`.
        default: its value as long as nobody says another; without one, a profile has to.
        least, most: the range of a number.
        among: the values of which it is one; empty means any.
        changed_by: who may change it, each one also what those after it may: `nobody`; a `profile`, before a run; an
            `operator`, while it goes on; the `rules` of plots, when something has gone wrong; `plots` anywhere.
        follows: in place of a default, a term over other parameters, as `(* 0.5 ?cycle)`.
        depends_on: parameters on whose values this one's relies, besides those that it follows. When one of them is
            said anew, what was said of this one is void: it has its default again, follows anew, or has no value.
    """

    type: Type
    default: Value | None = None
    least: float | None = None
    most: float | None = None
    among: tuple[Value, ...] = ()
    changed_by: Who = "plots"
    follows: str | None = None
    depends_on: tuple[str, ...] = ()

    @property
    def reasons(self) -> frozenset[str]:
        """The parameters on which its value relies."""
        return frozenset(self.depends_on) | (free_variables(_term(self.follows)) if self.follows else frozenset())

    def unsaid(self, values: Mapping[str, Value]) -> Value | None:
        """What it is worth if nobody says it, given the values of others; `None` if it has no value then."""
        if self.follows is None:
            return self.default
        term = _term(self.follows)
        if not all(name in values for name in free_variables(term)):
            return None
        found = evaluate_term(term, _NOTHING, values)
        return found if isinstance(found, str | int | float | bool) else None

    @property
    def range(self) -> Range:
        """The values that it may have."""
        return Range(self.type, self.least, self.most, self.among)

    def check(self, name: str, value: object) -> Value:
        """The value, if it fits; see `Range.check`."""
        return self.range.check(name, value)


def in_order(declared: Mapping[str, Parameter]) -> tuple[str, ...]:
    """The names, those first on whose values others rely; raises `graphlib.CycleError`."""
    return tuple(TopologicalSorter({name: one.reasons for name, one in declared.items()}).static_order())


def unsaid(declared: Mapping[str, Parameter]) -> dict[str, Value]:
    """What parameters are worth when nobody has said anything, as far as they have a value then."""
    values: dict[str, Value] = {}
    for name in in_order(declared):
        value = declared[name].unsaid(values)
        if value is not None:
            values[name] = value
    return values


def changed(
    component: str, declared: Mapping[str, Parameter], values: Mapping[str, Value], said: Mapping[str, Value | None]
) -> dict[str, Value]:
    """What all parameters are worth after some have been said anew.

    What relies on one of these is unbound, unless it has been said as well (S1.11). That goes for the same value said
    again, too: so what is so follows from what was said last of each, in order, and is the same after a restart.

    Args:
        component: its name, for messages.
        declared: what its builder says.
        values: what was so.
        said: what is so now; `None` takes back what was said.

    Raises:
        InputError: a value does not fit what is declared, or one that follows does not.
    """
    found, others = dict(values), set[str]()
    for name in in_order(declared):
        parameter, word = declared[name], said.get(name)
        if name not in said and others.isdisjoint(parameter.reasons):
            continue
        value = parameter.unsaid(found) if word is None else word
        if value is None:
            found.pop(name, None)
        else:
            found[name] = parameter.check(f"{component}.{name}", value)
        others.add(name)
    return found


def require_bound(component: str, declared: Mapping[str, Parameter], values: Mapping[str, Value]) -> None:
    """Raise `SchemaError` if a parameter has no value; the message says whose it is to say, and why it is missing."""
    for name, parameter in declared.items():
        if name not in values:
            raise SchemaError(f"'{component}.{name}' has no value: {_whose(parameter)}", found=name)


def _whose(parameter: Parameter) -> str:
    reasons = ", ".join(f"'{name}'" for name in sorted(parameter.reasons))
    told = "its builder leaves it to a profile"
    return told if not reasons else f"{told}, and what is said of it is void when {reasons} is said anew"


def known(component: str, name: str, declared: Mapping[str, Parameter]) -> Parameter:
    """What is declared about a parameter.

    Raises:
        UnknownNameError: the component has none of that name.
    """
    if name not in declared:
        message = f"component '{component}' has no parameter '{name}'"
        raise UnknownNameError(message, found=name, valid=declared)
    return declared[name]


def check_relations(component: str, relations: Iterable[str], values: Mapping[str, Value]) -> None:
    """Relations between the parameters of a component; those about a parameter without value say nothing yet.

    Args:
        component: its name, for messages.
        relations: conditions over its parameters, as `(<= ?speed (* 0.5 ?cycle))`.
        values: the parameters that have a value.

    Raises:
        SchemaError: one does not hold; the message has the values.
    """
    for text in relations:
        condition = parse_condition(text)
        read = sorted(free_variables(condition))
        if all(name in values for name in read) and not holds(condition, _NOTHING, values):
            said = ", ".join(f"{name} is {written(values[name])}" for name in read)
            raise SchemaError(f"component '{component}' needs {text}, but {said}")


_term = cache(parse_term)
_NOTHING = Overlay(WorldState(Schema()))


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
