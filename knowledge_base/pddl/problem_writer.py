"""A world as a PDDL problem file, which `read_problem` reads back without the version."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Protocol

from knowledge_base.errors import InputError
from knowledge_base.facts import Content, Fact
from knowledge_base.language.checking.vocabulary import Signature, Vocabulary
from knowledge_base.language.syntax.expression import KEYWORDS, TRUE, Expression
from knowledge_base.language.syntax.text import LONGEST_NUMBER, to_text
from knowledge_base.pddl.problem_text import Metric
from knowledge_base.spelling import is_name, value_text


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
