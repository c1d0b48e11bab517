"""Derived predicates (PDDL 2.2 axioms): compiled away, or evaluated if no action changes their inputs.

Each atom of a non-recursive predicate is replaced by the predicate's condition. A recursive predicate, such as `above`,
is replaced by facts if no action changes its inputs: the least fixpoint, stratum by stratum as in Datalog. Other
recursive predicates are not supported by planning.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace

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
)
from knowledge_base.language.syntax.rewriting import names_of, with_atoms
from knowledge_base.owner_cache import cache_on_owner
from knowledge_base.world.derived import Definitions, type_test
from knowledge_base.world.overlay import Overlay
from planning.model.domain import PlanningDomain
from planning.problem.expressions import changed, rewritten

_AXIOMS = "planners with axioms of their own, such as Fast Downward run by itself"


@cache_on_owner
def derivation(domain: PlanningDomain) -> Derivation:
    """Return the derivation of a domain; kept on it.

    Raises:
        SchemaError: a predicate depends on its own negation.
    """
    return Derivation(domain)


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
        self._definitions = Definitions(domain.axioms, domain.schema.predicates, typed=False)
        self._schema = domain.schema
        self.changing = frozenset[str]().union(*(changed(action.effect) for action in domain.actions.values()))
        affected = {name: self.changing & self._definitions.inputs(name) for name in self._definitions.recursive}
        self.unsupported = {name: causes for name, causes in affected.items() if causes}
        if domain.axioms:
            actions = {name: rewritten(action, self.expand) for name, action in domain.actions.items()}
            domain = replace(domain, actions=actions, axioms=())
        self.domain = domain

    def expand(self, e: Expression) -> Expression:
        """Return the condition with each non-recursive derived predicate replaced by its condition."""
        return self._definitions.expanded(e)

    def world(self, world: World) -> World:
        """Return the world with the facts of those recursive predicates that no action affects."""
        return self._close(world, [one for one in self._definitions.circles if self.unsupported.keys().isdisjoint(one)])

    def complete(self, world: World) -> World:
        """Return the world with the facts of all recursive predicates."""
        return self._close(world, self._definitions.circles)

    def _close(self, world: World, circles: Collection[frozenset[str]]) -> World:
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
        supported = [
            name for circle in self._definitions.circles for name in sorted(circle) if name not in self.unsupported
        ]
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
    def recursive(self) -> frozenset[str]:
        """The recursive predicates; their replacement depends on the world."""
        return self._definitions.recursive

    def why(self, name: str) -> str:
        """Return why a predicate is not supported, and which planners support it."""
        changing = ", ".join(f"'{one}'" for one in sorted(self.unsupported[name]))
        place = self._definitions.axioms[name][0].place
        return (
            f"'{name}', a derived predicate that follows from itself (at {place}) and from what planning actions change"
            f" ({changing}); what can do it: {_AXIOMS}"
        )

    def _consequences(self, circle: Iterable[str], world: World) -> Iterator[Fact]:
        """Yield the facts that the axioms of these predicates derive in `world`."""
        for name in sorted(circle):
            for axiom in self._definitions.axioms[name]:
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
        return with_atoms(e, self._list_facts)

    def _list_facts(self, atom: Atom) -> Expression:
        if atom.predicate not in self.predicates:
            return atom
        known = sorted((one.args for one in self.facts if one.predicate == atom.predicate), key=str)
        return Or(tuple(And(tuple(map(_equal, atom.args, values))) for values in known), place=atom.place)


def _equal(term: Term, value: Value) -> Expression:
    return Comparison("=", term, Constant(value))


def _holds(fact: Fact, world: World) -> bool:
    return world.holds(fact.predicate, fact.args)
