"""Derived predicates (PDDL 2.2 axioms): compiled away, or evaluated if no action changes their inputs.

Each atom of a non-recursive predicate is replaced by the predicate's condition. A recursive predicate, such as `above`,
is replaced by facts if no action changes its inputs: the least fixpoint, stratum by stratum as in Datalog. Other
recursive predicates are not supported by planning.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace

import networkx as nx

from knowledge_base.errors import SchemaError
from knowledge_base.facts import Delta, Fact, Value
from knowledge_base.language.evaluation.evaluator import query
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax.expression import (
    And,
    Atom,
    Comparison,
    Constant,
    Expression,
    Or,
    Term,
    Variable,
    substitute,
)
from knowledge_base.language.syntax.identity_cache import IdentityCache
from knowledge_base.world.overlay import Overlay
from planning.domain import Axiom, PlanningDomain
from planning.problem.expressions import changed, denied, names_of, rewritten, type_test, with_atoms

_AXIOMS = "planners with axioms of their own, such as Fast Downward run by itself"


def derivation(domain: PlanningDomain) -> Derivation:
    """Return the derivation of a domain; cached by identity.

    Raises:
        SchemaError: a predicate depends on its own negation.
    """
    return _known.find(domain, None) or _known.keep(domain, None, Derivation(domain))


class Derivation:
    """A domain without its derived predicates, and the expressions or facts that replace these predicates.

    Attributes:
        original: the domain with derived predicates.
        domain: the domain in which conditions replace the non-recursive derived predicates.
        changing: the predicates and functions that actions change.
        unsupported: the inputs that actions change, by the recursive predicate that depends on them.
    """

    def __init__(self, domain: PlanningDomain) -> None:
        self.original = domain
        self._axioms: dict[str, list[Axiom]] = {}
        for axiom in domain.axioms:
            self._axioms.setdefault(axiom.predicate, []).append(axiom)
        self._expanded: IdentityCache[Expression, Expression] = IdentityCache(size=256)
        graph = self._dependencies(domain.axioms)
        self._circles = [circle for circle in _strata(graph) if _is_circle(circle, graph)]
        self._recursive = frozenset().union(*self._circles)
        self._schema = domain.schema
        self.changing = frozenset[str]().union(*(changed(action.effect) for action in domain.actions.values()))
        reached = {name: {name, *nx.descendants(graph, name)} for name in self._recursive}
        affected = {name: self.changing & follows for name, follows in reached.items()}
        self.unsupported = {name: causes for name, causes in affected.items() if causes}
        if domain.axioms:
            actions = {name: rewritten(action, self.expand) for name, action in domain.actions.items()}
            domain = replace(domain, actions=actions, axioms=())
        self.domain = domain

    def expand(self, e: Expression) -> Expression:
        """Return the condition with each non-recursive derived predicate replaced by its condition."""
        if not self._axioms:
            return e
        # An equal condition must give an identical object, because other caches use its identity as the key.
        return self._expanded.find(e, None) or self._expanded.keep(e, None, self._expand(e))

    def _expand(self, e: Expression) -> Expression:
        return with_atoms(e, self._cases)

    def _cases(self, atom: Atom) -> Expression:
        if atom.predicate not in self._axioms or atom.predicate in self._recursive:
            return atom
        cases = tuple(self._expand(self._instance(axiom, atom)) for axiom in self._axioms[atom.predicate])
        return cases[0] if len(cases) == 1 else Or(cases)

    def world(self, world: World) -> World:
        """Return the world with the facts of those recursive predicates that no action affects."""
        return self._closed(world, [one for one in self._circles if self.unsupported.keys().isdisjoint(one)])

    def complete(self, world: World) -> World:
        """Return the world with the facts of all recursive predicates."""
        return self._closed(world, self._circles)

    def _closed(self, world: World, circles: Collection[frozenset[str]]) -> World:
        if not circles:
            return world
        closed = Overlay(world)
        for circle in circles:  # each set of predicates comes after its inputs
            while facts := [fact for fact in self._consequences(circle, closed) if not _holds(fact, closed)]:
                closed.apply(Delta(added=tuple(dict.fromkeys(facts))))
        return closed

    def at(self, world: World) -> Settled:
        """Return the domain for this world; the result is valid until an input of a recursive predicate changes."""
        closed = self.world(world)
        supported = [name for circle in self._circles for name in sorted(circle) if name not in self.unsupported]
        facts = frozenset(
            Fact(name, tuple(args))
            for name in supported
            for args in closed.match(name, (None,) * len(self._schema.predicates[name].parameters))
        )
        return Settled(self, facts, frozenset(supported))

    def may_change(self, e: Expression) -> bool:
        """Return whether some action may change the truth of the condition; the result `False` is certain."""
        changing = self.changing.union(self._schema.computed, self.unsupported)
        fixed = self._schema.predicates.keys() - changing
        return not all(name in fixed or self._schema.is_type(name, 1) for name in names_of(e))

    @property
    def recursive(self) -> bool:
        """Whether a derived predicate is recursive, so that its replacement depends on the world."""
        return bool(self._recursive)

    def why(self, name: str) -> str:
        """Return why a predicate is not supported, and which planners support it."""
        changing = ", ".join(f"'{one}'" for one in sorted(self.unsupported[name]))
        return (
            f"'{name}', a derived predicate that follows from itself (at {self._axioms[name][0].place}) and from what"
            f" planning actions change ({changing}); what can do it: {_AXIOMS}"
        )

    def _dependencies(self, axioms: Iterable[Axiom]) -> nx.DiGraph[str]:
        """Return the graph with an edge from each predicate to each of its inputs."""
        graph: nx.DiGraph[str] = nx.DiGraph()
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

    def _instance(self, axiom: Axiom, atom: Atom) -> Expression:
        """Return the axiom's condition for the atom's arguments, with type tests if the axiom restricts a type."""
        declared = self._schema.predicates[axiom.predicate].parameters
        tests = tuple(
            type_test(own, term)
            for own, wide, term in zip(axiom.parameters, declared, atom.args, strict=True)
            if own.types != wide.types
        )
        terms = dict(zip((p.name for p in axiom.parameters), atom.args, strict=True))
        condition = substitute(axiom.condition, terms)
        return And((*tests, condition)) if tests else condition

    def _consequences(self, circle: Iterable[str], world: World) -> Iterator[Fact]:
        """Yield the facts that the axioms of these predicates derive in `world`."""
        for name in sorted(circle):
            for axiom in self._axioms[name]:
                tests = (type_test(p, Variable(p.name)) for p in axiom.parameters)
                for found in query(And((*tests, self.expand(axiom.condition))), world):
                    yield Fact(name, tuple(found[p.name] for p in axiom.parameters))


@dataclass(frozen=True, slots=True)
class Settled:
    """A domain without derived predicates, so that the knowledge base can evaluate its conditions.

    Attributes:
        derivation: the derivation of the domain.
        facts: the facts that replace the recursive predicates.
        predicates: the recursive predicates that these facts replace.
    """

    derivation: Derivation = field(compare=False, repr=False)
    facts: frozenset[Fact]
    predicates: frozenset[str]

    @property
    def domain(self) -> PlanningDomain:
        """The domain without derived predicates."""
        domain = self.derivation.domain
        if not self.predicates:
            return domain
        actions = {name: rewritten(action, self._replaced) for name, action in domain.actions.items()}
        return replace(domain, actions=actions)

    def condition(self, e: Expression) -> Expression:
        """Return the condition with derived predicates replaced."""
        expanded = self.derivation.expand(e)
        return self._replaced(expanded) if self.predicates else expanded

    def _replaced(self, e: Expression) -> Expression:
        return with_atoms(e, self._listed)

    def _listed(self, atom: Atom) -> Expression:
        if atom.predicate not in self.predicates:
            return atom
        known = sorted((one.args for one in self.facts if one.predicate == atom.predicate), key=str)
        return Or(tuple(And(tuple(map(_equal, atom.args, values))) for values in known), place=atom.place)


def _equal(term: Term, value: Value) -> Expression:
    return Comparison("=", term, Constant(value))


_known: IdentityCache[PlanningDomain, Derivation] = IdentityCache(size=64)


def _strata(graph: nx.DiGraph[str]) -> Iterator[frozenset[str]]:
    """Yield the strongly connected sets of predicates, each after its inputs."""
    components = nx.condensation(graph)
    for number in reversed(list(nx.topological_sort(components))):
        yield frozenset(components.nodes[number]["members"])


def _is_circle(component: frozenset[str], graph: nx.DiGraph[str]) -> bool:
    return len(component) > 1 or any(graph.has_edge(name, name) for name in component)


def _holds(fact: Fact, world: World) -> bool:
    return world.holds(fact.predicate, fact.args)
