"""Effects as frozen values: how an action changes the world (PDDL 2.1 effects with `forall` and `when`)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from knowledge_base.errors import InputError
from knowledge_base.facts import Value
from knowledge_base.language.syntax.expression import (
    Atom,
    Call,
    Constant,
    Expression,
    Located,
    Term,
    TypedVariable,
    Variable,
    free_variables,
    parts_of,
    quantified,
    substitute,
    substitute_term,
    unshadowed,
)
from knowledge_base.language.syntax.identity_cache import IdentityCache
from knowledge_base.language.syntax.sexpr import MAX_DEPTH


@dataclass(frozen=True, slots=True)
class Add(Located):
    """The atom holds afterwards."""

    atom: Atom


@dataclass(frozen=True, slots=True)
class Delete(Located):
    """The atom holds no longer: `(not (on ?i ?s))`."""

    atom: Atom


@dataclass(frozen=True, slots=True)
class AllOf(Located):
    """All parts at once; `(and)` changes nothing."""

    parts: tuple[Effect, ...]


@dataclass(frozen=True, slots=True)
class ForEach(Located):
    """The effect for every choice of known objects: `(forall (?i - item) ...)`."""

    variables: tuple[TypedVariable, ...]
    effect: Effect


@dataclass(frozen=True, slots=True)
class When(Located):
    """The effect if the condition held before."""

    condition: Expression
    effect: Effect


@dataclass(frozen=True, slots=True)
class NumericEffect(Located):
    """What a function is worth changes: `(increase (failures ?i) 1)`; `operator` is one of `ASSIGNMENTS`."""

    operator: str
    call: Call
    value: Term


Effect = Add | Delete | AllOf | ForEach | When | NumericEffect

NO_EFFECT = AllOf(())
"""`(and)`, the effect that changes nothing."""

ASSIGNMENTS = ("assign", "increase", "decrease", "scale-up", "scale-down")
EFFECT_KEYWORDS = ("and", "not", "forall", "when", *ASSIGNMENTS)
"""The words that open an effect and are not predicates."""


def substitute_effect(effect: Effect, bindings: Mapping[str, Value | Term]) -> Effect:
    """The effect with values or terms in place of the variables that `bindings` names; inner variables shadow them."""
    if isinstance(effect, AllOf):
        return AllOf(tuple(substitute_effect(part, bindings) for part in effect.parts))
    if isinstance(effect, ForEach):
        return ForEach(effect.variables, substitute_effect(effect.effect, unshadowed(effect.variables, bindings)))
    if isinstance(effect, When):
        return When(substitute(effect.condition, bindings), substitute_effect(effect.effect, bindings))
    if isinstance(effect, NumericEffect):
        call = Call(effect.call.function, tuple(substitute_term(arg, bindings) for arg in effect.call.args))
        return NumericEffect(effect.operator, call, substitute_term(effect.value, bindings))
    atom = Atom(effect.atom.predicate, tuple(substitute_term(arg, bindings) for arg in effect.atom.args))
    return type(effect)(atom)


def quantified_in(effect: Effect) -> frozenset[str]:
    """The names of the variables that quantifiers in the effect bind."""
    if isinstance(effect, AllOf):
        return frozenset[str]().union(*map(quantified_in, effect.parts))
    if isinstance(effect, ForEach):
        return quantified_in(effect.effect) | {variable.name for variable in effect.variables}
    if isinstance(effect, When):
        return quantified(effect.condition) | quantified_in(effect.effect)
    return frozenset()


def mentioned(part: Expression | Term | Effect) -> frozenset[str]:
    """The variables that a condition, term or effect mentions and does not itself bind."""
    if isinstance(part, Add | Delete):
        return free_variables(part.atom)
    if isinstance(part, AllOf):
        return frozenset().union(*(mentioned(inner) for inner in part.parts))
    if isinstance(part, ForEach):
        return mentioned(part.effect) - {variable.name for variable in part.variables}
    if isinstance(part, When):
        return free_variables(part.condition) | mentioned(part.effect)
    if isinstance(part, NumericEffect):
        return free_variables(part.call) | free_variables(part.value)
    return free_variables(part)


def effect_parts(effect: Effect) -> Iterator[Effect]:
    """The effect and all effects inside it."""
    yield effect
    match effect:
        case AllOf(parts):
            for part in parts:
                yield from effect_parts(part)
        case ForEach(_, body) | When(_, body):
            yield from effect_parts(body)


def effect_leaves(effect: Effect) -> Iterator[Add | Delete | NumericEffect]:
    """The changes an effect consists of."""
    return (part for part in effect_parts(effect) if isinstance(part, Add | Delete | NumericEffect))


def effect_conditions(effect: Effect) -> Iterator[Expression]:
    """The conditions of all conditional effects."""
    return (part.condition for part in effect_parts(effect) if isinstance(part, When))


_Node = Expression | Term | Effect

_judged: IdentityCache[_Node, bool] = IdentityCache()


def check_depth(node: _Node) -> None:
    """Raise `InputError` if `node` is nested deeper than a text may be, `MAX_DEPTH`; remembered by identity."""
    if _judged.find(node, None) is None:
        _judged.keep(node, None, _check(node))


def _check(node: _Node) -> bool:
    level = [node]
    for _ in range(MAX_DEPTH):
        level = [part for one in level for part in _parts(one) if not isinstance(part, Variable | Constant)]
        if not level:
            return True
    raise InputError(f"this is nested more than {MAX_DEPTH} deep", place=level[0].place or node.place)


def _parts(node: _Node) -> tuple[_Node, ...]:
    match node:
        case Add(atom) | Delete(atom):
            return (atom,)
        case AllOf(parts):
            return parts
        case ForEach(_, effect):
            return (effect,)
        case When(condition, effect):
            return (condition, effect)
        case NumericEffect(_, call, value):
            return (call, value)
        case _:
            return parts_of(node)
