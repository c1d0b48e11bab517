"""Effects as immutable values: the changes of an action (PDDL 2.1 effects with `forall` and `when`).

The depth of values that Python code constructs is not limited. `check_depth` checks the depth without recursion,
because all functions that walk through such values are recursive.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from knowledge_base.errors import InputError
from knowledge_base.facts import Value
from knowledge_base.language.syntax.expression import (
    Atom,
    Call,
    Constant,
    Exists,
    Expression,
    Forall,
    Located,
    Term,
    TypedVariable,
    Variable,
    free_variables,
    parts_of,
    substitute,
)
from knowledge_base.language.syntax.identity_cache import IdentityCache
from knowledge_base.language.syntax.sexpr import MAX_DEPTH


@dataclass(frozen=True, slots=True)
class Add(Located):
    """The atom becomes true."""

    atom: Atom


@dataclass(frozen=True, slots=True)
class Delete(Located):
    """The atom becomes false: `(not (on ?i ?s))`."""

    atom: Atom


@dataclass(frozen=True, slots=True)
class AllOf(Located):
    """All parts together; `(and)` changes nothing."""

    parts: tuple[Effect, ...]


@dataclass(frozen=True, slots=True)
class ForEach(Located):
    """The effect for every choice of known objects: `(forall (?i - item) ...)`."""

    variables: tuple[TypedVariable, ...]
    effect: Effect


@dataclass(frozen=True, slots=True)
class When(Located):
    """The effect if the condition was true before."""

    condition: Expression
    effect: Effect


@dataclass(frozen=True, slots=True)
class NumericEffect(Located):
    """A change of a function's value: `(increase (failures ?i) 1)`; `operator` is one of `ASSIGNMENTS`."""

    operator: str
    call: Call
    value: Term


Effect = Add | Delete | AllOf | ForEach | When | NumericEffect

NO_EFFECT = AllOf(())
"""`(and)`, the effect that changes nothing."""

ASSIGNMENTS = ("assign", "increase", "decrease", "scale-up", "scale-down")
EFFECT_KEYWORDS = ("and", "not", "forall", "when", *ASSIGNMENTS)
"""The words at the start of an effect that are not predicates."""

Form = Expression | Term | Effect


def parts_of_form(form: Form) -> tuple[Form, ...]:
    """Return the effects, conditions and terms that `form` directly consists of."""
    match form:
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
            return parts_of(form)


def substitute_effect(effect: Effect, bindings: Mapping[str, Value | Term]) -> Effect:
    """Return the effect with its free variables replaced by the values or terms in `bindings`.

    A variable of an inner `forall` hides an outer variable of the same name.
    """
    match effect:
        case Add(atom) | Delete(atom):
            return replace(effect, atom=substitute(atom, bindings))
        case AllOf(parts):
            return replace(effect, parts=tuple(substitute_effect(part, bindings) for part in parts))
        case ForEach(variables, inner):
            own = {v.name for v in variables}
            outer = {name: value for name, value in bindings.items() if name not in own}
            return replace(effect, effect=substitute_effect(inner, outer))
        case When(condition, inner):
            return replace(effect, condition=substitute(condition, bindings), effect=substitute_effect(inner, bindings))
        case NumericEffect(_, call, value):
            return replace(effect, call=substitute(call, bindings), value=substitute(value, bindings))


def quantified_in(form: Form) -> frozenset[str]:
    """Return the names of the variables that quantifiers in a condition or effect bind."""
    inner = frozenset[str]().union(*map(quantified_in, parts_of_form(form)))
    return inner | {v.name for v in form.variables} if isinstance(form, Exists | Forall | ForEach) else inner


def mentioned(form: Form) -> frozenset[str]:
    """Return the variables that a condition, term or effect contains and does not itself bind."""
    if not isinstance(form, Effect):
        return free_variables(form)
    inner = frozenset[str]().union(*map(mentioned, parts_of_form(form)))
    return inner - {v.name for v in form.variables} if isinstance(form, ForEach) else inner


def effect_parts(effect: Effect) -> Iterator[Effect]:
    """Yield the effect and all effects inside it."""
    yield effect
    for part in parts_of_form(effect):
        if isinstance(part, Effect):
            yield from effect_parts(part)


def effect_leaves(effect: Effect) -> Iterator[Add | Delete | NumericEffect]:
    """Return an iterator over the single changes that an effect consists of."""
    return (part for part in effect_parts(effect) if isinstance(part, Add | Delete | NumericEffect))


def effect_conditions(effect: Effect) -> Iterator[Expression]:
    """Return an iterator over the conditions of all conditional effects."""
    return (part.condition for part in effect_parts(effect) if isinstance(part, When))


_shallow: IdentityCache[Form, bool] = IdentityCache()


def check_depth(form: Form) -> None:
    """Raise `InputError` if `form` is nested deeper than `MAX_DEPTH`; the result is cached by identity."""
    if _shallow.find(form, None):
        return
    level = [form]
    for _ in range(MAX_DEPTH):
        level = [part for one in level for part in parts_of_form(one) if not isinstance(part, Variable | Constant)]
        if not level:
            _shallow.keep(form, None, made=True)
            return
    raise InputError(f"this is nested more than {MAX_DEPTH} deep", place=level[0].place or form.place)
