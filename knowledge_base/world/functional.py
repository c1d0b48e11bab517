"""Functional predicates: the last argument is settled by the others, as where a robot is (`robot-at ?place`)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from knowledge_base.errors import SchemaError
from knowledge_base.facts import Delta, Fact, Value
from knowledge_base.language.world import World

_Key = tuple[str, tuple[Value, ...]]


def rivals(fact: Fact, world: World) -> Iterator[Fact]:
    """The facts that hold and differ from `fact` in nothing but the last argument."""
    found = world.match(fact.predicate, (*fact.args[:-1], None))
    return (Fact(fact.predicate, args) for args in list(found) if args != fact.args)


def require_single(delta: Delta, world: World) -> None:
    """Raise an error if after `delta`, applied to `world`, two facts say different things of the same.

    Raises:
        SchemaError: two replacements of the same, or two facts of a functional predicate; both are named.
    """
    replaced = _grouped(delta.replaced)
    for facts in replaced.values():
        _require_one(facts, "are two replacements of the same")
    functional = world.schema.functional
    if not functional:
        return
    removed, gone = set(delta.removed), set(delta.removed_nodes)
    added = _grouped(f for f in delta.added if f.predicate in functional)
    for key, facts in added.items():
        before = replaced.get(key) or rivals(next(iter(facts)), world)
        stay = [f for f in before if f not in removed and gone.isdisjoint(f.args)]
        _require_one({**dict.fromkeys(stay), **facts}, f"cannot both be true, as '{key[0]}' is functional; use replace")


def _grouped(facts: Iterable[Fact]) -> dict[_Key, dict[Fact, None]]:
    found: dict[_Key, dict[Fact, None]] = {}
    for fact in facts:
        found.setdefault((fact.predicate, fact.args[:-1]), {})[fact] = None
    return found


def _require_one(facts: dict[Fact, None], wrong: str) -> None:
    if len(facts) > 1:
        first, second, *_ = facts
        raise SchemaError(f"{first} and {second} {wrong}")
