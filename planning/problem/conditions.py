"""Ground conditions after partial evaluation: the residual, whose truth depends on the plan.

Quantifiers are expanded over the known objects. Types, equality, numbers, and predicates that no action changes
(including computed predicates) are evaluated on the world. The residual is in negation normal form. Its leaves are
literals, and bounds on numbers that actions change.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

from knowledge_base.errors import InputError
from knowledge_base.facts import Fact, Value
from knowledge_base.language.evaluation.evaluator import evaluate_argument, evaluate_term, holds
from knowledge_base.language.evaluation.world_protocol import World
from knowledge_base.language.syntax import expression as ex
from knowledge_base.language.syntax.effect import Add, AllOf, Delete, Effect, ForEach, NumericEffect, When
from knowledge_base.language.syntax.expression import Atom, Expression, Term
from knowledge_base.language.syntax.text import to_text
from planning.model.cancellable_work import WorkLimit
from planning.model.problem import UnsupportedActionError
from planning.model.quantities import OPPOSITE, Assignment, NumericBound, Quantity, combined


@dataclass(frozen=True, slots=True)
class Literal:
    """A ground fact that must be true, or must be false."""

    fact: Fact
    positive: bool = True

    def __hash__(self) -> int:
        """Return the hash of the dataclass, computed in one call because literals are frequent dictionary keys."""
        return hash((self.fact.predicate, self.fact.args, self.positive))

    @property
    def negated(self) -> Literal:
        """The literal with the opposite truth value."""
        return Literal(self.fact, not self.positive)


@dataclass(frozen=True, slots=True)
class Every:
    """A conjunction that is never empty and contains no conjunction."""

    parts: tuple[Residual, ...]


@dataclass(frozen=True, slots=True)
class Some:
    """A disjunction that is never empty and contains no disjunction."""

    parts: tuple[Residual, ...]


Leaf = Literal | NumericBound
Residual = bool | Leaf | Every | Some
"""The residual of a condition: a truth value, or a formula of literals and bounds."""


def every(parts: Iterable[Residual]) -> Residual:
    """Return the simplified conjunction of the residuals."""
    kept: dict[Residual, None] = {}
    for part in parts:
        if part is False:
            return False
        kept.update(dict.fromkeys(part.parts if isinstance(part, Every) else (part,)))
    kept.pop(True, None)
    return True if not kept else next(iter(kept)) if len(kept) == 1 else Every(tuple(kept))


def some(parts: Iterable[Residual]) -> Residual:
    """Return the simplified disjunction of the residuals."""
    kept: dict[Residual, None] = {}
    for part in parts:
        if part is True:
            return True
        kept.update(dict.fromkeys(part.parts if isinstance(part, Some) else (part,)))
    kept.pop(False, None)
    return False if not kept else next(iter(kept)) if len(kept) == 1 else Some(tuple(kept))


def negation(residual: Residual) -> Residual:
    """Return the negation of the residual, in negation normal form."""
    match residual:
        case bool():
            return not residual
        case Literal():
            return residual.negated
        case NumericBound("=", left, right):
            return _apart(left, right)
        case NumericBound(operator, left, right):
            return NumericBound(OPPOSITE[operator], left, right)
        case Every(parts):
            return some(map(negation, parts))
        case Some(parts):
            return every(map(negation, parts))


def _apart(left: Quantity, right: Quantity) -> Residual:
    """Return `!=` as a disjunction of `<` and `>`, since engines support only these operators."""
    return Some((NumericBound("<", left, right), NumericBound(">", left, right)))


def alternatives(residual: Residual) -> Iterator[tuple[Leaf, ...]]:
    """Yield the conjunctions of the disjunctive normal form, without contradictory ones.

    The number of conjunctions may be exponential, so the caller must limit it.
    """
    match residual:
        case bool():
            yield from [()] if residual else []
        case Literal() | NumericBound():
            yield (residual,)
        case Some(parts):
            yield from itertools.chain.from_iterable(map(alternatives, parts))
        case Every(parts):
            for choice in itertools.product(*(tuple(alternatives(part)) for part in parts)):
                conjunction = dict.fromkeys(itertools.chain.from_iterable(choice))
                if not any(isinstance(one, Literal) and one.negated in conjunction for one in conjunction):
                    yield tuple(conjunction)


@dataclass(frozen=True, slots=True)
class GroundEffect:
    """One ground effect: a literal becomes true, or a number changes, if the condition held before the effect."""

    condition: Residual
    what: Literal | Assignment


def is_so(fact: Fact, world: World) -> bool:
    """Return whether the fact is true; computed predicates are evaluated, since a world stores no facts of them."""
    if fact.predicate in world.schema.computed:
        return holds(Atom(fact.predicate, tuple(map(ex.Constant, fact.args))), world)
    return world.holds(fact.predicate, fact.args)


@dataclass(frozen=True, slots=True)
class Grounder:
    """Evaluator that partially evaluates conditions and effects on a world.

    Attributes:
        world: the present world.
        changing: the predicates and functions that the relevant actions change.
        keep_false: whether residuals keep unchangeable facts that are false, so that messages can identify them.
        patience: the limit of the work; each choice of objects counts.
    """

    world: World
    changing: frozenset[str]
    keep_false: bool = False
    patience: WorkLimit = field(default_factory=WorkLimit, compare=False)

    def precondition(self, e: Expression, bindings: Mapping[str, Value]) -> Residual:
        """Return the residual of `e`, in which each fact that must be true or false is kept, even if it cannot change.

        The result does not depend on these facts, so it stays valid if an external change affects them.
        """
        match e:
            case ex.And(parts):
                return every(self.precondition(part, bindings) for part in parts)
            case Atom(name) if name in self.world.schema.predicates:
                return Literal(self.fact(e, bindings))
            case ex.Not(Atom(name) as atom) if name in self.world.schema.predicates:
                return Literal(self.fact(atom, bindings), positive=False)
            case _:
                return self.residual(e, bindings)

    def residual(self, e: Expression, bindings: Mapping[str, Value], *, wanted: bool = True) -> Residual:
        """Return the residual of `e`, or of the negation of `e` if `wanted` is false.

        Raises:
            UnsupportedActionError: an argument of a fact is a number that actions change.
        """
        match e:
            case Atom():
                found = self._atom(e, bindings, wanted=wanted)
            case ex.Not(body):
                found = self.residual(body, bindings, wanted=not wanted)
            case ex.And(parts) | ex.Or(parts):
                join = every if isinstance(e, ex.And) is wanted else some
                found = join(self.residual(part, bindings, wanted=wanted) for part in parts)
            case ex.Imply(premise, conclusion):
                found = self.residual(ex.Or((ex.Not(premise), conclusion)), bindings, wanted=wanted)
            case ex.Exists(variables, body) | ex.Forall(variables, body):
                join = every if isinstance(e, ex.Forall) is wanted else some
                choices = self.choices(variables, bindings)
                found = join(self.residual(body, inner, wanted=wanted) for inner in choices)
            case ex.Comparison():
                found = self._comparison(e, bindings, wanted=wanted)
        return found

    def effects(
        self,
        effect: Effect,
        bindings: Mapping[str, Value],
        condition: Residual = True,  # noqa: FBT002  a formula that is decided already
    ) -> Iterator[GroundEffect]:
        """Yield the ground effects on the predicates and functions in `changing`."""
        match effect:
            case Add(atom) | Delete(atom):
                if atom.predicate in self.changing:
                    yield GroundEffect(condition, Literal(self.fact(atom, bindings), isinstance(effect, Add)))
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
            case NumericEffect():
                if effect.call.function in self.changing:
                    yield GroundEffect(condition, self._assignment(effect, bindings))

    def choices(
        self, variables: Iterable[ex.TypedVariable], bindings: Mapping[str, Value]
    ) -> Iterator[dict[str, Value]]:
        """Yield `bindings`, extended by every combination of objects for `variables`.

        Raises:
            WorkLimitError: the limit has passed before the last combination.
        """
        chosen = list(variables)
        for values in itertools.product(*map(self.objects, chosen)):
            self.patience.spend()
            yield {**bindings, **dict(zip((v.name for v in chosen), values, strict=True))}

    def objects(self, variable: ex.TypedVariable) -> dict[str, None]:
        """Return the objects of the variable's types, as an ordered set."""
        types = variable.types or ("object",)
        return dict.fromkeys(name for one in types for name in self.world.objects(one))

    def fact(self, atom: Atom | ex.Call, bindings: Mapping[str, Value]) -> Fact:
        """Return the atom or numeric fluent with the values of its terms as arguments.

        Raises:
            UnsupportedActionError: a term is a number that actions change.
        """
        name = atom.predicate if isinstance(atom, Atom) else atom.function
        return Fact(name, tuple([self._value(term, bindings) for term in atom.args]))

    def quantity(self, term: Term, bindings: Mapping[str, Value]) -> Quantity:
        """Return the value of the term; fluents that actions change stay symbolic.

        Raises:
            InputError: the value is not a number, or a divisor is zero.
        """
        match term:
            case ex.Call(function) if function in self.changing:
                return self.fact(term, bindings)
            case ex.Arithmetic(operator, args) if self.changes(term):
                try:
                    return combined(operator, tuple(self.quantity(arg, bindings) for arg in args))
                except ArithmeticError as error:
                    raise InputError(f"{to_text(term)} cannot be computed: {error}", place=term.place) from None
            case _:
                number = evaluate_term(term, self.world, bindings)
                if not isinstance(number, int | float):
                    raise InputError(f"'{number}' is not a number", place=term.place)
                return number

    def changes(self, e: Expression | Term) -> bool:
        """Return whether the term or condition reads a number that actions change."""
        return (isinstance(e, ex.Call) and e.function in self.changing) or any(map(self.changes, ex.parts_of(e)))

    def _comparison(self, e: ex.Comparison, bindings: Mapping[str, Value], *, wanted: bool) -> Residual:
        if not self.changes(e):
            return holds(e, self.world, bindings) is wanted
        left, right = self.quantity(e.left, bindings), self.quantity(e.right, bindings)
        bound = _apart(left, right) if e.operator == "!=" else NumericBound(e.operator, left, right)
        return bound if wanted else negation(bound)

    def _assignment(self, effect: NumericEffect, bindings: Mapping[str, Value]) -> Assignment:
        fluent, amount = self.fact(effect.call, bindings), self.quantity(effect.value, bindings)
        match effect.operator:
            case "increase":
                return Assignment(fluent, amount, increase=True)
            case "decrease":
                return Assignment(fluent, combined("-", (amount,)), increase=True)
            case "scale-up":
                return Assignment(fluent, combined("*", (fluent, amount)), increase=False)
            case "scale-down":
                return Assignment(fluent, combined("/", (fluent, amount)), increase=False)
            case _:
                return Assignment(fluent, amount, increase=False)

    def _value(self, term: Term, bindings: Mapping[str, Value]) -> Value:
        match term:
            case ex.Variable(name) if name in bindings:
                return bindings[name]
            case ex.Constant(value):
                return value
            case _ if self.changes(term):
                raise UnsupportedActionError(
                    f"a fact about a number that actions change cannot be planned with: {to_text(term)}",
                    place=term.place,
                )
            case _:
                return evaluate_argument(term, self.world, bindings)

    def _atom(self, atom: Atom, bindings: Mapping[str, Value], *, wanted: bool) -> Residual:
        schema = self.world.schema
        if schema.is_type(atom.predicate, len(atom.args)):
            return holds(atom, self.world, bindings) is wanted
        ground = self.fact(atom, bindings)
        if atom.predicate in self.changing:
            return Literal(ground, wanted)
        so = is_so(ground, self.world) is wanted
        return Literal(ground, wanted) if self.keep_false and not so else so
