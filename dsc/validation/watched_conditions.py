"""Checks of conditions on the values of components, which states watch: their values, checks and facts exist."""

from __future__ import annotations

from collections.abc import Collection, Iterator

from dsc.components.value_conditions import WATCH
from dsc.errors import Finding
from dsc.model.actions import Trigger
from dsc.sensing.condition_parts import parts_in, require_values, split
from dsc.validation.subject import Subject
from knowledge_base.errors import InputError
from knowledge_base.language.checking.check import check, check_term
from knowledge_base.language.syntax.expression import Constant, Expression, free_variables
from knowledge_base.language.syntax.text import parse_condition

SEVERAL = "conditions.watch_truth"
"""The skill that watches conditions over several components and the knowledge."""


def check_watched_conditions(subject: Subject) -> Iterator[Finding]:
    """Yield findings about conditions that are written in the plot; those in variables are checked in a run."""
    for path, action, _ in subject.actions():
        if isinstance(action, Trigger) and (action.trigger == SEVERAL or action.trigger.endswith(f".{WATCH}")):
            text = action.arguments.get("condition")
            if isinstance(text, Constant) and isinstance(text.value, str):
                try:
                    _check(subject, action.trigger, text.value)
                except InputError as error:
                    yield subject.caught(error, (*path, "with", "condition"), "condition")


def _check(subject: Subject, trigger: str, text: str) -> None:
    """Raise `InputError` for a condition that cannot be evaluated."""
    condition = parse_condition(text)
    component = trigger.partition(".")[0]
    own = "" if trigger == SEVERAL else f"{component}."
    if own and component not in subject.interfaces:
        return
    if subject.interfaces:
        require_values(
            condition, _ports(subject, own), f"component '{component}' pushes no" if own else "no component pushes a"
        )
    if not own and subject.schema is not None:
        _require_knowledge(subject, condition)


def _ports(subject: Subject, own: str) -> dict[str, Collection[str]]:
    """Return the values of the ports of all components; with `own`, those of one, without its name."""
    return {
        f"{name}.{port}".removeprefix(own): service.gives
        for name, interface in subject.interfaces.items()
        for port, service in interface.pushes.items()
        if f"{name}.".startswith(own)
    }


def _require_knowledge(subject: Subject, condition: Expression) -> None:
    """Raise an error for a part of the knowledge that the schema does not declare."""
    schema = subject.schema
    assert schema is not None  # noqa: S101
    for part in parts_in(split(condition, {}, schema.functions)):
        types = dict.fromkeys(free_variables(part.condition))
        if not part.components:
            check(part.condition, schema, types)
        for term in part.live.values():
            check_term(term, schema, dict.fromkeys(free_variables(term)))
