"""An effect applied: which facts and values it changes on a given world, as a `Delta`."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Mapping

from knowledge_base.content import require_content
from knowledge_base.errors import SchemaError
from knowledge_base.facts import Content, Delta, Fact, Value
from knowledge_base.language.check import check_arity
from knowledge_base.language.depth import check_depth
from knowledge_base.language.effect import Add, AllOf, Delete, Effect, ForEach, NumericEffect, When
from knowledge_base.language.evaluator import NO_BINDINGS, evaluate_argument, evaluate_term, holds
from knowledge_base.language.expression import Arithmetic, Atom, Call, Constant, TypedVariable
from knowledge_base.language.terms import Bindings, as_number
from knowledge_base.language.world import World

_ARITHMETIC = {"increase": "+", "decrease": "-", "scale-up": "*", "scale-down": "/"}


def apply_effect(effect: Effect, world: World, bindings: Mapping[str, Value] = NO_BINDINGS) -> Delta:
    """What `effect` changes on `world`, which itself is left alone.

    All conditions and values are those of the world before (PDDL 2.1). A fact both deleted and added is
    added. Several changes of one number in an effect add up; two different assignments contradict.

    Raises:
        UnknownNameError: a variable is not bound, or a name is not declared.
        SchemaError: contradicting assignments, a wrong number of arguments, arithmetic on no number.
        InputError: it is nested too deeply.
    """
    check_depth(effect)
    application = _Application(world)
    application.apply(effect, bindings)
    added = tuple(application.added)
    removed = tuple(f for f in application.removed if f not in application.added)
    return Delta(removed=removed, added=added, values=application.values)


def choices(variables: tuple[TypedVariable, ...], world: World) -> Iterator[dict[str, Value]]:
    """Every choice of things for `variables`, in order of insertion."""
    things = [
        tuple(dict.fromkeys(thing for t in v.types or ("object",) for thing in world.objects(t))) for v in variables
    ]
    for chosen in itertools.product(*things):
        yield {v.name: thing for v, thing in zip(variables, chosen, strict=True)}


class _Application:
    """Collects changes; dicts stand for ordered sets."""

    def __init__(self, world: World) -> None:
        self.world = world
        self.added: dict[Fact, None] = {}
        self.removed: dict[Fact, None] = {}
        self.values: dict[Fact, Content] = {}
        self.computed: set[Fact] = set()
        self.spend: Callable[[], None] | None = getattr(world, "spend", None)

    def apply(self, effect: Effect, bindings: Bindings) -> None:
        if self.spend is not None:
            self.spend()
        match effect:
            case Add(atom):
                self.added[self.fact(atom, bindings)] = None
            case Delete(atom):
                self.removed[self.fact(atom, bindings)] = None
            case AllOf(parts):
                for part in parts:
                    self.apply(part, bindings)
            case ForEach(variables, inner):
                for choice in choices(variables, self.world):
                    self.apply(inner, {**bindings, **choice})
            case When(condition, inner):
                if holds(condition, self.world, bindings):
                    self.apply(inner, bindings)
            case NumericEffect():
                self.assign(effect, bindings)

    def fact(self, atom: Atom, bindings: Bindings) -> Fact:
        signature = self.world.schema.told(atom.predicate, atom.place)
        check_arity(signature, len(atom.args), atom.place)
        return self.instance(atom.predicate, atom, bindings)

    def instance(self, name: str, form: Atom | Call, bindings: Bindings) -> Fact:
        return Fact(name, tuple(evaluate_argument(a, self.world, bindings) for a in form.args))

    def assign(self, effect: NumericEffect, bindings: Bindings) -> None:
        call, operator = effect.call, effect.operator
        fluent = self.instance(call.function, call, bindings)
        old = self.values.get(fluent, evaluate_term(call, self.world, bindings))
        change = evaluate_term(effect.value, self.world, bindings)
        again = fluent in self.values
        if operator == "assign":
            require_content(change, self.world.schema.result(call.function), fluent, effect.place)
            self.refuse(again and (fluent in self.computed or old != change), fluent, effect)
            self.values[fluent] = change
            return
        self.refuse(again and fluent not in self.computed, fluent, effect)
        self.computed.add(fluent)
        sides = tuple(Constant(as_number(side, operator, effect.place)) for side in (old, change))
        self.values[fluent] = evaluate_term(Arithmetic(_ARITHMETIC[operator], sides, place=effect.place), self.world)

    def refuse(self, contradicts: bool, fluent: Fact, effect: NumericEffect) -> None:  # noqa: FBT001
        if contradicts:
            raise SchemaError(f"the effect changes {fluent} in two ways that contradict", place=effect.place)
