"""Parameters of components: a builder declares ranges, an integrator sets values, others change them (S1.11)."""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from functools import cache
from graphlib import CycleError, TopologicalSorter
from typing import Any, Literal, get_args

from dsc.errors import SkillError
from dsc.model.ranges import Range, Who, refuse_change, written
from knowledge_base.errors import InputError, Place, SchemaError, UnknownNameError, tolerated
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
        return Range(self.type, self.least, self.most, self.among)


class NoValueError(SchemaError, SkillError):
    """A declared parameter has no value; a profile or an operator may set it."""


class Parameters(dict[str, Any]):
    """The present values of one component's parameters.

    Args:
        component: the component's name, for messages.
        declared: the declarations; if empty, any name is valid.
        relations: conditions over the parameters, e.g. `(<= ?speed (* 0.5 ?cycle))`. Each must be true as soon as all
            its parameters have values.
    """

    def __init__(self, component: str, declared: Mapping[str, Parameter], relations: Iterable[str]) -> None:
        super().__init__()
        with tolerated():
            self.update(_changed(component, declared, {}, dict.fromkeys(declared)))
        self._component = component
        self._declared = dict(declared)
        self._relations = tuple(relations)
        self._as_one_set = False

    def configure(self, name: str, value: Any) -> None:
        """Set a parameter; `None` resets a declared one.

        Raises:
            UnknownNameError: the component declares parameters, and `name` is not among them.
            InputError: the value violates its declaration or a relation.
        """
        after = self._after(self, {name: value})
        if not self._as_one_set:
            self._check_relations(after)
        self.replace(after)

    @contextmanager
    def as_one_set(self, values: Mapping[str, Any]) -> Iterator[None]:
        """Validate values as one set; inside the block, `configure` checks no relations.

        Raises:
            UnknownNameError: the component declares parameters, and a name is not among them.
            InputError: a value violates its declaration or a relation.
        """
        after: Mapping[str, Any] = self
        for name, value in values.items():
            after = self._after(after, {name: value})
        self._check_relations(after)
        self._as_one_set = True
        try:
            yield
        finally:
            self._as_one_set = False

    def check(self, name: str, value: Any, who: Who) -> None:
        """Validate a value of a declared parameter without setting it.

        Raises:
            UnknownNameError: the component declares no such parameter.
            InputError: the role `who` may not change the parameter, or the value violates its declaration or a
                relation.
        """
        refuse_change(f"{self._component}.{name}", who, known(self._component, name, self._declared).changed_by)
        self._check_relations(self._after(self, {name: value}))

    def after(self, settings: Mapping[str, Any]) -> dict[str, Any]:
        """Return the values after the settings of a profile.

        Raises:
            SchemaError: a parameter has no value, a setting violates its declaration, or a relation is false.
        """
        found = self._after(self, settings)
        self._require_bound(found)
        self._check_relations(found)
        return found

    def replace(self, values: Mapping[str, Any]) -> None:
        """Replace all values without validation."""
        found = dict(values)
        self.clear()
        self.update(found)

    def require_bound(self) -> None:
        """Raise `NoValueError` if a declared parameter has no value; the message has the reason."""
        self._require_bound(self)

    def _require_bound(self, values: Mapping[str, Any]) -> None:
        for name, parameter in self._declared.items():
            if name not in values:
                reasons = ", ".join(f"'{reason}'" for reason in sorted(parameter.reasons))
                reset = f", and a new value of {reasons} resets it" if reasons else ""
                message = f"'{self._component}.{name}' has no value: its builder leaves it to a profile{reset}"
                raise NoValueError(message, found=name)

    def _after(self, values: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
        if not self._declared:
            return {**values, **settings}
        for name in settings:
            known(self._component, name, self._declared)
        return _changed(self._component, self._declared, values, settings)

    def _check_relations(self, values: Mapping[str, Any]) -> None:
        for text in self._relations:
            condition = parse_condition(text)
            read = sorted(free_variables(condition))
            if all(name in values for name in read) and not holds(condition, _NOTHING, values):
                found = ", ".join(f"{name} is {written(values[name])}" for name in read)
                raise SchemaError(f"component '{self._component}' needs {text}, but {found}")


def known(component: str, name: str, declared: Mapping[str, Parameter]) -> Parameter:
    """Return the declaration of a parameter; raise `UnknownNameError` if it is missing."""
    if name not in declared:
        message = f"component '{component}' has no parameter '{name}'"
        raise UnknownNameError(message, found=name, valid=declared)
    return declared[name]


def _changed(
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


def check_declarations(
    component: str, declares: Mapping[str, Parameter], relations: Iterable[str], module: str = ""
) -> None:
    """Validate the declarations of a component class.

    Args:
        component: the component's name, for messages.
        declares: the parameters by name.
        relations: conditions between the parameters.
        module: the module of the class, for messages.

    Raises:
        InputError: a type, role or name is unknown, a range is empty, or a default is outside its range. The error is
            also raised if a relation is not a condition. The message has the file, the parameter, the value found and
            the nearest name.
    """
    try:
        for name, parameter in declares.items():
            _check_parameter(f"{component}.{name}", parameter)
            _check_dependencies(f"{component}.{name}", parameter, declares)
        try:
            _changed(component, declares, {}, dict.fromkeys(declares))
        except CycleError as error:
            cycle = ", ".join(f"'{name}'" for name in error.args[1])
            raise SchemaError(
                f"parameters of component '{component}' depend on each other in a cycle: {cycle}"
            ) from error
        _check_relations(component, declares, relations)
    except InputError as error:
        file = getattr(sys.modules.get(module), "__file__", None)
        error.place = Place(file) if file else None
        raise


def _check_parameter(name: str, parameter: Parameter) -> None:
    if parameter.type not in get_args(Type):
        message = f"the type of parameter '{name}' is '{parameter.type}', which does not exist"
        raise UnknownNameError(message, found=str(parameter.type), valid=get_args(Type))
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


def _check_dependencies(name: str, parameter: Parameter, declares: Mapping[str, Parameter]) -> None:
    if isinstance(parameter.depends_on, str):
        raise SchemaError(f"`depends_on` of parameter '{name}' is a tuple of names, not one text")
    try:
        reasons = parameter.reasons
    except InputError as error:
        raise SchemaError(f"`follows` of parameter '{name}', {parameter.follows}, is not a term: {error}") from error
    for reason in sorted(reasons - set(declares)):
        raise UnknownNameError(
            f"parameter '{name}' depends on '{reason}', which is not declared", found=reason, valid=declares
        )


def _check_relations(component: str, declares: Mapping[str, Parameter], relations: Iterable[str]) -> None:
    if isinstance(relations, str):
        raise SchemaError(f"`relations` of component '{component}' is a tuple of conditions, not one text")
    for text in relations:
        try:
            condition = parse_condition(text)
        except InputError as error:
            raise SchemaError(f"the relation {text} of component '{component}' is not a condition: {error}") from error
        for name in sorted(free_variables(condition) - set(declares)):
            message = f"the relation {text} of component '{component}' reads '?{name}', which it does not declare"
            raise UnknownNameError(message, found=name, valid=declares)
