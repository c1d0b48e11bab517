"""Derived predicates (PDDL 2.2 axioms): their definitions, and conditions with definitions in place of predicates."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace

import networkx as nx

from knowledge_base.errors import Place, SchemaError
from knowledge_base.language.checking.check import check, check_arity, check_parameters
from knowledge_base.language.checking.vocabulary import ROOT_TYPE, VALUE_TYPES, Signature, Vocabulary
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
from knowledge_base.language.syntax.rewriting import denied, inside, names_of, with_atoms
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
        self._graph = self._dependencies()
        self.circles = [circle for circle in _strata(self._graph) if _is_circle(circle, self._graph)]
        self.recursive = frozenset[str]().union(*self.circles)
        self._expanded: IdentityCache[Expression, Expression] = IdentityCache(size=256)

    def expanded(self, e: Expression) -> Expression:
        """Return the condition with each non-recursive derived predicate replaced by its definition."""
        if not self.axioms:
            return e
        # An equal condition must give an identical object, because other caches use its identity as the key.
        return self._expanded.find(e, None) or self._expanded.keep(e, None, with_atoms(e, self._cases))

    def inputs(self, name: str) -> set[str]:
        """Return the names from which a derived predicate follows, and its own name."""
        return {name, *nx.descendants(self._graph, name)}

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

    def _dependencies(self) -> nx.DiGraph[str]:
        """Return the graph with an edge from each predicate to each of its inputs."""
        graph: nx.DiGraph[str] = nx.DiGraph()
        axioms = [axiom for those in self.axioms.values() for axiom in those]
        for axiom in axioms:
            graph.add_node(axiom.predicate)
            graph.add_edges_from((axiom.predicate, name) for name in names_of(axiom.condition))
        for axiom in axioms:
            for atom in denied(axiom.condition, wanted=True):
                if atom.predicate in graph and nx.has_path(graph, atom.predicate, axiom.predicate):
                    raise SchemaError(
                        f"the derived predicate '{axiom.predicate}' follows from its own negation, through"
                        f" '{atom.predicate}'",
                        place=atom.place or axiom.place,
                    )
        return graph


def type_test(parameter: TypedVariable, term: Term) -> Expression:
    """Return the test that a term has the parameter's type; the types of values need no test."""
    types = [one for one in parameter.types or (ROOT_TYPE,) if one not in VALUE_TYPES]
    return Or(tuple(Atom(one, (term,)) for one in types)) if types else TRUE


def _strata(graph: nx.DiGraph[str]) -> Iterator[frozenset[str]]:
    """Yield the strongly connected sets of predicates, each after its inputs."""
    components = nx.condensation(graph)
    for number in reversed(list(nx.topological_sort(components))):
        yield frozenset(components.nodes[number]["members"])


def _is_circle(component: frozenset[str], graph: nx.DiGraph[str]) -> bool:
    return len(component) > 1 or any(graph.has_edge(name, name) for name in component)
