"""Conditions over several sources, split into parts that one source each can evaluate (S2.4, S2.18).

`(or (< (distance hand.pose.position (pose cup1)) 0.01) (> (magnitude wrist.force.tool) 5))` has one part for `hand` and
one for `wrist`. `hand.pose.position` is the value `position` of the port `pose` of the component `hand`. A form without
such a value is a condition or a term of the knowledge base.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

from dsc.components.value_vocabulary import ValueVocabulary
from knowledge_base.errors import InputError
from knowledge_base.facts import Value
from knowledge_base.language.syntax.expression import (
    And,
    Arithmetic,
    Call,
    Constant,
    Expression,
    Imply,
    Not,
    Or,
    Term,
    Variable,
    free_variables,
    substitute,
)
from knowledge_base.language.syntax.rewriting import inside, with_terms
from knowledge_base.language.syntax.text import to_text
from knowledge_base.user_objects import shown


@dataclass(frozen=True, slots=True, eq=False)
class Part:
    """A part of a condition.

    Attributes:
        condition: the part. Names of a single component's values lack the component, as in `pose.position`.
        components: the components whose values the part reads; without any, the knowledge base evaluates the part.
        live: the terms of the knowledge base in the part, by the variables that stand for their present values.
        text: the part as it is written.
    """

    condition: Expression
    text: str
    components: tuple[str, ...] = ()
    live: Mapping[str, Term] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Junction:
    """Operands that one truth value decides: false decides a conjunction, true decides a disjunction."""

    decisive: bool
    operands: tuple[Structure, ...]


Structure = Junction | Part
"""A condition as parts without negations above them."""


def split(condition: Expression, values: Mapping[str, Any], vocabulary: ValueVocabulary) -> Structure:
    """Return a condition as the largest parts that one source each can evaluate.

    Args:
        condition: the condition.
        values: the values of its variables.
        vocabulary: the names that parts on values may use.

    Raises:
        InputError: a part on values cannot be evaluated, or the knowledge cannot contain a variable's value.
        UnknownNameError: a part on values uses an unknown name, or a variable has no value.
    """
    return _Splitter(values, vocabulary).split(_with_inner_negations(condition, negated=False))


def parts_in(structure: Structure) -> Iterator[Part]:
    """Yield the parts from left to right."""
    if isinstance(structure, Part):
        yield structure
    else:
        for operand in structure.operands:
            yield from parts_in(operand)


def truth_of(structure: Structure, truth: Callable[[Part], bool | None]) -> bool | None:
    """Return the truth of a condition, some of whose parts may be unknown (Kleene's strong three-valued logic)."""
    if isinstance(structure, Part):
        return truth(structure)
    truths = [truth_of(operand, truth) for operand in structure.operands]
    if structure.decisive in truths:
        return structure.decisive
    return None if None in truths else not structure.decisive


def components_in(form: Expression | Term) -> tuple[str, ...]:
    """Return the names of the components whose values a form reads, in the order of the text."""
    return tuple(dict.fromkeys(str(name.value).partition(".")[0] for name in value_names(form)))


def value_names(form: Expression | Term) -> Iterator[Constant]:
    """Yield the names of values in a form, e.g. `hand.pose.position`, and of ports, e.g. `hand.pose`."""
    return (one for one in inside(form) if isinstance(one, Constant) and _is_value_name(one))


def _is_value_name(term: Constant) -> bool:
    return isinstance(term.value, str) and not term.quoted and "." in term.value


def _with_inner_negations(e: Expression, *, negated: bool) -> Expression:
    """Return the condition, or its negation, with `not` only before comparisons, predicates and quantifiers."""
    match e:
        case Not(body):
            return _with_inner_negations(body, negated=not negated)
        case Imply(premise, conclusion):
            either = Or((Not(premise, place=premise.place), conclusion), place=e.place)
            return _with_inner_negations(either, negated=negated)
        case And(parts) | Or(parts):
            kind = And if isinstance(e, And) is not negated else Or
            made = (_with_inner_negations(part, negated=negated) for part in parts)
            return kind(tuple(inner for one in made for inner in _operands(one, kind)), place=e.place)
        case _:
            return Not(e, place=e.place) if negated else e


def _operands(e: Expression, kind: type[And | Or]) -> tuple[Expression, ...]:
    return e.parts if isinstance(e, And | Or) and isinstance(e, kind) else (e,)


class _Splitter:
    """One split; see `split` for the arguments."""

    def __init__(self, values: Mapping[str, Any], vocabulary: ValueVocabulary) -> None:
        self._values, self._vocabulary = values, vocabulary

    def split(self, e: Expression) -> Structure:
        """Return a condition with inner negations as parts."""
        if not isinstance(e, And | Or) or _has_one_source(e):
            return self._part(e)
        alike: dict[tuple[str, ...], list[Expression]] = {}
        for operand in e.parts:
            if _has_one_source(operand):
                alike.setdefault(components_in(operand), []).append(operand)
        merged = [each[0] if len(each) == 1 else replace(e, parts=tuple(each)) for each in alike.values()]
        others = [operand for operand in e.parts if not _has_one_source(operand)]
        return Junction(isinstance(e, Or), (*map(self._part, merged), *map(self.split, others)))

    def _part(self, e: Expression) -> Part:
        components = components_in(e)
        if not components:
            self._vocabulary.require_knowledge(e)
            return Part(substitute(e, self._values_for(e)), to_text(e))
        self._vocabulary.check(e)
        live: dict[str, Term] = {}
        prefix = f"{components[0]}." if len(components) == 1 else ""
        return Part(with_terms(e, lambda term: self._read(term, prefix, live)), to_text(e), components, live)

    def _values_for(self, form: Expression | Term) -> dict[str, Value]:
        """Return the values of the variables in a form of the knowledge."""
        values = {name: self._values[name] for name in free_variables(form) if name in self._values}
        for name, value in values.items():
            if not isinstance(value, Value):
                message = f"'?{name}' is {shown(value)}, which the knowledge cannot contain: {to_text(form)}"
                raise InputError(message, place=form.place, found=name)
        return values

    def _read(self, term: Term, prefix: str, live: dict[str, Term]) -> Term:
        """Return a term without the component's name, and with variables for the terms that `live` receives."""
        match term:
            case Constant(str(name)) if _is_value_name(term):
                return replace(term, value=name.removeprefix(prefix))
            case Call(function) if self._vocabulary.is_of_knowledge(function):
                variable = Variable(f"live.{len(live)}", place=term.place)
                live[variable.name] = substitute(term, self._values_for(term))
                return variable
            case Call(_, args) | Arithmetic(_, args):
                return replace(term, args=tuple(self._read(arg, prefix, live) for arg in args))
            case _:
                return term


def _has_one_source(e: Expression) -> bool:
    """Return whether all comparisons, predicates and quantifiers of a condition read the same source."""
    if isinstance(e, And | Or):
        return len({components_in(part) for part in e.parts}) <= 1 and all(map(_has_one_source, e.parts))
    return len(components_in(e)) <= 1
