"""Writer of domains and worlds as PDDL files, which `parse_domain` and `read_problem` can read.

A file contains no places, notes or version.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from graphlib import TopologicalSorter
from typing import Protocol

from knowledge_base.errors import InputError
from knowledge_base.facts import Content, Fact
from knowledge_base.language.checking.vocabulary import Signature, Vocabulary
from knowledge_base.language.syntax.durative import Duration
from knowledge_base.language.syntax.effect import AllOf, Effect
from knowledge_base.language.syntax.expression import KEYWORDS, And, Constant, Expression, TypedVariable
from knowledge_base.language.syntax.sexpr import TypedName
from knowledge_base.language.syntax.text import LONGEST_NUMBER, to_text, types_text
from knowledge_base.pddl.action_text import ACTION, DURATIVE_ACTION, ActionText
from knowledge_base.pddl.domain_text import AxiomText, DeclarationText, DomainText
from knowledge_base.pddl.problem_text import Metric
from knowledge_base.spelling import is_name, is_plain_name, value_text


class WrittenWorld(Protocol):
    """The content of a world; a `WorldState` is one."""

    @property
    def schema(self) -> Vocabulary:
        """The declarations of the world."""

    @property
    def nodes(self) -> Mapping[str, str]:
        """The objects of the world with their types, including constants."""

    @property
    def facts(self) -> Iterable[Fact]:
        """The facts of the world."""

    @property
    def values(self) -> Mapping[Fact, Content]:
        """The values of functions in the world."""


def domain_to_text(domain: DomainText) -> str:
    """Return the domain as text; parents come before their subtypes, since some readers require this order.

    Raises:
        InputError: PDDL cannot spell a name, such as one with blanks or capitals.
    """
    declared = (domain.types, domain.constants, domain.predicates, domain.functions, domain.actions)
    for name in (domain.name, *(one.name for named in declared for one in named)):
        if not is_plain_name(name):
            raise _unspellable(name)
    lists = {
        ":types": [_name(one) for one in _from_the_top(domain.types)],
        ":constants": [_name(one) for one in domain.constants],
        ":predicates": [_declaration(one) for one in domain.predicates],
        ":functions": [f"{_declaration(one)} - {one.result or 'number'}" for one in domain.functions],
    }
    sections = [
        *([f"  (:requirements {' '.join(domain.requirements)})"] if domain.requirements else ()),
        *(_section(keyword, lines) for keyword, lines in lists.items() if lines),
        *map(axiom_to_text, domain.axioms),
        *map(action_to_text, domain.actions),
    ]
    return "\n".join([f"(define (domain {domain.name})", *sections]) + ")\n"


def action_to_text(action: ActionText) -> str:
    """Return one action as the text of a section."""
    parameters = f":parameters ({' '.join(map(_parameter, action.parameters))})"
    duration, timed = action.duration, action.timed
    if duration is None or timed is None:
        parts = [f":precondition {to_text(action.precondition)}", f":effect {to_text(action.effect)}"]
        return _section(f"{ACTION} {action.name}", [parameters, *parts])
    condition = _by_time({"at start": timed.start, "over all": timed.over_all, "at end": timed.end})
    effect = _by_time({"at start": timed.start_effect, "at end": timed.end_effect})
    parts = [f":duration {_duration(duration)}", f":condition {condition}", f":effect {effect}"]
    return _section(f"{DURATIVE_ACTION} {action.name}", [parameters, *parts])


def axiom_to_text(axiom: AxiomText) -> str:
    """Return one rule for a derived predicate as the text of a section."""
    return _section(f":derived {_declaration(axiom.head)}", [to_text(axiom.condition)])


def problem_to_text(state: WrittenWorld, name: str, domain: str, goal: Expression, metric: Metric | None) -> str:
    """Return the world as the initial state of a problem.

    Args:
        state: the world; the domain lists the constants of its schema.
        name: name of the problem.
        domain: name of the domain.
        goal: goal of the problem.
        metric: the measure of plans, if any.

    Raises:
        InputError: PDDL cannot spell a name, such as one with blanks or capitals, or a number is too long for a file.
    """
    schema = state.schema
    heads = {fact.predicate for fact in (*state.facts, *state.values)}
    for word in (name, domain, *state.nodes, *set(state.nodes.values()), *heads):
        if not is_name(word) or (word in KEYWORDS and word in heads):
            raise _unspellable(word)
    facts = [_fact(fact, schema.predicate(fact.predicate)) for fact in state.facts]
    values = [
        f"(= {_fact(fluent, schema.function(fluent.predicate))} {_content_text(content, quoted=True)})"
        for fluent, content in state.values.items()
    ]
    objects = [f"{thing} - {type_name}" for thing, type_name in state.nodes.items() if thing not in schema.constants]
    sections = [_section(":objects", objects), _section(":init", [*facts, *values]), f"  (:goal {to_text(goal)})"]
    if metric is not None:
        sections.append(f"  (:metric {metric.direction} {to_text(metric.term)})")
    return "\n".join([f"(define (problem {name}) (:domain {domain})", *sections]) + ")\n"


def _unspellable(name: str) -> InputError:
    return InputError(f"{name!r} cannot be a name in PDDL, which has lower case and no blanks there")


def _section(keyword: str, lines: Sequence[str]) -> str:
    return "\n    ".join([f"  ({keyword}", *lines]) + ")"


def _from_the_top(types: Iterable[TypedName]) -> Iterator[TypedName]:
    """Yield parents before their subtypes."""
    named = {one.name: one for one in types}
    order = TopologicalSorter({name: one.types for name, one in named.items()}).static_order()
    return (named[name] for name in order if name in named)


def _name(one: TypedName) -> str:
    return f"{one.name} - {types_text(one.types)}"


def _parameter(parameter: TypedVariable) -> str:
    return f"?{parameter.name} - {types_text(parameter.types)}"


def _declaration(one: DeclarationText) -> str:
    return "(" + " ".join([one.name, *map(_parameter, one.parameters)]) + ")"


def _duration(duration: Duration) -> str:
    if duration.fixed:
        return f"(= ?duration {to_text(duration.least)})"
    bounds = [] if duration.least == Constant(0) else [f"(>= ?duration {to_text(duration.least)})"]
    if duration.most != Constant(math.inf):
        bounds.append(f"(<= ?duration {to_text(duration.most)})")
    return bounds[0] if len(bounds) == 1 else f"(and {' '.join(bounds)})" if bounds else "()"


def _by_time(parts: Mapping[str, Expression | Effect]) -> str:
    """Return the parts of a durative condition or effect, each with its time.

    True and the empty effect have no parts.
    """
    timed = [(when, one) for when, e in parts.items() for one in (e.parts if isinstance(e, And | AllOf) else (e,))]
    return f"(and {' '.join(f'({when} {to_text(one)})' for when, one in timed)})"


def _fact(fact: Fact, signature: Signature) -> str:
    typed = zip(fact.args, signature.parameters, strict=True)
    # Text without quotes would be read as the name of an object; a name in quotes denotes the same object.
    return "(" + " ".join([fact.predicate, *(_content_text(arg, quoted="text" in p.types) for arg, p in typed)]) + ")"


def _content_text(content: Content, *, quoted: bool) -> str:
    for number in content if isinstance(content, tuple) else (content,):
        if not isinstance(number, str) and len(repr(number)) > LONGEST_NUMBER:
            raise InputError(f"a number in PDDL has at most {LONGEST_NUMBER} characters, not {number}")
    return value_text(content, quoted=quoted)
