"""Conditions after everything that cannot change was evaluated: what is left for a planner to decide.

Quantifiers are expanded over the known objects; types, equality, numbers and predicates that no action
changes, computed ones too, are evaluated on the world (partial evaluation). What remains is in negation normal form.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import TYPE_CHECKING

from knowledge_base.facts import Fact, Value
from knowledge_base.language.effect import Add, AllOf, Assign, Delete, Effect, ForEach, When
from knowledge_base.language.evaluation import World, evaluate_argument, holds
from knowledge_base.language.expression import (
    And,
    Atom,
    Comparison,
    Constant,
    Exists,
    Expression,
    Forall,
    Imply,
    Not,
    Or,
    Term,
    TypedVariable,
    Variable,
)

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator, Mapping


@dataclass(frozen=True, slots=True)
class Literal:
    """A ground fact that shall hold, or shall not."""

    fact: Fact
    positive: bool = True

    @property
    def negated(self) -> Literal:
        """The opposite."""
        return Literal(self.fact, not self.positive)


@dataclass(frozen=True, slots=True)
class Every:
    """All parts; never empty, never nested."""

    parts: tuple[Residual, ...]


@dataclass(frozen=True, slots=True)
class Some:
    """At least one part; never empty, never nested."""

    parts: tuple[Residual, ...]


Residual = bool | Literal | Every | Some
"""What is left of a condition: already decided, or a formula of literals."""


def every(parts: Iterable[Residual]) -> Residual:
    """The conjunction, simplified."""
    kept: dict[Residual, None] = {}
    for part in parts:
        if part is False:
            return False
        kept.update(dict.fromkeys(part.parts if isinstance(part, Every) else (part,)))
    kept.pop(True, None)
    return True if not kept else next(iter(kept)) if len(kept) == 1 else Every(tuple(kept))


def some(parts: Iterable[Residual]) -> Residual:
    """The disjunction, simplified."""
    kept: dict[Residual, None] = {}
    for part in parts:
        if part is True:
            return True
        kept.update(dict.fromkeys(part.parts if isinstance(part, Some) else (part,)))
    kept.pop(False, None)
    return False if not kept else next(iter(kept)) if len(kept) == 1 else Some(tuple(kept))


def negation(residual: Residual) -> Residual:
    """The opposite, in negation normal form."""
    match residual:
        case bool():
            return not residual
        case Literal():
            return residual.negated
        case Every(parts):
            return some(map(negation, parts))
        case Some(parts):
            return every(map(negation, parts))


def alternatives(residual: Residual) -> Iterator[tuple[Literal, ...]]:
    """The disjunctive normal form, one conjunction of literals after the other, contradictions left out.

    There may be exponentially many; take as many as you can bear.
    """
    match residual:
        case bool():
            yield from [()] if residual else []
        case Literal():
            yield (residual,)
        case Some(parts):
            yield from itertools.chain.from_iterable(map(alternatives, parts))
        case Every(parts):
            for choice in itertools.product(*(tuple(alternatives(part)) for part in parts)):
                conjunction = dict.fromkeys(itertools.chain.from_iterable(choice))
                if not any(literal.negated in conjunction for literal in conjunction):
                    yield tuple(conjunction)


@dataclass(frozen=True, slots=True)
class ConditionalFact:
    """One ground effect: the fact is added or deleted if the condition held before."""

    condition: Residual
    fact: Fact
    added: bool


@dataclass(frozen=True, slots=True)
class Grounder:
    """Evaluates what cannot change.

    Attributes:
        world: the present.
        changing: the predicates that the considered actions change.
        keep_false: leave unchangeable facts that do not hold in the result, so that a goal which needs them
            can say which they are.
    """

    world: World
    changing: frozenset[str]
    keep_false: bool = False

    def residual(self, e: Expression, bindings: Mapping[str, Value], *, wanted: bool = True) -> Residual:
        """What is left of `e` (of its negation if not `wanted`) for the planner."""
        match e:
            case Atom():
                return self._atom(e, bindings, wanted=wanted)
            case Not(body):
                return self.residual(body, bindings, wanted=not wanted)
            case And(parts) | Or(parts):
                join = every if isinstance(e, And) is wanted else some
                return join(self.residual(part, bindings, wanted=wanted) for part in parts)
            case Imply(premise, conclusion):
                return self.residual(Or((Not(premise), conclusion)), bindings, wanted=wanted)
            case Exists(variables, body) | Forall(variables, body):
                join = every if isinstance(e, Forall) is wanted else some
                return join(
                    self.residual(body, inner, wanted=wanted) for inner in self.choices(variables, bindings)
                )
            case Comparison():
                return holds(e, self.world, bindings) is wanted

    def effects(
        self,
        effect: Effect,
        bindings: Mapping[str, Value],
        condition: Residual = True,  # noqa: FBT002  a formula that is decided already
    ) -> Iterator[ConditionalFact]:
        """The ground effects on changing predicates; effects on numbers are left out."""
        match effect:
            case Add(atom) | Delete(atom):
                if atom.predicate in self.changing:
                    yield ConditionalFact(condition, self.fact(atom, bindings), added=isinstance(effect, Add))
            case AllOf(parts):
                for part in parts:
                    yield from self.effects(part, bindings, condition)
            case ForEach(variables, body):
                for inner in self.choices(variables, bindings):
                    yield from self.effects(body, inner, condition)
            case When(premise, body):
                both = every([condition, self.residual(premise, bindings)])
                if both is not False:
                    yield from self.effects(body, bindings, both)
            case Assign():
                return

    def choices(
        self, variables: Iterable[TypedVariable], bindings: Mapping[str, Value]
    ) -> Iterator[dict[str, Value]]:
        """The bindings extended by every choice of objects for `variables`."""
        chosen = list(variables)
        for values in itertools.product(*map(self.objects, chosen)):
            yield {**bindings, **dict(zip((v.name for v in chosen), values, strict=True))}

    def objects(self, variable: TypedVariable) -> dict[str, None]:
        """What the variable may stand for, as a set in order."""
        types = variable.types or ("object",)
        return dict.fromkeys(name for one in types for name in self.world.objects(one))

    def fact(self, atom: Atom, bindings: Mapping[str, Value]) -> Fact:
        """The atom with values for its terms."""
        return Fact(atom.predicate, tuple(self._value(term, bindings) for term in atom.args))

    def _value(self, term: Term, bindings: Mapping[str, Value]) -> Value:
        match term:
            case Variable(name) if name in bindings:
                return bindings[name]
            case Constant(value):
                return value
            case _:
                return evaluate_argument(term, self.world, bindings)

    def _atom(self, atom: Atom, bindings: Mapping[str, Value], *, wanted: bool) -> Residual:
        schema = self.world.schema
        if schema.is_type(atom.predicate, len(atom.args)):
            return holds(atom, self.world, bindings) is wanted
        ground = self.fact(atom, bindings)
        if atom.predicate in self.changing:
            return Literal(ground, wanted)
        if atom.predicate in schema.computed:
            so = holds(atom, self.world, bindings) is wanted
        else:
            so = self.world.holds(ground.predicate, ground.args) is wanted
        return Literal(ground, wanted) if self.keep_false and not so else so
