"""Checks of conditions on the values of components, which states watch: their values, checks and facts exist."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from dsc.components.checks import LIBRARY
from dsc.components.value_conditions import WATCH, require_times
from dsc.components.value_vocabulary import ValueVocabulary, kind_of_type, kind_of_value
from dsc.errors import Finding
from dsc.model.actions import Trigger
from dsc.model.data_forms import literal_parts
from dsc.sensing.condition_parts import parts_in, split
from dsc.sensing.vocabulary import vocabulary_of
from dsc.validation.objects import KnownObjects
from dsc.validation.subject import Subject
from knowledge_base.conditions.damping import relaxed
from knowledge_base.errors import InputError, UnknownNameError
from knowledge_base.language.checking.check import check, check_term
from knowledge_base.language.syntax.expression import (
    Arithmetic,
    Call,
    Constant,
    Expression,
    Term,
    Variable,
    free_variables,
)
from knowledge_base.language.syntax.text import parse_condition

SEVERAL = "conditions.watch_truth"
"""The skill that watches conditions over several components and the knowledge."""


def check_watched_conditions(subject: Subject) -> Iterator[Finding]:
    """Yield findings about conditions that are written in the plot; those in variables are checked in a run."""
    for path, action, _ in subject.actions():
        if isinstance(action, Trigger) and (action.trigger == SEVERAL or action.trigger.endswith(f".{WATCH}")):
            text = action.arguments.get("condition")
            if isinstance(text, Constant) and isinstance(text.value, str):
                variables = _variables(subject, action.arguments.get("values"))
                try:
                    condition = parse_condition(text.value)
                    _check(subject, action.trigger, condition, variables)
                    _require_used(condition, variables or {})
                    _require_options(condition, action.arguments)
                except InputError as error:
                    yield subject.caught(_inside(error), (*path, "with", "condition"), "condition")


def _variables(subject: Subject, values: Term | None) -> dict[str, str] | None:
    """Return the kinds of the variables that an argument gives values; `None` if a run decides them."""
    parts = {} if values is None else literal_parts(values)
    return None if parts is None else {name: _kind(subject, term) for name, term in parts.items()}


def _kind(subject: Subject, term: Term) -> str:
    """Return the kind of a term's value; empty if it is unknown."""
    match term:
        case Constant(value):
            return "" if isinstance(value, str) else kind_of_value(value)
        case Variable(name):
            return kind_of_type(subject.types.get(name))
        case Call(name) if subject.schema is not None and name in subject.schema.functions:
            return kind_of_type(subject.schema.functions[name].result)
        case Call("list") | Arithmetic("geometry"):
            return "list"
        case _:
            return ""


def _require_used(condition: Expression, variables: Collection[str]) -> None:
    used = free_variables(condition)
    for name in variables:
        if name not in used:
            message = f"the condition does not use '{name}' of `values`"
            raise UnknownNameError(message, found=name, valid=used)


def _require_options(condition: Expression, arguments: Mapping[str, Term]) -> None:
    """Raise an error about constant options that do not fit the condition or each other."""
    options = {name: one.value for name, one in arguments.items() if isinstance(one, Constant)}
    if isinstance(hysteresis := options.get("hysteresis"), int | float) and hysteresis > 0:
        relaxed(condition, hysteresis)
    require_times(options.get("times", 1), options.get("out_of", 1))


def _inside(error: InputError) -> InputError:
    """Add the place in the condition's text to the message; the finding has the place in the plot."""
    if error.place is not None and error.place.line is not None:
        error.message += f" (line {error.place.line}, column {error.place.column} of the condition)"
    return error


def _check(subject: Subject, trigger: str, condition: Expression, variables: Mapping[str, str] | None) -> None:
    """Raise `InputError` for a condition that cannot be evaluated."""
    name = trigger.partition(".")[0]
    if trigger == SEVERAL and subject.interfaces and subject.schema is not None:
        vocabulary = vocabulary_of(subject.interfaces, variables, subject.schema.functions)
        _check_parts(subject, condition, vocabulary)
    elif name in subject.interfaces:
        interface = subject.interfaces[name]
        ports = {port: service.gives for port, service in interface.pushes.items()}
        checks = {**LIBRARY, **(interface.checks or {})}
        who, any_check = f"component '{name}' pushes no value", interface.checks is None
        ValueVocabulary(ports, checks, variables, who, any_check=any_check).check(condition)


def _check_parts(subject: Subject, condition: Expression, vocabulary: ValueVocabulary) -> None:
    """Raise an error for a part that its source cannot evaluate: a component, or the knowledge."""
    schema = subject.schema
    assert schema is not None  # noqa: S101
    known = None if subject.objects is None else KnownObjects(schema, subject.objects)
    types: Mapping[str, str | None] = dict.fromkeys(free_variables(condition))
    for part in parts_in(split(condition, {}, vocabulary)):
        read: list[Expression | Term] = [*part.live.values()]
        if not part.components:
            check(part.condition, schema, types)
            read.append(part.condition)
        for term in part.live.values():
            check_term(term, schema, types)
        for form in read:
            for mistake in () if known is None else known.mistakes(form, types):
                raise mistake
