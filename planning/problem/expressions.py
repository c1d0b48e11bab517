"""Functions on expressions of a domain: the names that they read and change, and replacement of conditions."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from knowledge_base.language.checking.vocabulary import ROOT_TYPE, VALUE_TYPES
from knowledge_base.language.syntax import effect as eff
from knowledge_base.language.syntax import expression as ex
from knowledge_base.language.syntax.expression import Atom, Expression, Term
from planning.domain import PlanningAction


def inside(e: Expression | Term) -> list[Expression | Term]:
    """Return the expression and all expressions and terms in it, in the order of the text."""
    found: list[Expression | Term] = []
    agenda = [e]
    while agenda:
        one = agenda.pop()
        found.append(one)
        if not isinstance(one, ex.Constant | ex.Variable):
            agenda.extend(reversed(ex.parts_of(one)))
    return found


def names_of(e: Expression | Term) -> list[str]:
    """Return the predicates, types and functions in an expression, with repetitions."""
    return [name for one in inside(e) if (name := name_in(one)) is not None]


def name_in(e: Expression | Term) -> str | None:
    """Return the predicate or function of the outermost expression; `None` if it has neither."""
    return e.function if isinstance(e, ex.Call) else e.predicate if isinstance(e, Atom) else None


def conditions_of(action: PlanningAction) -> tuple[Expression, ...]:
    """Return the precondition of the action and the conditions of its conditional effects."""
    return (action.precondition, *eff.effect_conditions(action.effect))


def name_of(leaf: eff.Add | eff.Delete | eff.NumericEffect) -> str:
    """Return the predicate or function that the effect changes."""
    return leaf.call.function if isinstance(leaf, eff.NumericEffect) else leaf.atom.predicate


def changed(effect: eff.Effect) -> frozenset[str]:
    """Return the predicates and functions that an effect changes."""
    return frozenset(map(name_of, eff.effect_leaves(effect)))


def denied(e: Expression | Term, *, wanted: bool) -> Iterator[Atom]:
    """Yield the atoms under an odd number of negations; if `wanted` is false, under an even number."""
    match e:
        case Atom():
            yield from () if wanted else (e,)
        case ex.Not(body):
            yield from denied(body, wanted=not wanted)
        case ex.Imply(premise, conclusion):
            yield from denied(premise, wanted=not wanted)
            yield from denied(conclusion, wanted=wanted)
        case _:
            for part in ex.parts_of(e):
                yield from denied(part, wanted=wanted)


def with_atoms(e: Expression, instead: Callable[[Atom], Expression]) -> Expression:
    """Return the condition in which `instead` has replaced each atom."""
    match e:
        case Atom():
            return instead(e)
        case ex.Not(body) | ex.Exists(_, body) | ex.Forall(_, body):
            return replace(e, body=with_atoms(body, instead))
        case ex.And(parts) | ex.Or(parts):
            return replace(e, parts=tuple(with_atoms(part, instead) for part in parts))
        case ex.Imply(premise, conclusion):
            return replace(e, premise=with_atoms(premise, instead), conclusion=with_atoms(conclusion, instead))
        case ex.Comparison():
            return e


def rewritten(action: PlanningAction, rewrite: Callable[[Expression], Expression]) -> PlanningAction:
    """Return the action in which `rewrite` has replaced each condition."""
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


def _rewritten(effect: eff.Effect, rewrite: Callable[[Expression], Expression]) -> eff.Effect:
    match effect:
        case eff.AllOf(parts):
            return replace(effect, parts=tuple(_rewritten(part, rewrite) for part in parts))
        case eff.ForEach(_, body):
            return replace(effect, effect=_rewritten(body, rewrite))
        case eff.When(condition, body):
            return replace(effect, condition=rewrite(condition), effect=_rewritten(body, rewrite))
        case _:
            return effect


def type_test(parameter: ex.TypedVariable, term: Term) -> Expression:
    """Return the test that a term has the parameter's type; the types of values need no test."""
    types = [one for one in parameter.types or (ROOT_TYPE,) if one not in VALUE_TYPES]
    return ex.Or(tuple(Atom(one, (term,)) for one in types)) if types else ex.TRUE
