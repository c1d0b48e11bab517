"""Other names for variables, without one being caught by a quantifier that it does not belong to."""

from __future__ import annotations

import itertools
from collections.abc import Container, Mapping
from dataclasses import replace

from knowledge_base.language.expression import (
    And,
    Arithmetic,
    Atom,
    Call,
    Comparison,
    Exists,
    Expression,
    Forall,
    Imply,
    Not,
    Or,
    Term,
    Variable,
    free_variables,
)


def fresh(name: str, taken: Container[str]) -> str:
    """The name with a number behind it, so that it is none of those taken."""
    return next(other for n in itertools.count(2) if (other := f"{name}_{n}") not in taken)


def renamed(e: Expression, names: Mapping[str, str]) -> Expression:
    """`e` with other names for free variables; a quantified variable that a new name would meet gets out of its way."""
    match e:
        case Atom(_, args):
            return replace(e, args=tuple(renamed_term(a, names) for a in args))
        case Not(body):
            return replace(e, body=renamed(body, names))
        case And(parts) | Or(parts):
            return replace(e, parts=tuple(renamed(p, names) for p in parts))
        case Imply(premise, conclusion):
            return replace(e, premise=renamed(premise, names), conclusion=renamed(conclusion, names))
        case Comparison(_, left, right):
            return replace(e, left=renamed_term(left, names), right=renamed_term(right, names))
        case Exists(variables, body) | Forall(variables, body):
            own = {v.name for v in variables}
            outer = {old: new for old, new in names.items() if old not in own and old in free_variables(body)}
            taken = own | free_variables(body) | set(outer.values())
            moved = {old: fresh(old, taken) for old in own & set(outer.values())}
            variables = tuple(replace(v, name=moved.get(v.name, v.name)) for v in variables)
            return replace(e, variables=variables, body=renamed(body, {**outer, **moved}))


def renamed_term(term: Term, names: Mapping[str, str]) -> Term:
    """`term` with other names for variables."""
    match term:
        case Variable(name) if name in names:
            return replace(term, name=names[name])
        case Call(_, args) | Arithmetic(_, args):
            return replace(term, args=tuple(renamed_term(a, names) for a in args))
        case _:
            return term
