"""Derived predicates (PDDL 2.2): conditions with definitions in place of predicates."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING

from knowledge_base.language.checking.vocabulary import ROOT_TYPE, VALUE_TYPES, Signature
from knowledge_base.language.syntax.expression import (
    TRUE,
    And,
    Atom,
    Expression,
    Or,
    Term,
    TypedVariable,
    Variable,
    substitute,
)
from knowledge_base.language.syntax.identity_cache import IdentityCache
from knowledge_base.language.syntax.rewriting import inside, with_atoms
from knowledge_base.world.axioms import Axiom

if TYPE_CHECKING:
    from knowledge_base.world.dependencies import Dependencies


class Definitions:
    """The definitions of derived predicates.

    Args:
        axioms: all axioms.
        predicates: the signatures of the predicates.
        typed: whether a definition also tests the types of variables, so that a query can enumerate their values.

    Attributes:
        axioms: the axioms by predicate.
        circles: the sets of predicates that follow from each other, each set after its inputs.
        recursive: the predicates in these sets; conditions keep them.

    Raises:
        SchemaError: a predicate follows from its own negation.
    """

    def __init__(self, axioms: Iterable[Axiom], predicates: Mapping[str, Signature], *, typed: bool) -> None:
        self.axioms: dict[str, list[Axiom]] = {}
        for axiom in axioms:
            self.axioms.setdefault(axiom.predicate, []).append(axiom)
        self._predicates = predicates
        self._typed = typed
        self.circles = self._dependencies.circles if self.axioms else []
        self.recursive = frozenset[str]().union(*self.circles)
        self._expanded: IdentityCache[Expression, Expression] = IdentityCache(size=256)

    @cached_property
    def _dependencies(self) -> Dependencies:
        from knowledge_base.world.dependencies import Dependencies  # noqa: PLC0415  loads networkx

        return Dependencies(self.axioms)

    def expanded(self, e: Expression) -> Expression:
        """Return the condition with each non-recursive derived predicate replaced by its definition."""
        if not self.axioms:
            return e
        # An equal condition must give an identical object, because other caches use its identity as the key.
        return self._expanded.find(e, None) or self._expanded.keep(e, None, with_atoms(e, self._cases))

    def inputs(self, name: str) -> set[str]:
        """Return the names from which a derived predicate follows, and its own name."""
        return self._dependencies.inputs(name)

    def recursive_part(self, e: Expression) -> Atom | None:
        """Return the first recursive predicate in a condition, if any; definitions may contain it."""
        atoms = (part for part in inside(self.expanded(e)) if isinstance(part, Atom)) if self.recursive else ()
        return next((atom for atom in atoms if atom.predicate in self.recursive), None)

    def _cases(self, atom: Atom) -> Expression:
        if atom.predicate not in self.axioms or atom.predicate in self.recursive:
            return atom
        cases = tuple(self.expanded(self._instance(axiom, atom)) for axiom in self.axioms[atom.predicate])
        return cases[0] if len(cases) == 1 else Or(cases)

    def _instance(self, axiom: Axiom, atom: Atom) -> Expression:
        """Return the axiom's condition for the atom's arguments, with type tests if the axiom restricts a type."""
        declared = self._predicates[axiom.predicate].parameters
        tests = tuple(
            type_test(own, term)
            for own, wide, term in zip(axiom.parameters, declared, atom.args, strict=True)
            if own.types != wide.types or (self._typed and isinstance(term, Variable))
        )
        terms = dict(zip((p.name for p in axiom.parameters), atom.args, strict=True))
        condition = substitute(axiom.condition, terms)
        return And((*tests, condition)) if tests else condition


def type_test(parameter: TypedVariable, term: Term) -> Expression:
    """Return the test that a term has the parameter's type; the types of values need no test."""
    types = [one for one in parameter.types or (ROOT_TYPE,) if one not in VALUE_TYPES]
    return Or(tuple(Atom(one, (term,)) for one in types)) if types else TRUE
