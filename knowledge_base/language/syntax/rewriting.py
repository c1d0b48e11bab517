"""Parts of expressions, the names in them, and replacement of atoms."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

from knowledge_base.language.syntax import expression as ex
from knowledge_base.language.syntax.expression import Atom, Expression, Term


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


def opposite(e: Expression) -> Expression:
    """Return the negation of `e`, with `not` moved to the parts, so that these can be looked up."""
    match e:
        case ex.Not(body):
            return body
        case ex.Or(parts):
            return ex.And(tuple(opposite(p) for p in parts), place=e.place)
        case ex.Imply(premise, conclusion):
            return ex.And((premise, opposite(conclusion)), place=e.place)
        case _:
            return ex.Not(e, place=e.place)


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
    return _with_leaves(e, lambda leaf: instead(leaf) if isinstance(leaf, Atom) else leaf)


def with_terms(e: Expression, instead: Callable[[Term], Term]) -> Expression:
    """Return the condition in which `instead` has replaced each argument of an atom and each side of a comparison."""

    def rewrite(leaf: Atom | ex.Comparison) -> Expression:
        if isinstance(leaf, Atom):
            return replace(leaf, args=tuple(map(instead, leaf.args)))
        return replace(leaf, left=instead(leaf.left), right=instead(leaf.right))

    return _with_leaves(e, rewrite)


def _with_leaves(e: Expression, instead: Callable[[Atom | ex.Comparison], Expression]) -> Expression:
    """Return the condition in which `instead` has replaced each atom and each comparison."""
    match e:
        case ex.Not(body) | ex.Exists(_, body) | ex.Forall(_, body):
            return replace(e, body=_with_leaves(body, instead))
        case ex.And(parts) | ex.Or(parts):
            return replace(e, parts=tuple(_with_leaves(part, instead) for part in parts))
        case ex.Imply(premise, conclusion):
            return replace(e, premise=_with_leaves(premise, instead), conclusion=_with_leaves(conclusion, instead))
        case _:
            return instead(e)
