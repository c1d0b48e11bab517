"""Checks of conditions on the values of components, which states watch: their values, checks and facts exist."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping

from dsc.components.checks import LIBRARY
from dsc.components.value_conditions import WATCH
from dsc.components.value_vocabulary import ValueVocabulary
from dsc.errors import Finding
from dsc.model.actions import Trigger
from dsc.model.data_forms import literal_parts
from dsc.sensing.condition_parts import parts_in, split
from dsc.sensing.vocabulary import vocabulary_of
from dsc.validation.objects import KnownObjects
from dsc.validation.subject import Subject
from knowledge_base.errors import InputError
from knowledge_base.language.checking.check import check, check_term
from knowledge_base.language.syntax.expression import Constant, Expression, Term, free_variables
from knowledge_base.language.syntax.text import parse_condition

SEVERAL = "conditions.watch_truth"
"""The skill that watches conditions over several components and the knowledge."""


def check_watched_conditions(subject: Subject) -> Iterator[Finding]:
    """Yield findings about conditions that are written in the plot; those in variables are checked in a run."""
    for path, action, _ in subject.actions():
        if isinstance(action, Trigger) and (action.trigger == SEVERAL or action.trigger.endswith(f".{WATCH}")):
            text = action.arguments.get("condition")
            if isinstance(text, Constant) and isinstance(text.value, str):
                variables = _variables(action.arguments.get("values"))
                try:
                    _check(subject, action.trigger, parse_condition(text.value), variables)
                except InputError as error:
                    yield subject.caught(error, (*path, "with", "condition"), "condition")


def _variables(values: Term | None) -> Collection[str] | None:
    """Return the names of the variables that an argument gives values; `None` if a run decides them."""
    return () if values is None else literal_parts(values)


def _check(subject: Subject, trigger: str, condition: Expression, variables: Collection[str] | None) -> None:
    """Raise `InputError` for a condition that cannot be evaluated."""
    name = trigger.partition(".")[0]
    if trigger == SEVERAL and subject.interfaces and subject.schema is not None:
        vocabulary = vocabulary_of(subject.interfaces, variables, subject.schema.functions)
        _check_parts(subject, condition, vocabulary)
    elif name in subject.interfaces:
        interface = subject.interfaces[name]
        ports = {port: service.gives for port, service in interface.pushes.items()}
        checks = {**(interface.checks or {}), **LIBRARY}
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
