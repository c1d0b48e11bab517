"""How deep conditions, terms and effects may be nested: everything that walks them recurses.

Text is limited when it is read; values that were built in Python are judged here, without recursion, when
they first come in.
"""

from __future__ import annotations

from knowledge_base.errors import InputError
from knowledge_base.language.effect import Add, AllOf, Delete, Effect, ForEach, NumericEffect, When
from knowledge_base.language.expression import Constant, Expression, Term, Variable, parts_of
from knowledge_base.language.identity_cache import IdentityCache
from knowledge_base.language.sexpr import MAX_DEPTH

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
