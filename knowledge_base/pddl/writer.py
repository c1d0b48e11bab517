"""Domains and worlds as PDDL files, which `parse_domain` and `read_problem` read back."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from graphlib import TopologicalSorter
from typing import Protocol, TypeVar

from knowledge_base.errors import InputError
from knowledge_base.facts import Content, Fact
from knowledge_base.language.checking.vocabulary import ROOT_TYPE, Signature, Vocabulary
from knowledge_base.language.syntax.durative import Duration, DurativeParts
from knowledge_base.language.syntax.effect import NO_EFFECT, AllOf, Effect
from knowledge_base.language.syntax.expression import KEYWORDS, TRUE, And, Constant, Expression, TypedVariable
from knowledge_base.language.syntax.sexpr import TypedName
from knowledge_base.language.syntax.text import LONGEST_NUMBER, to_text
from knowledge_base.pddl.action_text import ACTION, DURATIVE_ACTION, ActionText
from knowledge_base.pddl.domain_text import AxiomText, DeclarationText, DomainText
from knowledge_base.pddl.problem_text import Metric
from knowledge_base.spelling import is_name, is_plain_name, value_text

_T = TypeVar("_T")


def domain_to_text(domain: DomainText) -> str:
    """The domain as text; parents come before their subtypes, since some readers need that order.

    Raises:
        InputError: a name that PDDL cannot spell, such as one with blanks or capitals.
    """
    for name in _names(domain):
        if not is_plain_name(name):
            raise InputError(f"{name!r} cannot be a name in PDDL, which has lower case and no blanks there")
    sections = [
        _section(":requirements", domain.requirements, together=True),
        _section(":types", [_name(one) for one in _from_the_top(domain.types)]),
        _section(":constants", [_name(one) for one in domain.constants]),
        _section(":predicates", [_declaration(one) for one in domain.predicates]),
        _section(":functions", [f"{_declaration(one)} - {one.result or 'number'}" for one in domain.functions]),
        *map(axiom_to_text, domain.axioms),
        *map(action_to_text, domain.actions),
    ]
    return "\n".join([f"(define (domain {domain.name})", *filter(None, sections)]) + ")\n"


def _names(domain: DomainText) -> Iterator[str]:
    yield domain.name
    for named in (domain.types, domain.constants, domain.predicates, domain.functions, domain.actions):
        yield from (one.name for one in named)


def _section(keyword: str, lines: Sequence[str], *, together: bool = False) -> str:
    if not lines:
        return ""
    return (" " if together else "\n    ").join([f"  ({keyword}", *lines]) + ")"


def _from_the_top(types: Iterable[TypedName]) -> list[TypedName]:
    """Parents before their subtypes."""
    named = {one.name: one for one in types}
    order = TopologicalSorter({name: one.types for name, one in named.items()}).static_order()
    return [named[name] for name in order if name in named]


def _name(one: TypedName) -> str:
    return f"{one.name} - {_types(one.types)}"


def _types(types: Sequence[str]) -> str:
    return types[0] if len(types) == 1 else f"(either {' '.join(types)})" if types else ROOT_TYPE


def _declaration(one: DeclarationText) -> str:
    return "(" + " ".join([one.name, *map(_parameter, one.parameters)]) + ")"


def _parameter(parameter: TypedVariable) -> str:
    return f"?{parameter.name} - {_types(parameter.types)}"


def action_to_text(action: ActionText) -> str:
    """One action as text of a file."""
    durative = action.duration is not None and action.timed is not None
    lines = [f"  ({DURATIVE_ACTION if durative else ACTION} {action.name}"]
    lines.append(f":parameters ({' '.join(map(_parameter, action.parameters))})")
    if action.duration is not None and action.timed is not None:
        lines.append(f":duration {_duration(action.duration)}")
        lines.append(f":condition {_conditions(action.timed)}")
        lines.append(f":effect {_effects(action.timed)}")
    else:
        lines.append(f":precondition {to_text(action.precondition)}")
        lines.append(f":effect {to_text(action.effect)}")
    return "\n    ".join(lines) + ")"


def axiom_to_text(axiom: AxiomText) -> str:
    """One rule for a derived predicate as text of a file."""
    return f"  (:derived {_declaration(axiom.head)}\n    {to_text(axiom.condition)})"


def _duration(duration: Duration) -> str:
    if duration.fixed:
        return f"(= ?duration {to_text(duration.least)})"
    bounds = [] if duration.least == Constant(0) else [f"(>= ?duration {to_text(duration.least)})"]
    if duration.most != Constant(math.inf):
        bounds.append(f"(<= ?duration {to_text(duration.most)})")
    return bounds[0] if len(bounds) == 1 else f"(and {' '.join(bounds)})" if bounds else "()"


def _conditions(timed: DurativeParts) -> str:
    def parts(e: Expression) -> tuple[Expression, ...]:
        return e.parts if isinstance(e, And) else (e,)

    named = {"at start": timed.start, "over all": timed.over_all, "at end": timed.end}
    return _by_time({when: () if e == TRUE else parts(e) for when, e in named.items()}, to_text)


def _effects(timed: DurativeParts) -> str:
    def parts(e: Effect) -> tuple[Effect, ...]:
        return e.parts if isinstance(e, AllOf) else (e,)

    named = {"at start": timed.start_effect, "at end": timed.end_effect}
    return _by_time({when: () if e == NO_EFFECT else parts(e) for when, e in named.items()}, to_text)


def _by_time(parts: dict[str, tuple[_T, ...]], written: Callable[[_T], str]) -> str:
    return f"(and {' '.join(f'({when} {written(one)})' for when, each in parts.items() for one in each)})"


class WrittenWorld(Protocol):
    """The content of a world; a `WorldState` is one."""

    @property
    def schema(self) -> Vocabulary:
        """Its declarations."""
        ...

    @property
    def nodes(self) -> Mapping[str, str]:
        """Its objects with their types, constants too."""
        ...

    @property
    def facts(self) -> Iterable[Fact]:
        """Its facts."""
        ...

    @property
    def values(self) -> Mapping[Fact, Content]:
        """The values of its functions."""
        ...


def problem_to_text(
    state: WrittenWorld, name: str, domain: str, goal: Expression = TRUE, metric: Metric | None = None
) -> str:
    """The world as the start of a problem.

    Args:
        state: the world; the domain lists the constants of its schema.
        name: of the problem.
        domain: the name of its domain.
        goal: of the problem.
        metric: the measure of plans.

    Raises:
        InputError: a name that PDDL cannot spell, such as one with blanks or capitals, or a number that is
            too long for a file.
    """
    schema = state.schema
    heads = {fact.predicate for fact in (*state.facts, *state.values)}
    for word in (name, domain, *state.nodes, *set(state.nodes.values()), *heads):
        if not is_name(word) or (word in KEYWORDS and word in heads):
            raise InputError(f"{word!r} cannot be a name in PDDL, which has lower case and no blanks there")
    said = [_fact(fact, schema.predicate(fact.predicate)) for fact in state.facts]
    values = [
        f"(= {_fact(fluent, schema.function(fluent.predicate))} {_written(content, quoted=True)})"
        for fluent, content in state.values.items()
    ]
    objects = [f"{thing} - {type_name}" for thing, type_name in state.nodes.items() if thing not in schema.constants]
    sections = (_section(":objects", objects), _section(":init", [*said, *values]), f"  (:goal {to_text(goal)})")
    wanted = [] if metric is None else [f"  (:metric {metric.direction} {to_text(metric.term)})"]
    return "\n".join([f"(define (problem {name}) (:domain {domain})", *sections, *wanted]) + ")\n"


def _section(keyword: str, lines: list[str]) -> str:
    return "\n    ".join([f"  ({keyword}", *lines]) + ")"


def _fact(fact: Fact, signature: Signature) -> str:
    typed = zip(fact.args, signature.parameters, strict=True)
    # Text without quotes would be read as the name of a thing; a name in quotes is still one.
    return "(" + " ".join([fact.predicate, *(_written(arg, quoted="text" in p.types) for arg, p in typed)]) + ")"


def _written(content: Content, *, quoted: bool) -> str:
    for number in content if isinstance(content, tuple) else (content,):
        if not isinstance(number, str) and len(repr(number)) > LONGEST_NUMBER:
            raise InputError(f"a number in PDDL has at most {LONGEST_NUMBER} characters, not {number}")
    return value_text(content, quoted=quoted)
