"""What no engine can foresee: what Python computes from things that change, and changing content that is no number."""

from __future__ import annotations

from typing import TYPE_CHECKING

from knowledge_base.language.effect import effect_conditions
from knowledge_base.language.expression import Atom, Call, Comparison, Expression, Term, parts_of
from knowledge_base.language.printer import to_text
from planning.errors import UnsupportedActionError, UnsupportedGoalError
from planning.posing.relevance import changed

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable, Iterator

    from knowledge_base.world.schema import Schema
    from planning.domain import PlanningAction, PlanningDomain


def refuse_unforeseeable(goal: Expression, actions: Iterable[PlanningAction], domain: PlanningDomain) -> None:
    """Raise an error if the goal, or one of the relevant actions, asks for what no engine can foresee.

    Raises:
        UnsupportedGoalError, UnsupportedActionError: with the place, and what is asked for.
    """
    schema = domain.schema
    changing = frozenset[str]().union(*(changed(action.effect) for action in domain.actions.values()))
    content = {name for name in changing & schema.functions.keys() if schema.result(name) != "number"}
    if not content and not schema.computed:
        return
    for asked, why in _asked(goal, schema, changing, content):
        raise UnsupportedGoalError(f"the goal asks for {why}", place=asked.place)
    for action in actions:
        for condition in (action.precondition, *effect_conditions(action.effect)):
            for asked, why in _asked(condition, schema, changing, content):
                raise UnsupportedActionError(f"planning action '{action.name}' asks for {why}", place=asked.place)


def _asked(
    e: Expression, schema: Schema, changing: Collection[str], content: Collection[str]
) -> Iterator[tuple[Expression, str]]:
    for atom, read in _computed_from(e, schema, changing):
        told = f"{to_text(atom)} reads {to_text(read)}"
        yield atom, f"what is computed from something that planning actions change: {told}"
    for part in _parts(e):
        if isinstance(part, Comparison | Atom) and any(_name(inner) in content for inner in _parts(part)):
            yield part, f"a value that planning actions change, and which is no number: {to_text(part)}"


def _computed_from(
    e: Expression | Term, schema: Schema, changing: Collection[str]
) -> Iterator[tuple[Atom, Expression | Term]]:
    """The computed atoms in `e`, each with what it reads of the functions and predicates in `changing`."""
    if isinstance(e, Atom) and e.predicate in schema.computed:
        for read in schema.computed[e.predicate].inputs(e.args):
            yield from ((e, part) for part in _parts(read) if _name(part) in changing)
            yield from ((e, inner) for _, inner in _computed_from(read, schema, changing))
    for part in parts_of(e):
        yield from _computed_from(part, schema, changing)


def _parts(e: Expression | Term) -> Iterator[Expression | Term]:
    yield e
    for part in parts_of(e):
        yield from _parts(part)


def _name(e: Expression | Term) -> str | None:
    """The function or predicate that it asks about."""
    return e.function if isinstance(e, Call) else e.predicate if isinstance(e, Atom) else None
