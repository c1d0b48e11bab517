"""The world of a foresight: a copy of the robot's knowledge that refuses unknown names (S1.10)."""

from __future__ import annotations

from functools import cached_property, partial
from typing import TYPE_CHECKING

from knowledge_base.errors import SchemaError, UnknownNameError
from knowledge_base.language.checking.check import value_fits
from knowledge_base.language.checking.relations import relation, relation_names
from knowledge_base.language.syntax.expression import And, Atom, Constant, TypedVariable, Variable
from knowledge_base.user_objects import shown
from knowledge_base.view import View
from knowledge_base.world.derived import type_test
from planning.problem.derived import derivation

if TYPE_CHECKING:
    from collections.abc import Iterable

    from knowledge_base.facts import Content, Delta, Value
    from knowledge_base.language.evaluation.world_protocol import World
    from knowledge_base.store import KnowledgeBase
    from planning.model.domain import PlanningDomain


class ForesightWorld(View):
    """A copy of the robot's knowledge for one simulation, with queries.

    Unlike another view, it refuses unknown objects and objects of a wrong type. `holds` and `match` also find facts
    that are derived, computed, or provided by the running program.

    Args:
        domain: the domain, whose axioms define the derived predicates.
        knowledge: the knowledge of the robot.
        expected: the changes that the running steps will cause.
    """

    def __init__(self, domain: PlanningDomain, knowledge: KnowledgeBase, expected: Delta) -> None:
        state = knowledge.snapshot()
        state.commit(expected)
        live = [one for one in map(relation, relation_names()) if one is not None]
        state.provide({one.name: partial(knowledge.match, one.name, (None,) * one.arity) for one in live})
        super().__init__(state, knowledge.version)
        self._without_facts = {*state.schema.computed, *(axiom.predicate for axiom in state.schema.axioms)}
        self._derivation = derivation(domain)

    @cached_property
    def _complete(self) -> World:
        """The world with the facts of recursive predicates."""
        return self._derivation.complete(self._state)

    def holds(self, predicate: str, args: tuple[Value, ...]) -> bool:
        """Return whether the fact is true; the name of a type asks for the type of an object.

        Raises:
            UnknownNameError: there is no such predicate, type or object.
            SchemaError: a wrong number of arguments, or an object of a wrong type.
            InputError: the arguments are not a tuple.
        """
        found = super().holds(predicate, args)
        self._require_things(predicate, args)
        return bool(self._answers(predicate, args)) if predicate in self._without_facts else found

    def match(self, predicate: str, pattern: tuple[Value | None, ...]) -> list[tuple[Value, ...]]:
        """Return the arguments of all facts that match `pattern`; errors are as for `holds`."""
        found = super().match(predicate, pattern)
        self._require_things(predicate, pattern)
        return self._answers(predicate, pattern) if predicate in self._without_facts else found

    def value(self, function: str, args: tuple[Value, ...]) -> Content:
        """Return the value of the function; errors are as for `holds`."""
        found = super().value(function, args)
        self._require_fitting(function, self.schema.function(function).parameters, args)
        return found

    def _require_things(self, predicate: str, args: Iterable[Value | None]) -> None:
        if predicate in self.schema.predicates or predicate in self.schema.computed:
            self._require_fitting(predicate, self.schema.predicate(predicate).parameters, args)

    def _require_fitting(self, name: str, parameters: tuple[TypedVariable, ...], args: Iterable[Value | None]) -> None:
        for parameter, value in zip(parameters, args, strict=True):
            if value is None or value_fits(value, parameter.types):
                continue
            kind = self._state.type_of(value) if isinstance(value, str) else None
            if kind is None:
                message = f"there is no object {shown(value)}, which '?{parameter.name}' of '{name}' would be"
                raise UnknownNameError(message, found=str(value), valid=self._state.objects("object"))
            if not self.schema.fits(kind, parameter.types):
                wanted = " or ".join(parameter.types)
                message = f"'{value}' is of type {kind}, but '?{parameter.name}' of '{name}' is of type {wanted}"
                raise SchemaError(message, found=str(value))

    def _answers(self, predicate: str, pattern: tuple[Value | None, ...]) -> list[tuple[Value, ...]]:
        """Return the arguments for which a derived or computed predicate is true."""
        if predicate in self._derivation.recursive:
            return list(self._complete.match(predicate, pattern))
        declared = list(zip(self.schema.predicate(predicate).parameters, pattern, strict=True))
        terms = tuple(Variable(one.name) if value is None else Constant(value) for one, value in declared)
        tests = (type_test(one, Variable(one.name)) for one, value in declared if value is None)
        rows = self.query(And((*tests, Atom(predicate, terms))))
        return [tuple(row[one.name] if value is None else value for one, value in declared) for row in rows]
