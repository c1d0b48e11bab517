"""Axioms: definitions of derived predicates (PDDL 2.2)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

from knowledge_base.errors import Place
from knowledge_base.language.checking.check import check, check_arity, check_parameters
from knowledge_base.language.checking.vocabulary import Vocabulary
from knowledge_base.language.syntax.expression import Atom, Expression, TypedVariable, Variable
from knowledge_base.pddl.domain_text import AxiomText


@dataclass(frozen=True, slots=True)
class Axiom:
    """Definition of a derived predicate (PDDL 2.2).

    The predicate holds for the arguments for which the condition holds. Several axioms of one predicate are
    alternatives.
    """

    predicate: str
    parameters: tuple[TypedVariable, ...]
    condition: Expression
    place: Place | None = field(default=None, compare=False, repr=False)


def checked_axiom(axiom: AxiomText, schema: Vocabulary) -> Axiom:
    """Return the axiom of a parsed axiom, checked against the schema.

    A parameter without a type receives the type that the predicate declares.
    """
    head = axiom.head
    signature = schema.predicate(head.name, head.place)
    check_arity(signature, len(head.parameters), head.place)
    declared = zip(head.parameters, signature.parameters, strict=True)
    parameters = tuple(own if own.types else replace(own, types=theirs.types) for own, theirs in declared)
    variables = check_parameters(parameters, schema)
    check(Atom(head.name, tuple(Variable(p.name) for p in parameters), place=head.place), schema, variables)
    check(axiom.condition, schema, variables, objects=schema.constants)
    return Axiom(head.name, parameters, axiom.condition, head.place)
