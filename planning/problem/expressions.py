"""Expressions of a domain: the names they read and change, and substitution in them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace

from knowledge_base.language.checking.vocabulary import ROOT_TYPE, VALUE_TYPES
from knowledge_base.language.syntax.effect import (
    Add,
    AllOf,
    Delete,
    Effect,
    ForEach,
    NumericEffect,
    When,
    effect_leaves,
)
from knowledge_base.language.syntax.expression import (
    And,
    Arithmetic,
    Atom,
    Call,
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
    free_variables,
    parts_of,
)
from planning.domain import PlanningAction


def names_of(e: Expression | Term) -> Iterator[str]:
    """Yield the predicates, types and functions in an expression."""
    agenda = [e]
    while agenda:
        one = agenda.pop()
        if isinstance(one, Constant | Variable):
            continue
        if isinstance(one, Atom):
            yield one.predicate
        elif isinstance(one, Call):
            yield one.function
        agenda.extend(reversed(parts_of(one)))


def name_of(leaf: Add | Delete | NumericEffect) -> str:
    """Return the predicate or function of a change."""
    return leaf.call.function if isinstance(leaf, NumericEffect) else leaf.atom.predicate


def changed(effect: Effect) -> frozenset[str]:
    """Return the predicates and functions that an effect changes."""
    return frozenset(map(name_of, effect_leaves(effect)))


def denied(e: Expression | Term, *, wanted: bool) -> Iterator[Atom]:
    """Yield the atoms under an odd number of negations; with `wanted` false, under an even number."""
    match e:
        case Atom():
            yield from () if wanted else (e,)
        case Not(body):
            yield from denied(body, wanted=not wanted)
        case Imply(premise, conclusion):
            yield from denied(premise, wanted=not wanted)
            yield from denied(conclusion, wanted=wanted)
        case _:
            for part in parts_of(e):
                yield from denied(part, wanted=wanted)


def rewritten(action: PlanningAction, rewrite: Callable[[Expression], Expression]) -> PlanningAction:
    """Return the action with each of its conditions rewritten."""
    timed = action.timed and replace(
        action.timed,
        start=rewrite(action.timed.start),
        over_all=rewrite(action.timed.over_all),
        end=rewrite(action.timed.end),
        start_effect=_rewritten(action.timed.start_effect, rewrite),
        end_effect=_rewritten(action.timed.end_effect, rewrite),
    )
    effect = _rewritten(action.effect, rewrite)
    return replace(action, precondition=rewrite(action.precondition), effect=effect, timed=timed)


def _rewritten(effect: Effect, rewrite: Callable[[Expression], Expression]) -> Effect:
    match effect:
        case AllOf(parts):
            return replace(effect, parts=tuple(_rewritten(part, rewrite) for part in parts))
        case ForEach(_, body):
            return replace(effect, effect=_rewritten(body, rewrite))
        case When(condition, body):
            return replace(effect, condition=rewrite(condition), effect=_rewritten(body, rewrite))
        case _:
            return effect


def type_test(parameter: TypedVariable, term: Term) -> Expression:
    """Return the test that a term is of the parameter's type; values are checked where they are written."""
    types = [one for one in parameter.types or (ROOT_TYPE,) if one not in VALUE_TYPES]
    return Or(tuple(Atom(one, (term,)) for one in types)) if types else And(())


def instantiated(e: Expression, terms: Mapping[str, Term]) -> Expression:
    """Return the condition with terms for its free variables; bound variables are renamed where they would clash."""
    match e:
        case Atom(_, args):
            return replace(e, args=_all(args, terms))
        case Not(body):
            return replace(e, body=instantiated(body, terms))
        case And(parts) | Or(parts):
            return replace(e, parts=tuple(instantiated(part, terms) for part in parts))
        case Imply(premise, conclusion):
            return Imply(instantiated(premise, terms), instantiated(conclusion, terms), place=e.place)
        case Comparison(operator, left, right):
            return Comparison(operator, _term(left, terms), _term(right, terms), place=e.place)
        case Exists(variables, body) | Forall(variables, body):
            renamed = _renamed(variables, terms)
            inner = {**terms, **{old.name: Variable(new.name) for old, new in zip(variables, renamed, strict=True)}}
            return replace(e, variables=renamed, body=instantiated(body, inner))


def _renamed(variables: tuple[TypedVariable, ...], terms: Mapping[str, Term]) -> tuple[TypedVariable, ...]:
    taken = frozenset().union(*map(free_variables, terms.values()))

    def fresh(name: str) -> str:
        while name in taken:
            name += "'"
        return name

    return tuple(replace(variable, name=fresh(variable.name)) for variable in variables)


def _all(args: tuple[Term, ...], terms: Mapping[str, Term]) -> tuple[Term, ...]:
    return tuple(_term(arg, terms) for arg in args)


def _term(term: Term, terms: Mapping[str, Term]) -> Term:
    match term:
        case Variable(name):
            return terms.get(name, term)
        case Call(_, args) | Arithmetic(_, args):
            return replace(term, args=_all(args, terms))
        case _:
            return term
